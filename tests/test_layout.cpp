/* Checks the positions of decorations: random decorations in pictures of 200 x 200 to 8192 x 4320 pixels, and typical
 * decorations of users. The test compares rectangles, not pixels. */
#include <algorithm>
#include <cmath>
#include <csetjmp>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "layout.h"
#include "random_decorations.h"
#include "typeface.h"

extern "C" {
#include "test_effort.h"
#include <cmocka.h>
}

namespace
{

int measure_text_width(const std::string &text, int size)
{
    static const typeface font;
    return font.width_of(text, size);
}

insitu_image make_image(int width, int height, const insitu_decorations &what)
{
    return {width, height, nullptr, nullptr, &what, 0, nullptr, nullptr};
}

bool are_disjoint(const area &a, const area &b)
{
    return a.x1 <= b.x0 || b.x1 <= a.x0 || a.y1 <= b.y0 || b.y1 <= a.y0;
}

/* Returns the bounding box of a line of text. In DejaVuSans, capitals and digits are 0.73 of the font size high above
 * the baseline. */
area compute_line_box(const placed_line &line, int size)
{
    return {line.x, line.baseline - 0.73 * size, line.x + measure_text_width(line.text, size), line.baseline};
}

void check_lines(const block &b)
{
    for (std::size_t i = 0; i < b.lines.size(); i++) {
        const area box = compute_line_box(b.lines[i], b.size);
        assert_true(box.x0 >= b.bounds.x0 && box.y0 >= b.bounds.y0 && box.x1 <= b.bounds.x1 && box.y1 <= b.bounds.y1);
        for (std::size_t k = 0; k < i; k++) assert_true(are_disjoint(box, compute_line_box(b.lines[k], b.size)));
        if (b.kind == block_kind::bar) assert_true(are_disjoint(box, b.gradient));
    }
}

void check_bar(const block &b)
{
    const area &g = b.gradient;
    assert_true(g.x0 >= b.bounds.x0 && g.x1 <= b.bounds.x1 && g.y0 >= b.bounds.y0 && g.y1 <= b.bounds.y1);
    assert_true(g.y1 - g.y0 >= 3.9 * b.size);
}

bool is_decoration(const block &b)
{
    return b.kind != block_kind::covered;
}

/* Checks that each decoration is either placed one time or reported as left out. Labels are not counted, because they
 * may be missing. */
void check_all_are_reported(const layout &places, const insitu_decorations &what)
{
    int wanted = what.bar_count + (what.scale_bar.length > 0) + what.has_axes;
    for (int i = 0; i < what.words_count; i++) wanted += *what.words[i].text != 0;
    const auto is_counted = [](const block &b) { return is_decoration(b) && b.kind != block_kind::label; };
    assert_int_equal(std::count_if(places.blocks.begin(), places.blocks.end(), is_counted) +
                         static_cast<std::ptrdiff_t>(places.left_out.size()),
                     wanted);
}

/* Checks that the block does not overlap the areas of this picture that other pictures cover. */
void check_covered(const block &b, const insitu_decorations &what)
{
    for (int i = 0; i < what.covered_count; i++) {
        const insitu_rectangle &r = what.covered[i];
        const area covered = {static_cast<double>(r.x), static_cast<double>(r.y), static_cast<double>(r.x + r.width),
                              static_cast<double>(r.y + r.height)};
        assert_true(are_disjoint(b.bounds, covered));
    }
}

void check_layout(const layout &places, const insitu_image &image)
{
    for (std::size_t i = 0; i < places.blocks.size(); i++) {
        const block &b = places.blocks[i];
        assert_true(b.bounds.x0 >= 0 && b.bounds.y0 >= 0 && b.bounds.x1 <= image.width && b.bounds.y1 <= image.height);
        for (std::size_t k = 0; k < i; k++) assert_true(are_disjoint(b.bounds, places.blocks[k].bounds));
        check_lines(b);
        if (is_decoration(b)) check_covered(b, *image.decorations);
        if (b.kind == block_kind::bar) check_bar(b);
    }
    check_all_are_reported(places, *image.decorations);
}

void random_blocks_neither_overlap_nor_leave_the_picture(void **)
{
    random_decorations random(2);
    const int most[2] = {test_case_count(1000, 8192), test_case_count(1000, 4320)};
    for (int i = 0; i < test_case_count(150, 500); i++) {
        const int width = static_cast<int>(std::exp(random.draw_real(std::log(200), std::log(most[0] + 0.5))));
        const int height = static_cast<int>(std::exp(random.draw_real(std::log(200), std::log(most[1] + 0.5))));
        const insitu_image image = make_image(width, height, random.make_decorations(width, height));
        check_layout(make_layout(image, measure_text_width), image);
    }
}

/* ---- typical cases of users ------------------------------------------------------------------------------------- */

const float colours[] = {0, 0, 0, 1, 1, 1};
const insitu_tick ticks[] = {{0, "0"}, {0.2, "0.2"}, {0.4, "0.4"}, {0.6, "0.6"}, {0.8, "0.8"}, {1, "1"}};

insitu_colour_bar make_bar(const char *label)
{
    return {label, colours, 2, false, nullptr, nullptr, INSITU_RIGHT, 6, ticks};
}

insitu_decorations make_decorations_with_bars(const std::vector<insitu_colour_bar> &bars)
{
    insitu_decorations what{};
    what.size = 0.03;
    what.bars = bars.data();
    what.bar_count = static_cast<int>(bars.size());
    return what;
}

void four_colour_bars_fit_with_their_numbers(void **)
{
    const std::vector<insitu_colour_bar> bars = {make_bar("Equivalent (von-Mises) stress / MPa"), make_bar("b"),
                                                 make_bar("c"), make_bar("d")};
    const insitu_decorations what = make_decorations_with_bars(bars);
    for (const int height : {200, 480, 720, 4320}) {
        const insitu_image image = make_image(height * 16 / 9, height, what);
        const layout places = make_layout(image, measure_text_width);
        check_layout(places, image);
        assert_int_equal(places.blocks.size(), 4);
        for (const block &b : places.blocks) assert_true(b.ticks.size() >= 2);
    }
}

/* Checks that a long label is wrapped and that the bar stays in the right third of the picture. */
void a_label_of_many_letters_is_wrapped(void **)
{
    const std::string word(60, 'w');
    for (const std::string &label : {std::string("A label of fifty letters and more, with blanks in it"), word}) {
        const std::vector<insitu_colour_bar> bars = {make_bar(label.c_str())};
        const insitu_decorations what = make_decorations_with_bars(bars);
        const insitu_image image = make_image(640, 480, what);
        const layout places = make_layout(image, measure_text_width);
        check_layout(places, image);
        assert_int_equal(places.blocks.size(), 1);
        assert_true(places.blocks[0].bounds.x0 > 640 * 2 / 3);
    }
}

void text_at_right_is_beside_the_colour_bar(void **)
{
    const std::vector<insitu_colour_bar> bars = {make_bar("f")};
    const insitu_words words[] = {{"a text at right", INSITU_RIGHT, 1}};
    insitu_decorations what = make_decorations_with_bars(bars);
    what.words = words;
    what.words_count = 1;
    const insitu_image image = make_image(640, 480, what);
    const layout places = make_layout(image, measure_text_width);
    check_layout(places, image);
    assert_int_equal(places.blocks.size(), 2);
}

/* Checks a picture one of whose corners is covered by another picture. The height of the covering picture is a third,
 * four fifths or all of the picture's height. The colour bar must be at least 0.4 of the picture's height long. It must
 * be below or above the covering picture if there is enough space, and next to it otherwise. */
void colour_bars_avoid_covered_corners(void **)
{
    const std::vector<insitu_colour_bar> bars = {make_bar("Temperature [K]")};
    const insitu_words words[] = {{"A title at the top, as wide as half of the picture", INSITU_TOP, 1.4F},
                                  {"t = 0.5", INSITU_BOTTOM_RIGHT, 1}};
    for (const int corner : {0, 1, 2, 3})
        for (const int height : {160, 384, 480}) {
            insitu_decorations what = make_decorations_with_bars(bars);
            const insitu_rectangle covered = {corner & 1 ? 408 : 12,
                                              height == 480 ? 0
                                              : corner & 2  ? 468 - height
                                                            : 12,
                                              220, height};
            what.words = words;
            what.words_count = 2;
            what.has_axes = true;
            what.covered = &covered;
            what.covered_count = 1;
            const insitu_image image = make_image(640, 480, what);
            const layout places = make_layout(image, measure_text_width);
            check_layout(places, image);
            assert_true(places.left_out.empty());
            const auto bar = std::find_if(places.blocks.begin(), places.blocks.end(),
                                          [](const block &b) { return b.kind == block_kind::bar; });
            assert_true(bar != places.blocks.end());
            assert_int_equal(bar->size, compute_text_height(image));
            const bool is_beside = height > 160 && (corner & 1);
            assert_true(bar->bounds.y1 - bar->bounds.y0 >= 0.4 * 480);
            assert_true(is_beside ? bar->bounds.x1 < 408 : bar->bounds.x1 > 620);
        }
}

/* Checks that decorations which do not fit are reported: 20 bars whose letters have a fifth of the picture's height. */
void decorations_that_do_not_fit_are_reported(void **)
{
    const std::vector<insitu_colour_bar> bars(20, make_bar("pressure"));
    insitu_decorations what = make_decorations_with_bars(bars);
    what.size = 0.2;
    const insitu_image image = make_image(200, 200, what);
    const layout places = make_layout(image, measure_text_width);
    check_layout(places, image);
    assert_false(places.left_out.empty());
    assert_string_equal(places.left_out[0].c_str(), "the colour bar \"pressure\"");
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {cmocka_unit_test(random_blocks_neither_overlap_nor_leave_the_picture),
                                cmocka_unit_test(four_colour_bars_fit_with_their_numbers),
                                cmocka_unit_test(a_label_of_many_letters_is_wrapped),
                                cmocka_unit_test(text_at_right_is_beside_the_colour_bar),
                                cmocka_unit_test(colour_bars_avoid_covered_corners),
                                cmocka_unit_test(decorations_that_do_not_fit_are_reported)};
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}
