/* Decorations are placed one after the other, each in a rectangle (block) of its own. The first blocks are the areas
 * that other pictures cover, because these cannot move. Then text at the top and the bottom is placed, because it
 * depends most on the borders. Colour bars share the remaining height of the picture at their side. Every other block
 * gets the free position nearest to its anchor, the corner or side of the picture at which it should be. Candidate
 * positions align with edges of the blocks already placed, so that their number is small and bounded. */
#include "layout.h"

#include <algorithm>
#include <cmath>

namespace
{

/* Lengths as multiples of the height of the text.
 * border: distance of all blocks from the edges of the picture. padding: distance of a block's content from the edges
 * of the block, and width of the gap around covered areas. line_height: distance between the baselines of two lines.
 * baseline: distance from the top of a line to its baseline. thickness: width of a colour bar's colours. label_width:
 * width above which a colour bar's label is wrapped, unless the bar with its numbers is wider. foot: space below a
 * colour bar, for the lower half of the lowest number. shortest_bar: minimum height of a colour bar. tick_distance:
 * minimum distance between ticks with numbers. column_gap: distance between columns of colour bars. */
const double border = 0.55, padding = 0.15, line_height = 1.2, baseline = 0.95, thickness = 0.9;
const double label_width = 7, foot = 0.5, shortest_bar = 4, tick_distance = 1.2, column_gap = 0.5;
const double size_factors[] = {1, 0.85, 0.7, 0.55, 0.45};
enum { SMALLEST = 6, MOST_LINES = 3, MOST_LABEL_LINES = 4 }; /* text of 6 pixels is the smallest that can be read */

struct layout_state {
    const insitu_image &image;
    const insitu_decorations &decorations;
    const text_measure &measure;
    int size;
    double x0, y0, x1, y1; /* rectangle of the picture without its border, in pixels */
    layout out;
};

double pixels(double share, int size)
{
    return std::ceil(share * size);
}

/* Returns the text sizes to try, in descending order from the given one. No size is below the legible minimum SMALLEST,
 * unless the given size is. */
std::vector<int> list_text_sizes(double size)
{
    std::vector<int> out;
    for (const double factor : size_factors) {
        const int next = std::max(static_cast<int>(std::lround(factor * size)),
                                  std::min<int>(SMALLEST, std::max(1, static_cast<int>(size))));
        if (out.empty() || next < out.back()) out.push_back(next);
    }
    return out;
}

/* ---- free positions --------------------------------------------------------------------------------------------- */

bool are_apart(const area &a, const area &b)
{
    return a.x1 <= b.x0 || b.x1 <= a.x0 || a.y1 <= b.y0 || b.y1 <= a.y0;
}

bool is_free(const layout_state &s, const area &bounds)
{
    if (!(bounds.x0 >= s.x0 && bounds.y0 >= s.y0 && bounds.x1 <= s.x1 && bounds.y1 <= s.y1)) return false;
    return std::all_of(s.out.blocks.begin(), s.out.blocks.end(),
                       [&](const block &b) { return are_apart(bounds, b.bounds); });
}

bool is_left(insitu_anchor at)
{
    return at == INSITU_TOP_LEFT || at == INSITU_LEFT || at == INSITU_BOTTOM_LEFT;
}

bool is_right(insitu_anchor at)
{
    return at == INSITU_TOP_RIGHT || at == INSITU_RIGHT || at == INSITU_BOTTOM_RIGHT;
}

bool is_at_side(insitu_anchor at)
{
    return at == INSITU_LEFT || at == INSITU_RIGHT;
}

area find_anchored_bounds(const layout_state &s, insitu_anchor at, double width, double height)
{
    const double middle_x = std::floor(0.5 * (s.image.width - width)),
                 middle_y = std::floor(0.5 * (s.image.height - height));
    const double x = is_left(at) ? s.x0 : is_right(at) ? s.x1 - width : middle_x;
    const double y = is_at_side(at) ? middle_y : at <= INSITU_TOP_RIGHT ? s.y0 : s.y1 - height;
    return {x, y, x + width, y + height};
}

/* Finds the free position of a rectangle of this size that is nearest to its anchor. Horizontal distances count three
 * times, so that blocks with the same anchor are stacked. */
bool find_free_bounds(const layout_state &s, insitu_anchor at, double width, double height, area &bounds)
{
    const area anchored = find_anchored_bounds(s, at, width, height);
    std::vector<double> xs{anchored.x0}, ys{anchored.y0};
    for (const block &b : s.out.blocks) {
        xs.insert(xs.end(), {b.bounds.x1, b.bounds.x0 - width});
        ys.insert(ys.end(), {b.bounds.y1, b.bounds.y0 - height});
    }
    double least = HUGE_VAL;
    for (const double x : xs)
        for (const double y : ys) {
            const double distance = 3 * std::abs(x - anchored.x0) + std::abs(y - anchored.y0);
            if (!(distance < least) || !is_free(s, {x, y, x + width, y + height})) continue;
            least = distance;
            bounds = {x, y, x + width, y + height};
        }
    return least < HUGE_VAL;
}

/* ---- lines of text ---------------------------------------------------------------------------------------------- */

/* Returns how many bytes at the beginning of a word fit in the width if no UTF-8 character is divided. The result
 * covers at least one character, even if this does not fit. */
std::size_t count_bytes_that_fit(const layout_state &s, const std::string &word, int size, double available_width)
{
    const double width = s.measure(word, size);
    auto bytes = static_cast<std::size_t>(static_cast<double>(word.size()) * available_width / std::max(1.0, width));
    const auto is_within = [&](std::size_t i) { return (static_cast<unsigned char>(word[i]) & 0xC0) == 0x80; };
    for (bytes = std::min(bytes, word.size()); bytes > 0; bytes--)
        if (bytes == word.size() || (!is_within(bytes) && s.measure(word.substr(0, bytes), size) <= available_width))
            return bytes;
    for (bytes = 1; bytes < word.size() && is_within(bytes);) bytes++;
    return bytes;
}

/* Wraps text at blanks. A word that is wider than the available width is divided. */
std::vector<std::string> wrap_text(const layout_state &s, const std::string &text, int size, double available_width)
{
    std::vector<std::string> lines;
    if (s.measure(text, size) <= available_width) return {text};
    std::string line;
    for (std::size_t at = 0; at < text.size();) {
        const std::size_t end = std::min(text.find(' ', at), text.size());
        std::string word = text.substr(at, end - at);
        at = end + 1;
        std::string longer = line;
        if (!line.empty()) longer += ' ';
        longer += word;
        if (s.measure(longer, size) <= available_width) {
            line = longer;
            continue;
        }
        if (!line.empty()) lines.push_back(line);
        while (s.measure(word, size) > available_width &&
               !word.empty()) { /* each iteration removes at least one character */
            const std::size_t bytes = count_bytes_that_fit(s, word, size, available_width);
            lines.push_back(word.substr(0, bytes));
            word.erase(0, bytes);
        }
        line = word;
    }
    if (!line.empty()) lines.push_back(line);
    return lines;
}

double measure_widest_line(const layout_state &s, const std::vector<std::string> &lines, int size)
{
    int width = 0;
    for (const std::string &line : lines) width = std::max(width, s.measure(line, size));
    return width;
}

/* Checks whether the text was wrapped only at blanks. */
bool is_wrapped_at_blanks(const std::string &text, const std::vector<std::string> &lines)
{
    std::string joined;
    for (const std::string &line : lines) joined += (joined.empty() ? "" : " ") + line;
    return joined == text || lines.size() == 1;
}

/* Adds lines of text to the block, aligned to the side of the picture at which the anchor is. */
void align_lines(const layout_state &s, const std::vector<std::string> &lines, insitu_anchor at, block &b)
{
    double y = b.bounds.y0 + pixels(padding, b.size) + baseline * b.size;
    for (const std::string &line : lines) {
        const double left = b.bounds.x0 + pixels(padding, b.size),
                     over = b.bounds.x1 - pixels(padding, b.size) - left - s.measure(line, b.size);
        b.lines.push_back({line, left + (is_left(at) ? 0 : is_right(at) ? over : 0.5 * over), y});
        y += line_height * b.size;
    }
}

bool place_words(layout_state &s, int index)
{
    static const double shares[] = {1, 0.5, 0.3};
    const insitu_words &words = s.decorations.words[index];
    const std::vector<int> sizes = list_text_sizes(s.size * static_cast<double>(words.size));
    for (const int size : sizes)
        for (const double share : shares) {
            const double pads = 2 * pixels(padding, size), available_width = share * (s.x1 - s.x0) - pads;
            if (!(available_width > size)) continue;
            const std::vector<std::string> lines = wrap_text(s, words.text, size, available_width);
            const bool is_last = size == sizes.back();
            if (!is_last && (lines.size() > MOST_LINES || !is_wrapped_at_blanks(words.text, lines))) continue;
            block b{block_kind::words, index, size, {}, {}, {}, {}};
            const double height = std::ceil(static_cast<double>(lines.size()) * line_height * size) + pads;
            if (!find_free_bounds(s, words.at, measure_widest_line(s, lines, size) + pads, height, b.bounds)) continue;
            align_lines(s, lines, words.at, b);
            s.out.blocks.push_back(b);
            return true;
        }
    return false;
}

/* ---- colour bars ------------------------------------------------------------------------------------------------ */

/* The colour bars at one side of the picture, with texts of the height `size`. All bars get the width of the widest
 * one, `width`. Above each bar there is a space of height `head`, in which the highest label fits. */
struct bar_group {
    std::vector<int> bars;
    insitu_anchor anchor;
    int size;
    double width, head;
    std::vector<std::vector<std::string>> labels;
    bool is_readable; /* set if the labels have few lines and no divided words */
};

bar_group make_group(const layout_state &s, const std::vector<int> &bars, insitu_anchor at, int size)
{
    bar_group g{bars, at, size, 0, 0, {}, true};
    std::size_t lines = 0;
    for (const int i : bars) {
        const insitu_colour_bar &bar = s.decorations.bars[i];
        int numbers = 0;
        for (int k = 0; k < bar.tick_count; k++) numbers = std::max(numbers, s.measure(bar.ticks[k].text, size));
        const double body = (thickness + 0.5) * size + numbers;
        const double most = std::min(std::max(body, label_width * size), s.x1 - s.x0 - 2 * pixels(padding, size));
        g.labels.push_back(wrap_text(s, bar.label, size, most));
        g.is_readable = g.is_readable && g.labels.back().size() <= MOST_LABEL_LINES &&
                        is_wrapped_at_blanks(bar.label, g.labels.back());
        g.width = std::max({g.width, body, measure_widest_line(s, g.labels.back(), size)});
        lines = std::max(lines, g.labels.back().size());
    }
    g.width = std::ceil(g.width) + 2 * pixels(padding, size);
    g.head = std::ceil(line_height * static_cast<double>(lines) * size + 0.5 * size) + pixels(padding, size);
    return g;
}

/* Chooses every n-th tick, with the smallest n for which the numbers do not overlap. Among the possible first ticks,
 * the one with the shortest numbers is chosen, because these are the roundest. */
std::vector<int> choose_ticks(const insitu_colour_bar &bar, double length, int size)
{
    for (int every = 1; every < bar.tick_count; every++) {
        std::vector<int> best;
        double best_length = HUGE_VAL;
        for (int first = 0; first < every; first++) {
            std::vector<int> chosen;
            bool is_apart = true;
            double letters = 0;
            for (int i = first; i < bar.tick_count; i += every) {
                const double distance =
                    chosen.empty() ? HUGE_VAL : (bar.ticks[i].place - bar.ticks[chosen.back()].place) * length;
                is_apart = is_apart && distance >= tick_distance * size;
                letters += static_cast<double>(std::string(bar.ticks[i].text).size());
                chosen.push_back(i);
            }
            letters /= static_cast<double>(std::max<std::size_t>(1, chosen.size()));
            if (is_apart && letters < best_length) best = chosen, best_length = letters;
        }
        if (!best.empty()) return best;
    }
    return bar.tick_count ? std::vector<int>{0} : std::vector<int>{};
}

block make_bar(const layout_state &s, const bar_group &g, std::size_t n, const area &bounds)
{
    const insitu_colour_bar &bar = s.decorations.bars[g.bars[n]];
    const double left = bounds.x0 + pixels(padding, g.size), edge = pixels(foot + padding, g.size);
    block b{block_kind::bar, g.bars[n], g.size, bounds, {}, {}, {}};
    align_lines(s, g.labels[n], INSITU_LEFT, b);
    const double spare = std::floor(g.head - pixels(padding, g.size) - 0.5 * g.size -
                                    line_height * g.size * static_cast<double>(b.lines.size()));
    /* moves a label that has fewer lines than the labels of other bars down, so that it is directly above its bar */
    for (placed_line &line : b.lines) line.baseline += spare;
    b.gradient = {left, bounds.y0 + g.head, left + thickness * g.size, bounds.y1 - edge};
    b.ticks = choose_ticks(bar, b.gradient.y1 - b.gradient.y0, g.size);
    for (const int i : b.ticks)
        b.lines.push_back({bar.ticks[i].text, b.gradient.x1 + 0.5 * g.size,
                           compute_tick_y(bar.ticks[i], b.gradient) + 0.36 * g.size});
    return b;
}

/* Finds the range of y that is free for bars, from top to bottom, in the vertical strip of the picture from x0 to x1.
 * The range is below all blocks of the strip whose middle is in the upper half of the picture, and above all other
 * blocks of the strip. */
void find_free_height(const layout_state &s, double x0, double x1, double &top, double &bottom)
{
    top = s.y0, bottom = s.y1;
    for (const block &b : s.out.blocks) {
        if (b.bounds.x1 <= x0 || b.bounds.x0 >= x1) continue;
        if (b.bounds.y0 + b.bounds.y1 < s.image.height)
            top = std::max(top, b.bounds.y1);
        else
            bottom = std::min(bottom, b.bounds.y0);
    }
}

/* Returns the positions to try for the outer edge of the outermost column of bars: the border of the picture, and the
 * inner sides of covered areas, in case such an area takes too much of the height at the border. */
std::vector<double> list_column_edges(const layout_state &s, const bar_group &g)
{
    const bool is_at_left = g.anchor == INSITU_LEFT;
    const double gap = pixels(column_gap, g.size);
    std::vector<double> out{is_at_left ? s.x0 : s.x1};
    for (const block &b : s.out.blocks)
        if (b.kind == block_kind::covered) out.push_back(is_at_left ? b.bounds.x1 + gap : b.bounds.x0 - gap);
    return out;
}

/* Stacks `count` bars of the group, beginning with the bar `first`, in the given column. Returns false if they would be
 * too short or overlap another block. */
bool fill_column(const layout_state &s, const bar_group &g, std::size_t first, std::size_t count, double edge,
                 int column, std::vector<block> &out)
{
    const double pitch = g.width + pixels(column_gap, g.size);
    const double x0 = g.anchor == INSITU_LEFT ? edge + column * pitch : edge - column * pitch - g.width;
    double top = 0, bottom = 0;
    find_free_height(s, x0, x0 + g.width, top, bottom);
    const double share = count == 1 ? 0.62 : count == 2 ? 0.8 : 1;
    const double total = std::min(bottom - top, share * s.image.height);
    const double height = std::floor(total / static_cast<double>(count));
    if (height - g.head - pixels(foot + padding, g.size) < shortest_bar * g.size) return false;
    const double middle = std::floor(0.5 * (s.image.height - height * static_cast<double>(count)));
    double y = std::clamp(middle, top, std::max(top, bottom - height * static_cast<double>(count)));
    for (std::size_t n = first; n < first + count; n++, y += height) {
        const area bounds = {x0, y, x0 + g.width, y + height};
        if (!is_free(s, bounds)) return false;
        out.push_back(make_bar(s, g, n, bounds));
    }
    return true;
}

/* Places all bars of the group in the smallest number of columns in which they fit beside the edge. Several columns may
 * cover at most half of the picture's width; a single column may cover all of it. */
bool place_group(layout_state &s, const bar_group &g, double edge)
{
    const std::size_t count = g.bars.size();
    for (std::size_t columns = 1; columns <= count; columns++) {
        if (columns > 1 && static_cast<double>(columns) * g.width > 0.5 * s.image.width) return false;
        std::vector<block> bars;
        const std::size_t rows = (count + columns - 1) / columns;
        bool has_space = true;
        const std::size_t used = (count + rows - 1) / rows;
        for (std::size_t i = 0; i < used && has_space; i++) { /* the first column is the leftmost one */
            const std::size_t column = g.anchor == INSITU_LEFT ? i : used - 1 - i;
            has_space =
                fill_column(s, g, i * rows, std::min(rows, count - i * rows), edge, static_cast<int>(column), bars);
        }
        if (!has_space) continue;
        s.out.blocks.insert(s.out.blocks.end(), bars.begin(), bars.end());
        return true;
    }
    return false;
}

bool place_bars_at_largest_size(layout_state &s, const std::vector<int> &bars, insitu_anchor at)
{
    const std::vector<int> sizes = list_text_sizes(s.size);
    for (const int size : sizes) {
        const bar_group g = make_group(s, bars, at, size);
        if (!g.is_readable && size != sizes.back()) continue;
        for (const double edge : list_column_edges(s, g))
            if (place_group(s, g, edge)) return true;
    }
    return false;
}

std::string quote_decoration_name(const char *decorations, const char *text)
{
    enum { NAMED = 60 };
    std::string name = text;
    if (name.size() > NAMED) {
        name.erase(std::size_t{NAMED});
        while (!name.empty() && (static_cast<unsigned char>(name.back()) & 0xC0) == 0x80) name.pop_back();
        /* the last byte now begins a character that may have been cut; it is removed, even if it is a complete
         * letter */
        if (!name.empty()) name.pop_back();
        name += "...";
    }
    return std::string(decorations) + " \"" + name + "\"";
}

/* Places the bars of a side. If there is not enough space for all, the last ones are left out. */
void place_bars(layout_state &s, insitu_anchor at)
{
    std::vector<int> bars;
    for (int i = 0; i < s.decorations.bar_count; i++)
        if ((s.decorations.bars[i].at == INSITU_LEFT) == (at == INSITU_LEFT)) bars.push_back(i);
    while (!bars.empty() && !place_bars_at_largest_size(s, bars, at)) {
        s.out.left_out.push_back(quote_decoration_name("the colour bar", s.decorations.bars[bars.back()].label));
        bars.pop_back();
    }
}

/* ---- covered areas, scale bar, axes and labels ------------------------------------------------------------------ */

/* Adds a block for each area that another picture covers, with a gap around it, so that no decoration touches the frame
 * of that picture. */
void place_covered_areas(layout_state &s)
{
    const double gap = pixels(padding, s.size);
    for (int i = 0; i < s.decorations.covered_count; i++) {
        const insitu_rectangle &r = s.decorations.covered[i];
        const area bounds = {std::max(0.0, r.x - gap), std::max(0.0, r.y - gap),
                             std::min<double>(s.image.width, r.x + r.width + gap),
                             std::min<double>(s.image.height, r.y + r.height + gap)};
        s.out.blocks.push_back({block_kind::covered, i, s.size, bounds, {}, {}, {}});
    }
}

bool place_scale_bar(layout_state &s)
{
    const insitu_scale_bar &bar = s.decorations.scale_bar;
    for (const int size : list_text_sizes(s.size)) {
        const double pads = 2 * pixels(padding, size),
                     width = std::ceil(std::max<double>(s.measure(bar.text, size), bar.length));
        block b{block_kind::scale_bar, 0, size, {}, {}, {}, {}};
        if (!find_free_bounds(s, bar.at, width + pads, pixels(1.8, size) + pads, b.bounds)) continue;
        align_lines(s, {bar.text}, INSITU_TOP, b);
        s.out.blocks.push_back(b);
        return true;
    }
    return false;
}

bool place_axes(layout_state &s)
{
    for (const int size : list_text_sizes(s.size)) {
        block b{block_kind::axes, 0, size, {}, {}, {}, {}};
        if (!find_free_bounds(s, INSITU_BOTTOM_LEFT, pixels(6.8, size), pixels(6.8, size), b.bounds)) continue;
        s.out.blocks.push_back(b);
        return true;
    }
    return false;
}

/* Places a label so that the box of its text has the given distance from its point. The label is omitted if this
 * position is occupied. */
void place_label(layout_state &s, int index)
{
    const insitu_label &label = s.decorations.labels[index];
    const double width = s.measure(label.text, s.size), height = 0.75 * s.size;
    const double reach =
        label.gap * s.size + 0.5 * (std::abs(label.away[0]) * width + std::abs(label.away[1]) * height);
    const double x = label.at[0] + reach * label.away[0], y = label.at[1] + reach * label.away[1];
    const double gap = padding * s.size;
    const area bounds = {std::floor(x - 0.5 * width - gap), std::floor(y - 0.5 * height - gap),
                         std::ceil(x + 0.5 * width + gap), std::ceil(y + 0.5 * height + gap)};
    const area all = {s.x0, s.y0, s.x1, s.y1};
    s.x0 = s.y0 = 0, s.x1 = s.image.width, s.y1 = s.image.height;
    if (is_free(s, bounds))
        s.out.blocks.push_back(
            {block_kind::label, index, s.size, bounds, {{label.text, x - 0.5 * width, y + 0.5 * height}}, {}, {}});
    s.x0 = all.x0, s.y0 = all.y0, s.x1 = all.x1, s.y1 = all.y1;
}

void place_all_words(layout_state &s, bool at_sides)
{
    for (int i = 0; i < s.decorations.words_count; i++)
        if (*s.decorations.words[i].text && is_at_side(s.decorations.words[i].at) == at_sides && !place_words(s, i))
            s.out.left_out.push_back(quote_decoration_name("the words", s.decorations.words[i].text));
}

} // namespace

int compute_text_height(const insitu_image &image)
{
    return std::max(1, static_cast<int>(std::lround(image.decorations->size * image.height)));
}

double compute_tick_y(const insitu_tick &tick, const area &gradient)
{
    return gradient.y1 - tick.place * (gradient.y1 - gradient.y0);
}

layout make_layout(const insitu_image &image, const text_measure &measure)
{
    const int size = compute_text_height(image);
    const double edge = pixels(border, size);
    layout_state s{image, *image.decorations, measure, size, edge, edge, image.width - edge, image.height - edge, {}};
    place_covered_areas(s);
    place_all_words(s, false);
    place_bars(s, INSITU_RIGHT);
    place_bars(s, INSITU_LEFT);
    place_all_words(s, true);
    if (s.decorations.scale_bar.length > 0 && !place_scale_bar(s))
        s.out.left_out.push_back(quote_decoration_name("the scale bar", s.decorations.scale_bar.text));
    if (s.decorations.has_axes && !place_axes(s)) s.out.left_out.emplace_back("the axes");
    for (int i = 0; i < s.decorations.label_count; i++) place_label(s, i);
    return s.out;
}
