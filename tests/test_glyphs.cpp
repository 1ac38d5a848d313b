/* Checks text beyond ASCII: compares the text in a picture with the glyphs that FreeType renders for each code point.
 * The reference sets the glyphs next to each other with the font's kerning. */
#include <ft2build.h>
#include FT_FREETYPE_H

#include <cmath>
#include <csetjmp>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <unistd.h>
#include <vector>

#include "decorate.h"
#include "typeface.h"

extern "C" {
#include <cmocka.h>
}

namespace
{

const int width = 400, height = 100, size = 20;

struct phrase {
    const char *text;
    std::vector<char32_t> characters;
};

/* Texts and their code points. Code points are written by hand, so that the test needs no UTF-8 decoder. */
const phrase phrases[] = {
    {"T [\u00b0C]", {'T', ' ', '[', 0xB0, 'C', ']'}},
    {"0.5 \u00b5m", {'0', '.', '5', ' ', 0xB5, 'm'}},
    {"3 \u00b1 1", {'3', ' ', 0xB1, ' ', '1'}},
    {"m\u00b2/s\u00b3", {'m', 0xB2, '/', 's', 0xB3}},
    {"\u03b1 = 2", {0x3B1, ' ', '=', ' ', '2'}},
    {"\u00d8 5", {0xD8, ' ', '5'}},
    {"Str\u00f6mung", {'S', 't', 'r', 0xF6, 'm', 'u', 'n', 'g'}},
    {"\u22121.5", {0x2212, '1', '.', '5'}},
    {"\u2202u/\u2202t", {0x2202, 'u', '/', 0x2202, 't'}},
    {"\u2207p", {0x2207, 'p'}},
    {"10\u207b\u2076", {'1', '0', 0x207B, 0x2076}},
    {"Gr\u00f6\u00dfe AV", {'G', 'r', 0xF6, 0xDF, 'e', ' ', 'A', 'V'}},
};

/* Draws the text by the library, in white letters on opaque black. */
std::vector<float> draw_text(const char *text, std::string &warning)
{
    const insitu_words words{text, INSITU_TOP_LEFT, 1};
    insitu_decorations what{};
    what.background[3] = 1;
    what.colour[0] = what.colour[1] = what.colour[2] = 1;
    what.size = static_cast<double>(size) / height;
    what.words_count = 1;
    what.words = &words;
    std::vector<float> rgba(static_cast<std::size_t>(4 * width * height));
    const insitu_image image{width, height, rgba.data(), nullptr, &what, 0, nullptr, nullptr};
    std::vector<float> out = rgba;
    insitu_word_faults faults;
    decorate(image, out);
    find_text_faults(image, faults);
    warning = faults.letters;
    std::vector<float> red;
    for (std::size_t i = 0; i < out.size(); i += 4) red.push_back(out[i]);
    return red;
}

/* Renders the text by FreeType. The text begins at x = left on the given baseline. */
class freetype_reference
{
  public:
    freetype_reference()
    {
        assert_int_equal(FT_Init_FreeType(&library_), 0);
        assert_int_equal(FT_New_Face(library_, "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf", 0, &face_), 0);
        assert_int_equal(FT_Set_Pixel_Sizes(face_, 0, size), 0);
    }
    ~freetype_reference() { FT_Done_FreeType(library_); }
    freetype_reference(const freetype_reference &) = delete;
    freetype_reference &operator=(const freetype_reference &) = delete;

    std::vector<float> draw_text(const std::vector<char32_t> &characters, int left, int baseline)
    {
        std::vector<float> out(static_cast<std::size_t>(width * height));
        FT_UInt before = 0;
        for (const char32_t character : characters) {
            const FT_UInt glyph = FT_Get_Char_Index(face_, character);
            FT_Vector kern{0, 0};
            if (before) FT_Get_Kerning(face_, before, glyph, FT_KERNING_DEFAULT, &kern);
            left += static_cast<int>(kern.x >> 6);
            assert_int_equal(FT_Load_Glyph(face_, glyph, FT_LOAD_TARGET_LIGHT | FT_LOAD_RENDER), 0);
            draw_glyph(out, left, baseline);
            left += static_cast<int>(face_->glyph->advance.x >> 6);
            before = glyph;
        }
        return out;
    }

  private:
    void draw_glyph(std::vector<float> &out, int left, int baseline)
    {
        const FT_GlyphSlot g = face_->glyph;
        for (unsigned row = 0; row < g->bitmap.rows; row++)
            for (unsigned column = 0; column < g->bitmap.width; column++) {
                const int x = left + g->bitmap_left + static_cast<int>(column);
                const int y = baseline - g->bitmap_top + static_cast<int>(row);
                const float covered = static_cast<float>(g->bitmap.buffer[row * g->bitmap.width + column]) / 255;
                float &pixel = out[static_cast<std::size_t>(y * width + x)];
                pixel += (1 - pixel) * covered;
            }
    }

    FT_Library library_ = nullptr;
    FT_Face face_ = nullptr;
};

double largest_difference(const std::vector<float> &a, const std::vector<float> &b)
{
    double worst = 0;
    for (std::size_t i = 0; i < a.size(); i++) worst = std::fmax(worst, std::fabs(static_cast<double>(a[i] - b[i])));
    return worst;
}

/* Searches for the position of the text near the corner at which all pixels equal FreeType's rendering, up to roundings
 * of a few 2^-24. */
void expect_glyphs(const char *text, const std::vector<char32_t> &characters, std::string &warning)
{
    freetype_reference reference;
    const std::vector<float> found = draw_text(text, warning);
    double least = 2;
    for (int left = 0; left < 30 && least > 1e-5; left++)
        for (int baseline = size; baseline < 2 * size + 10 && least > 1e-5; baseline++)
            least = std::fmin(least, largest_difference(found, reference.draw_text(characters, left, baseline)));
    if (!(least < 1e-5)) fail_msg("\"%s\": pixels differ by %g", text, least);
}

void text_beyond_ascii_matches_freetype_glyphs(void **)
{
    for (const phrase &p : phrases) {
        std::string warning;
        expect_glyphs(p.text, p.characters, warning);
        assert_string_equal(warning.c_str(), "");
    }
}

/* Checks a character for which DejaVuSans has no glyph: a Chinese one. Glyph 0, a box, must be drawn. */
void missing_glyph_gives_a_box_and_a_warning(void **)
{
    std::string warning;
    expect_glyphs("\u6e29 a", {0x6E29, ' ', 'a'}, warning);
    assert_non_null(std::strstr(warning.c_str(), "U+6E29"));
}

void bytes_that_are_not_utf8_are_replaced(void **)
{
    static const struct {
        const char *text;
        std::size_t characters;
    } cases[] = {{"\xff", 1},     {"a\xc3", 2}, {"\xc0\x80", 2},     {"\xed\xa0\x80", 3}, {"\xf4\x90\x80\x80", 4},
                 {"\xe2\x88", 2}, {"\x80z", 2}, {"\xf0\x9f\x98", 3}, {"\xc3(", 2}};
    for (const auto &c : cases) {
        bool is_bad = false;
        std::string warning;
        assert_int_equal(decode_utf8(c.text, is_bad).size(), c.characters);
        assert_true(is_bad);
        draw_text(c.text, warning);
        assert_non_null(std::strstr(warning.c_str(), "not UTF-8"));
    }
}

std::string find_font_error(const std::string &folders)
{
    const insitu_words words{"a", INSITU_TOP_LEFT, 1};
    insitu_decorations what{};
    what.size = 0.2;
    what.words_count = 1;
    what.words = &words;
    insitu_word_faults faults;
    setenv("OPENIMAGEIO_FONTS", folders.c_str(), 1);
    find_text_faults({width, height, nullptr, nullptr, &what, 0, nullptr, nullptr}, faults);
    unsetenv("OPENIMAGEIO_FONTS");
    return faults.font;
}

void unreadable_user_font_gives_a_warning(void **)
{
    const std::filesystem::path folder = std::filesystem::temp_directory_path() / ("glyphs" + std::to_string(getpid()));
    const std::string file = folder / "DejaVuSans.ttf", system = "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf";
    std::filesystem::create_directory(folder);
    const std::string absent = find_font_error(folder);
    std::ofstream(file) << "no font";
    const std::string unreadable = find_font_error("/nowhere:" + folder.string());
    std::filesystem::copy_file(system, file, std::filesystem::copy_options::overwrite_existing);
    const std::string good = find_font_error(folder);
    std::filesystem::remove_all(folder);
    assert_non_null(std::strstr(absent.c_str(), ("OPENIMAGEIO_FONTS, which is " + folder.string()).c_str()));
    assert_non_null(std::strstr(absent.c_str(), ("words are drawn by " + system).c_str()));
    assert_non_null(std::strstr(unreadable.c_str(), (file + " cannot be read as a font").c_str()));
    assert_string_equal(good.c_str(), "");
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {cmocka_unit_test(text_beyond_ascii_matches_freetype_glyphs),
                                cmocka_unit_test(missing_glyph_gives_a_box_and_a_warning),
                                cmocka_unit_test(bytes_that_are_not_utf8_are_replaced),
                                cmocka_unit_test(unreadable_user_font_gives_a_warning)};
    return cmocka_run_group_tests(tests, nullptr, nullptr);
}
