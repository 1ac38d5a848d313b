/* Draws random decorations over pictures whose sides have 1 to 2200 pixels. Colours must be finite. If a picture takes
 * more than ten seconds, SIGALRM ends the test. */
#include <cmath>
#include <csetjmp>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <string>
#include <unistd.h>
#include <vector>

#include "decorate.h"
#include "random_decorations.h"

extern "C" {
#include "test_effort.h"
#include <cmocka.h>
}

namespace
{

/* Draws the decorations. Prints the case first, so that the last line of output identifies a case that does not end. */
void draw_and_check(int width, int height, const insitu_decorations &what)
{
    std::vector<float> rgba(4 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    const insitu_image image{width, height, rgba.data(), nullptr, &what, 0, nullptr, nullptr};
    std::vector<float> out = rgba;
    alarm(10);
    decorate(image, out);
    alarm(0);
    for (const float value : out)
        if (!(value >= 0 && value <= 1.001F)) fail_msg("%d x %d: a colour of %g", width, height, (double)value);
}

void random_decorations_are_drawn_in_time(void **)
{
    random_decorations random(1);
    const int pictures = test_case_count(150, 10000), most = test_case_count(200, 2200);
    for (int i = 0; i < pictures; i++) {
        const int width = random.draw_integer(1, most), height = random.draw_integer(1, most);
        draw_and_check(width, height, random.make_decorations(width, height));
    }
}

/* Checks that a former error does not return: text and axes that touched, up to rounding, pushed each other away in an
 * endless loop, at one picture height in twenty. */
void text_over_axes_is_drawn_at_every_height(void **)
{
    const insitu_words words[] = {{"run 42", INSITU_BOTTOM_LEFT, 1}, {"t = 0.5", INSITU_BOTTOM_LEFT, 1}};
    insitu_decorations what{};
    what.size = 0.03;
    what.words_count = 2;
    what.words = words;
    what.has_axes = true;
    for (int a = 0; a < 3; a++) what.axes[a][a] = 1;
    for (int height = 1; height <= 2200; height += test_case_count(13, 1)) draw_and_check(200, height, what);
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {cmocka_unit_test(text_over_axes_is_drawn_at_every_height),
                                cmocka_unit_test(random_decorations_are_drawn_in_time)};
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}
