/* Everything is drawn in linear light on premultiplied colours, so that edges of lines and letters are smooth on any
 * background. Strokes that the picture hides are drawn under it, the background under these, and all else over it.
 * Sizes are shares of the picture's height: a picture of twice the size looks the same, only finer.
 */
#include "decorate.h"
#include "typeface.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace
{

struct sheet {
    const insitu_image &image;
    const insitu_decorations &what;
    std::vector<float> &rgba;
    typeface *font; /* NULL where there are no words */
    int size;       /* of words, pixels */
    double margin;
    std::vector<area> taken;
};

/* ---- pixels -------------------------------------------------------------------------------------------------- */

float *pixel_at(sheet &s, int x, int y)
{
    return &s.rgba[4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(s.image.width) +
                        static_cast<std::size_t>(x))];
}

/* Blends a colour of this opacity over the pixel, or under it. */
void blend(float *pixel, const float colour[3], double opacity, bool is_behind)
{
    const double seen = is_behind ? opacity * (1 - std::min(1.0, static_cast<double>(pixel[3]))) : opacity;
    const double kept = is_behind ? 1 : 1 - opacity;
    for (int c = 0; c < 4; c++)
        pixel[c] = static_cast<float>(pixel[c] * kept + (c < 3 ? static_cast<double>(colour[c]) : 1.0) * seen);
}

void put_background(sheet &s)
{
    for (std::size_t i = 0; i < s.rgba.size(); i += 4) {
        const float left = 1 - std::min(1.0F, s.rgba[i + 3]);
        for (std::size_t c = 0; c < 4; c++) s.rgba[i + c] += left * s.what.background[c];
    }
}

/* Returns how much of the pixel [x, x + 1) the interval covers. */
double covered(double low, double high, int x)
{
    return std::clamp(std::min(high, x + 1.0) - std::max(low, static_cast<double>(x)), 0.0, 1.0);
}

void fill(sheet &s, const area &a, const float colour[3], double opacity)
{
    const int x1 = std::min(s.image.width, static_cast<int>(std::ceil(a.x1)));
    const int y1 = std::min(s.image.height, static_cast<int>(std::ceil(a.y1)));
    for (int y = std::max(0, static_cast<int>(a.y0)); y < y1; y++)
        for (int x = std::max(0, static_cast<int>(a.x0)); x < x1; x++)
            blend(pixel_at(s, x, y), colour, opacity * covered(a.x0, a.x1, x) * covered(a.y0, a.y1, y), false);
}

double distance_to(const insitu_stroke &line, double x, double y)
{
    const double dx = line.to[0] - line.from[0], dy = line.to[1] - line.from[1];
    const double square = dx * dx + dy * dy;
    const double along = square > 0 ? ((x - line.from[0]) * dx + (y - line.from[1]) * dy) / square : 0;
    const double at = std::clamp(along, 0.0, 1.0);
    return std::hypot(x - (line.from[0] + at * dx), y - (line.from[1] + at * dy));
}

/* Goes row by row over the columns that the line may meet, so that lines cost their length, not their box. */
void draw_stroke(sheet &s, const insitu_stroke &line, double width, const float colour[3])
{
    const double reach = 0.5 * width + 1, dx = line.to[0] - line.from[0], dy = line.to[1] - line.from[1];
    const double top = std::min(line.from[1], line.to[1]) - reach, bottom = std::max(line.from[1], line.to[1]) + reach;
    for (int y = std::max(0, static_cast<int>(top)); y < std::min<double>(s.image.height, bottom); y++) {
        double low = std::min(line.from[0], line.to[0]), high = std::max(line.from[0], line.to[0]);
        if (dy != 0) {
            const double a = line.from[0] + (y - reach - line.from[1]) / dy * dx;
            const double b = line.from[0] + (y + 1 + reach - line.from[1]) / dy * dx;
            low = std::max(low, std::min(a, b));
            high = std::min(high, std::max(a, b));
        }
        const int first = static_cast<int>(std::clamp(low - reach, 0.0, static_cast<double>(s.image.width)));
        const double end = std::min(static_cast<double>(s.image.width), high + reach);
        for (int x = first; x < end; x++) {
            const double inside = 0.5 + 0.5 * width - distance_to(line, x + 0.5, y + 0.5);
            if (inside > 0) blend(pixel_at(s, x, y), colour, std::min(inside, 1.0), line.is_behind);
        }
    }
}

double line_width(const sheet &s)
{
    return std::max(1.0, s.image.height / 540.0);
}

void draw_strokes(sheet &s, bool behind)
{
    for (int i = 0; i < s.what.stroke_count; i++)
        if (s.what.strokes[i].is_behind == behind) draw_stroke(s, s.what.strokes[i], line_width(s), s.what.colour);
}

/* ---- words --------------------------------------------------------------------------------------------------- */

int width_of(const sheet &s, const std::string &text, int size)
{
    return s.font ? s.font->width_of(text, size) : 0;
}

/* Writes text from the left end of its baseline. */
void write_text(sheet &s, const std::string &text, double x, double baseline, int size)
{
    const int left = static_cast<int>(std::lround(x)), top = static_cast<int>(std::lround(baseline));
    if (!s.font) return;
    s.font->draw(text, size, 0, [&](int column, int row, double covered) {
        const int px = left + column, py = top + row;
        if (px >= 0 && py >= 0 && px < s.image.width && py < s.image.height)
            blend(pixel_at(s, px, py), s.what.colour, covered, false);
    });
}

/* Draws a plate in the background's colour, so that words can be read on any picture. */
void put_plate(sheet &s, const area &block)
{
    const float alpha = s.what.background[3];
    if (!(alpha > 0)) return;
    const float colour[3] = {s.what.background[0] / alpha, s.what.background[1] / alpha, s.what.background[2] / alpha};
    const double pad = 0.25 * s.size;
    fill(s, {block.x0 - pad, block.y0 - pad, block.x1 + pad, block.y1 + pad}, colour, 0.6 * static_cast<double>(alpha));
}

/* Words that are wider than the picture are made smaller. */
void draw_words(sheet &s, const insitu_words &words)
{
    int size = std::max(1, static_cast<int>(std::lround(s.size * static_cast<double>(words.size))));
    const double room = std::max(1.0, s.image.width - 2 * s.margin);
    int width = width_of(s, words.text, size);
    if (width > room) {
        size = std::max(1, static_cast<int>(size * room / width));
        width = width_of(s, words.text, size);
    }
    const area block = place_block(s.image, {words.at, 0}, width, 1.2 * size, s.margin, s.taken);
    put_plate(s, block);
    write_text(s, words.text, block.x0, block.y0 + 0.95 * size, size);
}

/* ---- colour bars --------------------------------------------------------------------------------------------- */

/* Looks a colour up, linear between the table's entries, as the renderer does. */
void colour_at(const insitu_colour_bar &bar, double place, float out[3])
{
    const int last = bar.colour_count - 1;
    const double x = std::clamp(place, 0.0, 1.0) * (bar.is_banded ? bar.colour_count : last);
    const int i = std::min(static_cast<int>(x), bar.is_banded ? last : last - 1);
    const float part = bar.is_banded ? 0 : static_cast<float>(x - i);
    for (int c = 0; c < 3; c++) {
        const float low = bar.colours[3 * i + c], high = bar.is_banded ? low : bar.colours[3 * i + 3 + c];
        out[c] = low + part * (high - low);
    }
}

void draw_gradient(sheet &s, const insitu_colour_bar &bar, const area &where)
{
    for (int y = static_cast<int>(where.y0); y < where.y1; y++) {
        float colour[3];
        colour_at(bar, (where.y1 - (y + 0.5)) / (where.y1 - where.y0), colour);
        fill(s, {where.x0, std::max(where.y0, static_cast<double>(y)), where.x1, std::min(where.y1, y + 1.0)}, colour,
             1);
    }
}

void draw_frame(sheet &s, const area &a)
{
    const double corners[4][2] = {{a.x0, a.y0}, {a.x1, a.y0}, {a.x1, a.y1}, {a.x0, a.y1}};
    for (int i = 0; i < 4; i++) {
        const double *from = corners[i], *to = corners[(i + 1) % 4];
        draw_stroke(s, {{from[0], from[1]}, {to[0], to[1]}, false}, line_width(s), s.what.colour);
    }
}

/* Draws small boxes beyond the ends, where values outside the range have colours of their own. */
void draw_outside(sheet &s, const insitu_colour_bar &bar, const area &where)
{
    const double height = 0.45 * s.size;
    const area below = {where.x0, where.y1, where.x1, where.y1 + height};
    const area above = {where.x0, where.y0 - height, where.x1, where.y0};
    if (bar.below) fill(s, below, bar.below, 1), draw_frame(s, below);
    if (bar.above) fill(s, above, bar.above, 1), draw_frame(s, above);
}

void draw_ticks(sheet &s, const insitu_colour_bar &bar, const area &where)
{
    for (int i = 0; i < bar.tick_count; i++) {
        const double y = where.y1 - bar.ticks[i].place * (where.y1 - where.y0), end = where.x1 + 0.3 * s.size;
        draw_stroke(s, {{where.x1, y}, {end, y}, false}, line_width(s), s.what.colour);
        write_text(s, bar.ticks[i].text, end + 0.2 * s.size, y + 0.36 * s.size, s.size);
    }
}

double width_of_bar(sheet &s, const insitu_colour_bar &bar, double thickness)
{
    int words = 0;
    for (int i = 0; i < bar.tick_count; i++) words = std::max(words, width_of(s, bar.ticks[i].text, s.size));
    return std::max<double>(width_of(s, bar.label, s.size), thickness + 0.5 * s.size + words);
}

/* Draws the label, a gap, and the bar with its ticks on the right. Bars of one side share its height and are as wide as
 * the widest, so that they stand in line. */
void draw_bar(sheet &s, const insitu_colour_bar &bar)
{
    int sharing = 0, before = 0;
    double width = 0;
    const double thickness = 0.9 * s.size, head = 1.7 * s.size, foot = 0.5 * s.size;
    for (int i = 0; i < s.what.bar_count; i++) {
        if (s.what.bars[i].at != bar.at) continue;
        sharing++;
        before += &s.what.bars[i] < &bar;
        width = std::max(width, width_of_bar(s, s.what.bars[i], thickness));
    }
    const double length = std::max(2.0 * s.size, 0.62 * s.image.height / sharing - head - foot);
    const double height = head + length + foot, gap = 0.5 * s.margin;
    const double above = (before - 0.5 * (sharing - 1)) * (height + gap); /* from the middle of the side */
    const area block = place_block(s.image, {bar.at, above}, width, height, s.margin, s.taken);
    const area gradient = {block.x0, block.y0 + head, block.x0 + thickness, block.y0 + head + length};
    put_plate(s, block);
    write_text(s, bar.label, block.x0, block.y0 + 0.95 * s.size, s.size);
    draw_gradient(s, bar, gradient);
    draw_frame(s, gradient);
    draw_outside(s, bar, gradient);
    draw_ticks(s, bar, gradient);
}

bool are_apart(const area &a, const area &b, double gap)
{
    return a.x1 + gap <= b.x0 || b.x1 + gap <= a.x0 || a.y1 + gap <= b.y0 || b.y1 + gap <= a.y0;
}

/* ---- lengths ------------------------------------------------------------------------------------------------- */

/* Draws the bar with its words above it. */
void draw_scale_bar(sheet &s)
{
    const insitu_scale_bar &bar = s.what.scale_bar;
    if (!(bar.length > 0)) return;
    const double words = width_of(s, bar.text, s.size), width = std::max(words, bar.length), tick = 0.25 * s.size;
    const area block = place_block(s.image, {bar.at, 0}, width, 1.7 * s.size, s.margin, s.taken);
    const double middle = 0.5 * (block.x0 + block.x1), y = block.y0 + 1.4 * s.size;
    const double x0 = middle - 0.5 * bar.length, x1 = middle + 0.5 * bar.length;
    put_plate(s, block);
    write_text(s, bar.text, middle - 0.5 * words, block.y0 + 0.9 * s.size, s.size);
    draw_stroke(s, {{x0, y}, {x1, y}, false}, 1.5 * line_width(s), s.what.colour);
    draw_stroke(s, {{x0, y - tick}, {x0, y + tick}, false}, 1.5 * line_width(s), s.what.colour);
    draw_stroke(s, {{x1, y - tick}, {x1, y + tick}, false}, 1.5 * line_width(s), s.what.colour);
}

/* Draws a number at an edge. The middle of the words is placed so that their box is a gap away from the point. */
void draw_label(sheet &s, const insitu_label &label)
{
    const double width = width_of(s, label.text, s.size), height = 0.75 * s.size;
    const double reach =
        label.gap * s.size + 0.5 * (std::abs(label.away[0]) * width + std::abs(label.away[1]) * height);
    const double x = label.at[0] + reach * label.away[0], y = label.at[1] + reach * label.away[1];
    const area block = {x - 0.5 * width, y - 0.5 * height, x + 0.5 * width, y + 0.5 * height};
    for (const area &other : s.taken)
        if (!are_apart(block, other, 0.2 * s.size)) return;
    s.taken.push_back(block);
    write_text(s, label.text, block.x0, block.y1, s.size);
}

/* ---- axes ---------------------------------------------------------------------------------------------------- */

/* Draws x, y and z in red, green and blue, beginning with the one that points away from the eye most. */
void draw_axes(sheet &s)
{
    static const float colours[3][3] = {{0.8F, 0.05F, 0.05F}, {0.05F, 0.5F, 0.05F}, {0.08F, 0.2F, 0.9F}};
    const double arm = 2.2 * s.size, side = 2 * arm + 2 * s.size;
    const area block = place_block(s.image, {INSITU_BOTTOM_LEFT, 0}, side, side, s.margin, s.taken);
    const double middle[2] = {0.5 * (block.x0 + block.x1), 0.5 * (block.y0 + block.y1)};
    int order[3] = {0, 1, 2};
    std::sort(order, order + 3, [&](int a, int b) { return s.what.axes[a][2] < s.what.axes[b][2]; });
    for (const int axis : order) {
        const double *d = s.what.axes[axis];
        const double tip[2] = {middle[0] + arm * d[0], middle[1] - arm * d[1]};
        const std::string name(1, static_cast<char>('x' + axis));
        draw_stroke(s, {{middle[0], middle[1]}, {tip[0], tip[1]}, false}, 1.5 * line_width(s), colours[axis]);
        write_text(s, name, middle[0] + (arm + 0.6 * s.size) * d[0] - 0.3 * s.size,
                   middle[1] - (arm + 0.6 * s.size) * d[1] + 0.3 * s.size, s.size);
    }
}

/* ---- the whole ----------------------------------------------------------------------------------------------- */

bool has_words(const insitu_decorations &what)
{
    return what.words_count > 0 || what.bar_count > 0 || what.has_axes || what.label_count > 0 ||
           what.scale_bar.length > 0;
}

bool is_at_right(insitu_anchor at)
{
    return at == INSITU_TOP_RIGHT || at == INSITU_RIGHT || at == INSITU_BOTTOM_RIGHT;
}

bool is_at_bottom(insitu_anchor at)
{
    return at == INSITU_BOTTOM_LEFT || at == INSITU_BOTTOM || at == INSITU_BOTTOM_RIGHT;
}

area block_at(const insitu_image &image, const spot &where, double width, double height, double margin)
{
    const insitu_anchor at = where.at;
    const bool is_centred = at == INSITU_TOP || at == INSITU_BOTTOM,
               is_middle = at == INSITU_LEFT || at == INSITU_RIGHT;
    const double x = is_centred ? 0.5 * (image.width - width) : is_at_right(at) ? image.width - margin - width : margin;
    const double y = is_middle          ? 0.5 * (image.height - height)
                     : is_at_bottom(at) ? image.height - margin - height
                                        : margin;
    return {x, y + where.down, x + width, y + where.down + height};
}

} // namespace

area place_block(const insitu_image &image, const spot &where, double width, double height, double margin,
                 std::vector<area> &taken)
{
    const area first = block_at(image, where, width, height, margin);
    area block = first;
    const double gap = 0.5 * margin;
    const auto is_in_way = [&](const area &a) { return !are_apart(block, a, 0.999 * gap); };
    /* Each area moves the block at most once, to where it is apart but for rounding. */
    for (std::size_t moves = 0; moves < taken.size(); moves++) {
        const auto other = std::find_if(taken.begin(), taken.end(), is_in_way);
        if (other == taken.end()) break;
        const double y = is_at_bottom(where.at) ? other->y0 - gap - height : other->y1 + gap;
        block = {block.x0, y, block.x1, y + height};
    }
    if (block.y0 < 0 || block.y1 > image.height) block = first;
    taken.push_back(block);
    return block;
}

void decorate(const insitu_image &image, std::vector<float> &rgba, std::string &warning)
{
    const insitu_decorations &what = *image.decorations;
    sheet s{image, what, rgba, nullptr, 0, 0, {}};
    s.size = std::max(1, static_cast<int>(std::lround(what.size * image.height)));
    s.margin = 0.7 * s.size;
    std::optional<typeface> font;
    if (has_words(what)) s.font = &font.emplace();
    if (font && !font->found())
        warning = "no font was found, so its words are left out; expected DejaVuSans in the system's fonts or in a "
                  "folder that OPENIMAGEIO_FONTS names";
    draw_strokes(s, true);
    put_background(s);
    draw_strokes(s, false);
    for (int i = 0; i < what.words_count; i++) draw_words(s, what.words[i]);
    for (int i = 0; i < what.bar_count; i++) draw_bar(s, what.bars[i]);
    draw_scale_bar(s);
    if (what.has_axes) draw_axes(s);
    for (int i = 0; i < what.label_count; i++) draw_label(s, what.labels[i]);
    if (font && font->found()) warning = font->missing();
}
