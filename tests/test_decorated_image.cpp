/* Checks decorations drawn over a picture: their positions, what they hide, and the colours of colour bars. */
#include <cmath>
#include <csetjmp>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "decorate.h"

extern "C" {
#include <cmocka.h>
}

namespace
{

const int width = 320, height = 240;

/* Returns a picture in which all pixels have the same premultiplied grey and the same opacity. */
std::vector<float> make_grey_picture(float grey, float alpha)
{
    std::vector<float> rgba(static_cast<std::size_t>(4 * width * height));
    for (std::size_t i = 0; i < rgba.size(); i++) rgba[i] = i % 4 == 3 ? alpha : grey * alpha;
    return rgba;
}

insitu_decorations make_plain_decorations()
{
    insitu_decorations d{};
    d.background[0] = d.background[1] = d.background[2] = 0.25F;
    d.background[3] = 1;
    d.colour[0] = d.colour[1] = d.colour[2] = 1;
    d.size = 0.05;
    return d;
}

std::vector<float> draw_decorated(const std::vector<float> &rgba, const insitu_decorations &d)
{
    const insitu_image image{width, height, rgba.data(), nullptr, &d, 0, nullptr, nullptr};
    std::vector<float> out = rgba;
    decorate(image, out);
    insitu_word_faults faults;
    find_text_faults(image, faults);
    for (const char *fault : {faults.font, faults.letters, faults.room}) assert_string_equal(fault, "");
    return out;
}

float get_pixel_channel(const std::vector<float> &rgba, int x, int y, int channel = 0)
{
    return rgba[static_cast<std::size_t>(4 * (y * width + x) + channel)];
}

void picture_is_blended_over_its_background(void **)
{
    const std::vector<float> out = draw_decorated(make_grey_picture(0.5F, 0.25F), make_plain_decorations());
    for (std::size_t i = 0; i < out.size(); i++)
        assert_true(std::fabs(out[i] - (i % 4 == 3 ? 1 : 0.125F + 0.75F * 0.25F)) < 1e-6F);
}

/* Checks that a line in front of the picture has its own colour. A line behind the picture is drawn over the background
 * and is visible as far as the picture transmits light. Pixels beside the lines must not change. */
void strokes_are_before_or_behind_the_picture(void **)
{
    const insitu_stroke strokes[] = {{{0, 50.5}, {width, 50.5}, false}, {{0, 100.5}, {width, 100.5}, true}};
    insitu_decorations d = make_plain_decorations();
    d.stroke_count = 2;
    d.strokes = strokes;
    const std::vector<float> out = draw_decorated(make_grey_picture(0.5F, 0.75F), d),
                             without = draw_decorated(make_grey_picture(0.5F, 0.75F), make_plain_decorations());
    assert_true(std::fabs(get_pixel_channel(out, 160, 50) - 1) < 1e-6F);
    assert_true(std::fabs(get_pixel_channel(out, 160, 100) - (0.375F + 0.25F)) < 1e-6F);
    for (int y : {48, 52, 98, 102}) assert_true(get_pixel_channel(out, 160, y) == get_pixel_channel(without, 160, y));
    const std::vector<float> hidden = draw_decorated(make_grey_picture(0.5F, 1), d);
    assert_true(get_pixel_channel(hidden, 160, 100) == 0.5F);
}

/* Checks that the total light of a line is its length times its width in any direction, because its edges are
 * antialiased. */
void slanted_strokes_are_as_bright_as_straight_ones(void **)
{
    for (int degrees = 0; degrees < 180; degrees += 7) {
        const double angle = degrees * 3.14159265358979 / 180, dx = 90 * std::cos(angle), dy = 90 * std::sin(angle);
        const insitu_stroke stroke = {{160.3 - dx, 120.2 - dy}, {160.3 + dx, 120.2 + dy}, false};
        insitu_decorations d = make_plain_decorations();
        d.background[0] = d.background[1] = d.background[2] = 0;
        d.stroke_count = 1;
        d.strokes = &stroke;
        double sum = 0;
        const std::vector<float> out = draw_decorated(make_grey_picture(0, 0), d);
        for (std::size_t i = 0; i < out.size(); i += 4) sum += out[i];
        /* The line is 180 long. Its profile across is a tent that is one pixel wide on either side, so the sum is 180;
         * each round end adds at most one. */
        assert_true(sum > 178 && sum < 183);
    }
}

/* Checks that a column of pixels in the bar shows the bar's colours, over more than a third of the picture's height. */
void a_bar_has_the_colours_of_its_map(void **)
{
    const float colours[] = {0.1F, 0.2F, 0.9F, 0.3F, 0.8F, 0.1F, 0.9F, 0.1F, 0.2F};
    insitu_colour_bar bar{};
    bar.label = "speed";
    bar.colours = colours;
    bar.colour_count = 3;
    for (const insitu_anchor side : {INSITU_LEFT, INSITU_RIGHT}) {
        bar.at = side;
        insitu_decorations d = make_plain_decorations();
        d.bar_count = 1;
        d.bars = &bar;
        const std::vector<float> out = draw_decorated(make_grey_picture(0, 0), d);
        int matched = 0;
        for (int x = 0; x < width; x++) {
            int run = 0;
            float before = -1;
            for (int y = 0; y < height; y++) {
                /* In the table's lower half green rises from 0.2 to 0.8 while blue falls from 0.9 to 0.1. */
                const float r = get_pixel_channel(out, x, y, 0), g = get_pixel_channel(out, x, y, 1),
                            b = get_pixel_channel(out, x, y, 2);
                const bool is_low = std::fabs((g - 0.2F) / 0.6F - (0.9F - b) / 0.8F) < 1e-4F && r < 0.31F;
                const bool is_high = std::fabs((r - 0.3F) / 0.6F - (0.8F - g) / 0.7F) < 1e-4F && b < 0.21F && r > 0.29F;
                if (!is_low && !is_high) continue;
                /* the high end of the bar is at the top */
                if (before >= 0 && is_high) assert_true(r <= before + 1e-6F);
                before = is_high ? r : before;
                run++;
            }
            matched = run > matched ? run : matched;
        }
        assert_true(matched > height / 3);
    }
}

void bands_are_of_equal_height(void **)
{
    const float colours[] = {0.9F, 0, 0, 0, 0.9F, 0, 0, 0, 0.9F};
    insitu_colour_bar bar{};
    bar.label = "";
    bar.colours = colours;
    bar.colour_count = 3;
    bar.is_banded = true;
    bar.at = INSITU_RIGHT;
    insitu_decorations d = make_plain_decorations();
    d.bar_count = 1;
    d.bars = &bar;
    const std::vector<float> out = draw_decorated(make_grey_picture(0, 0), d);
    int rows[3] = {0, 0, 0};
    for (int band = 0; band < 3; band++)
        for (int x = 0; x < width; x++) {
            int count = 0;
            for (int y = 0; y < height; y++)
                count +=
                    get_pixel_channel(out, x, y, band) == 0.9F && get_pixel_channel(out, x, y, (band + 1) % 3) == 0;
            rows[band] = count > rows[band] ? count : rows[band];
        }
    /* The frame covers a row of the outer bands, and the border between two bands may lie inside a row. */
    assert_true(rows[1] > 30 && std::abs(rows[0] - rows[1]) <= 2 && std::abs(rows[2] - rows[1]) <= 2);
}

void words_are_written_at_their_anchor(void **)
{
    for (int anchor = INSITU_TOP_LEFT; anchor <= INSITU_BOTTOM_RIGHT; anchor++) {
        const insitu_words words{"Hill", static_cast<insitu_anchor>(anchor), 1};
        insitu_decorations d = make_plain_decorations();
        d.words_count = 1;
        d.words = &words;
        const std::vector<float> out = draw_decorated(make_grey_picture(0, 0), d);
        double sum = 0, x_sum = 0, y_sum = 0;
        for (int y = 0; y < height; y++)
            for (int x = 0; x < width; x++) {
                const double light = static_cast<double>(get_pixel_channel(out, x, y)) - 0.25;
                sum += light, x_sum += light * x, y_sum += light * y;
            }
        assert_true(sum > 10);
        const double x = x_sum / sum / width, y = y_sum / sum / height;
        const bool left = anchor == INSITU_TOP_LEFT || anchor == INSITU_LEFT || anchor == INSITU_BOTTOM_LEFT;
        const bool right = anchor == INSITU_TOP_RIGHT || anchor == INSITU_RIGHT || anchor == INSITU_BOTTOM_RIGHT;
        assert_true(left ? x < 0.2 : right ? x > 0.8 : x > 0.4 && x < 0.6);
        const bool top = anchor <= INSITU_TOP_RIGHT, bottom = anchor >= INSITU_BOTTOM_LEFT;
        assert_true(top ? y < 0.15 : bottom ? y > 0.85 : y > 0.4 && y < 0.6);
    }
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {cmocka_unit_test(picture_is_blended_over_its_background),
                                cmocka_unit_test(strokes_are_before_or_behind_the_picture),
                                cmocka_unit_test(slanted_strokes_are_as_bright_as_straight_ones),
                                cmocka_unit_test(a_bar_has_the_colours_of_its_map),
                                cmocka_unit_test(bands_are_of_equal_height),
                                cmocka_unit_test(words_are_written_at_their_anchor)};
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}
