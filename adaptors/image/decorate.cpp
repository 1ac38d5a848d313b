/* Everything is drawn in linear light on premultiplied colours, so that the edges of lines and letters are smooth on
 * any background. From back to front, the layers are: the background, strokes with is_behind, the picture, and all
 * other decorations. Sizes are proportional to the picture's height, so that a picture of twice the size looks the same
 * at a higher resolution. Text has a halo in the background's colour, so that it is legible on any picture and hides
 * little of it. layout.cpp computes the positions. */
#include "decorate.h"
#include "layout.h"
#include "typeface.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

namespace
{

struct drawing {
    const insitu_image &image;
    const insitu_decorations &decorations;
    std::vector<float> &rgba;
    typeface *font; /* font of all text; NULL if there is no text to draw */
};

/* ---- pixels ----------------------------------------------------------------------------------------------------- */

float *get_pixel_address(drawing &s, int x, int y)
{
    return &s.rgba[4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(s.image.width) +
                        static_cast<std::size_t>(x))];
}

/* Blends a colour of the given opacity over the pixel, or behind the pixel. */
void blend(float *pixel, const float colour[3], double opacity, bool is_behind)
{
    const double seen = is_behind ? opacity * (1 - std::min(1.0, static_cast<double>(pixel[3]))) : opacity;
    const double kept = is_behind ? 1 : 1 - opacity;
    for (int c = 0; c < 4; c++)
        pixel[c] = static_cast<float>(pixel[c] * kept + (c < 3 ? static_cast<double>(colour[c]) : 1.0) * seen);
}

void blend_background(drawing &s)
{
    for (std::size_t i = 0; i < s.rgba.size(); i += 4) {
        const float left = 1 - std::min(1.0F, s.rgba[i + 3]);
        for (std::size_t c = 0; c < 4; c++) s.rgba[i + c] += left * s.decorations.background[c];
    }
}

/* Returns the fraction of the pixel [x, x + 1) that the interval from low to high covers. */
double pixel_coverage(double low, double high, int x)
{
    return std::clamp(std::min(high, x + 1.0) - std::max(low, static_cast<double>(x)), 0.0, 1.0);
}

void fill(drawing &s, const area &a, const float colour[3], double opacity)
{
    const int x1 = std::min(s.image.width, static_cast<int>(std::ceil(a.x1)));
    const int y1 = std::min(s.image.height, static_cast<int>(std::ceil(a.y1)));
    for (int y = std::max(0, static_cast<int>(a.y0)); y < y1; y++)
        for (int x = std::max(0, static_cast<int>(a.x0)); x < x1; x++)
            blend(get_pixel_address(s, x, y), colour,
                  opacity * pixel_coverage(a.x0, a.x1, x) * pixel_coverage(a.y0, a.y1, y), false);
}

double compute_distance_to_stroke(const insitu_stroke &line, double x, double y)
{
    const double dx = line.to[0] - line.from[0], dy = line.to[1] - line.from[1];
    const double square = dx * dx + dy * dy;
    const double along = square > 0 ? ((x - line.from[0]) * dx + (y - line.from[1]) * dy) / square : 0;
    const double at = std::clamp(along, 0.0, 1.0);
    return std::hypot(x - (line.from[0] + at * dx), y - (line.from[1] + at * dy));
}

/* Draws a line. In each row of pixels, visits only the columns that the line may cross, so that the cost is
 * proportional to the line's length and not to the area of its bounding box. */
void draw_stroke(drawing &s, const insitu_stroke &line, double width, const float colour[3], double opacity = 1)
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
            const double inside = 0.5 + 0.5 * width - compute_distance_to_stroke(line, x + 0.5, y + 0.5);
            if (inside > 0) blend(get_pixel_address(s, x, y), colour, opacity * std::min(inside, 1.0), line.is_behind);
        }
    }
}

double line_width(const drawing &s)
{
    return std::max(1.0, s.image.height / 540.0);
}

void draw_strokes(drawing &s, bool behind)
{
    for (int i = 0; i < s.decorations.stroke_count; i++)
        if (s.decorations.strokes[i].is_behind == behind)
            draw_stroke(s, s.decorations.strokes[i], line_width(s), s.decorations.colour);
}

/* ---- text ------------------------------------------------------------------------------------------------------- */

/* The opacity of the halo around text and its lines. The halo has the background's colour; there is none if the
 * background is transparent. */
const double halo_opacity = 0.75;

double halo_width(int size)
{
    return std::max(1.0, 0.1 * size);
}

bool find_halo_colour(const drawing &s, float colour[3])
{
    const float alpha = s.decorations.background[3];
    for (int c = 0; c < 3; c++) colour[c] = alpha > 0 ? s.decorations.background[c] / alpha : 0;
    return alpha > 0;
}

void draw_glyphs(drawing &s, const placed_line &line, int size, double halo, const float colour[3], double opacity)
{
    const int left = static_cast<int>(std::lround(line.x)), top = static_cast<int>(std::lround(line.baseline));
    s.font->draw(line.text, size, halo, [&](int column, int row, double pixel_coverage) {
        const int x = left + column, y = top + row;
        if (x >= 0 && y >= 0 && x < s.image.width && y < s.image.height)
            blend(get_pixel_address(s, x, y), colour, opacity * pixel_coverage, false);
    });
}

void draw_text_line(drawing &s, const placed_line &line, int size)
{
    float halo[3];
    if (!s.font || line.text.empty()) return;
    if (find_halo_colour(s, halo))
        draw_glyphs(s, line, size, halo_width(size), halo,
                    halo_opacity * static_cast<double>(s.decorations.background[3]));
    draw_glyphs(s, line, size, 0, s.decorations.colour, 1);
}

void draw_stroke_with_halo(drawing &s, const insitu_stroke &line, double width, int size, const float colour[3])
{
    float halo[3];
    if (find_halo_colour(s, halo))
        draw_stroke(s, line, width + 2 * halo_width(size), halo,
                    halo_opacity * static_cast<double>(s.decorations.background[3]));
    draw_stroke(s, line, width, colour);
}

/* ---- colour bars ------------------------------------------------------------------------------------------------ */

/* Computes the colour at `place`, from 0 at the bar's lower end to 1 at its upper end. Interpolates linearly between
 * the entries of the colour table, as the renderer does. In a banded bar each entry fills one band. */
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

void draw_gradient(drawing &s, const insitu_colour_bar &bar, const area &where)
{
    for (int y = static_cast<int>(where.y0); y < where.y1; y++) {
        float colour[3];
        colour_at(bar, (where.y1 - (y + 0.5)) / (where.y1 - where.y0), colour);
        fill(s, {where.x0, std::max(where.y0, static_cast<double>(y)), where.x1, std::min(where.y1, y + 1.0)}, colour,
             1);
    }
}

void draw_frame(drawing &s, const area &a)
{
    const double corners[4][2] = {{a.x0, a.y0}, {a.x1, a.y0}, {a.x1, a.y1}, {a.x0, a.y1}};
    for (int i = 0; i < 4; i++) {
        const double *from = corners[i], *to = corners[(i + 1) % 4];
        draw_stroke(s, {{from[0], from[1]}, {to[0], to[1]}, false}, line_width(s), s.decorations.colour);
    }
}

/* Draws small boxes beyond the ends of the bar, if values outside the range have colours of their own. */
void draw_out_of_range_boxes(drawing &s, const insitu_colour_bar &bar, const block &b)
{
    const double height = 0.45 * b.size;
    const area &g = b.gradient, below = {g.x0, g.y1, g.x1, g.y1 + height}, above = {g.x0, g.y0 - height, g.x1, g.y0};
    if (bar.below) fill(s, below, bar.below, 1), draw_frame(s, below);
    if (bar.above) fill(s, above, bar.above, 1), draw_frame(s, above);
}

/* Draws a colour bar with its ticks on the right. draw_block() draws the numbers and the label, as lines of the block's
 * text. */
void draw_bar(drawing &s, const block &b)
{
    const insitu_colour_bar &bar = s.decorations.bars[b.index];
    draw_gradient(s, bar, b.gradient);
    draw_frame(s, b.gradient);
    draw_out_of_range_boxes(s, bar, b);
    for (const int i : b.ticks) {
        const double y = compute_tick_y(bar.ticks[i], b.gradient);
        draw_stroke_with_halo(s, {{b.gradient.x1, y}, {b.gradient.x1 + 0.3 * b.size, y}, false}, line_width(s), b.size,
                              s.decorations.colour);
    }
}

/* ---- scale bar and axes ----------------------------------------------------------------------------------------- */

/* Draws the scale bar below its text. */
void draw_scale_bar(drawing &s, const block &b)
{
    const double middle = 0.5 * (b.bounds.x0 + b.bounds.x1), half = 0.5 * s.decorations.scale_bar.length;
    const double y = b.bounds.y1 - 0.45 * b.size, tick = 0.25 * b.size, width = 1.5 * line_width(s);
    const insitu_stroke strokes[] = {{{middle - half, y}, {middle + half, y}, false},
                                     {{middle - half, y - tick}, {middle - half, y + tick}, false},
                                     {{middle + half, y - tick}, {middle + half, y + tick}, false}};
    for (const insitu_stroke &stroke : strokes) draw_stroke_with_halo(s, stroke, width, b.size, s.decorations.colour);
    for (const insitu_stroke &stroke : strokes) draw_stroke(s, stroke, width, s.decorations.colour);
}

/* Draws the axes x, y and z in red, green and blue, beginning with the one farthest from the viewer. */
void draw_axes(drawing &s, const block &b)
{
    static const float colours[3][3] = {{0.8F, 0.05F, 0.05F}, {0.05F, 0.5F, 0.05F}, {0.08F, 0.2F, 0.9F}};
    const double arm = 2.2 * b.size, to_name = arm + 0.6 * b.size;
    const double middle[2] = {0.5 * (b.bounds.x0 + b.bounds.x1), 0.5 * (b.bounds.y0 + b.bounds.y1)};
    int order[3] = {0, 1, 2};
    std::sort(order, order + 3, [&](int a, int c) { return s.decorations.axes[a][2] < s.decorations.axes[c][2]; });
    for (const int axis : order) {
        const double *d = s.decorations.axes[axis];
        const double tip[2] = {middle[0] + arm * d[0], middle[1] - arm * d[1]};
        const std::string name(1, static_cast<char>('x' + axis));
        draw_stroke_with_halo(s, {{middle[0], middle[1]}, {tip[0], tip[1]}, false}, 1.5 * line_width(s), b.size,
                              colours[axis]);
        draw_text_line(s, {name, middle[0] + to_name * d[0] - 0.3 * b.size, middle[1] - to_name * d[1] + 0.3 * b.size},
                       b.size);
    }
}

/* ---- all decorations -------------------------------------------------------------------------------------------- */

void draw_block(drawing &s, const block &b)
{
    switch (b.kind) {
    case block_kind::bar: draw_bar(s, b); break;
    case block_kind::scale_bar: draw_scale_bar(s, b); break;
    case block_kind::axes: draw_axes(s, b); break;
    case block_kind::covered:
    case block_kind::words:
    case block_kind::label: break;
    }
    for (const placed_line &line : b.lines) draw_text_line(s, line, b.size);
}

bool has_text(const insitu_decorations &decorations)
{
    return decorations.words_count > 0 || decorations.bar_count > 0 || decorations.has_axes ||
           decorations.label_count > 0 || decorations.scale_bar.length > 0;
}

layout place_blocks(const insitu_image &image, const typeface *font)
{
    return make_layout(image, [&](const std::string &text, int size) { return font ? font->width_of(text, size) : 0; });
}

std::string describe_left_out(const insitu_image &image, const std::vector<std::string> &left_out)
{
    std::string names;
    if (left_out.empty()) return names;
    for (const std::string &name : left_out)
        names += (names.empty() ? "" : &name == &left_out.back() ? " and " : ", ") + name;
    return "no room in " + std::to_string(image.width) + " x " + std::to_string(image.height) + " pixels for " + names +
           ", which " + (left_out.size() == 1 ? "is" : "are") +
           " left out; a smaller \"size\" of decorations or a larger picture has more";
}

} // namespace

void decorate(const insitu_image &image, std::vector<float> &rgba)
{
    const insitu_decorations &decorations = *image.decorations;
    drawing s{image, decorations, rgba, nullptr};
    std::optional<typeface> font;
    if (has_text(decorations)) s.font = &font.emplace();
    draw_strokes(s, true);
    blend_background(s);
    draw_strokes(s, false);
    for (const block &b : place_blocks(image, s.font).blocks) draw_block(s, b);
}

void find_text_faults(const insitu_image &image, insitu_word_faults &out)
{
    const auto store_message = [](char(&text)[1024], const std::string &words) {
        std::snprintf(text, sizeof text, "%s", words.c_str());
    };
    out = {};
    if (!has_text(*image.decorations)) return;
    typeface font;
    const layout places = place_blocks(image, &font);
    for (const block &b : places.blocks)
        for (const placed_line &line : b.lines) font.record_missing(line.text);
    store_message(out.font, font.font_fault());
    store_message(out.letters, font.missing());
    store_message(out.room, describe_left_out(image, places.left_out));
}
