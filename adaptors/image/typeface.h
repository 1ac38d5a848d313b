/* Draws text with FreeType, glyph by glyph with the font's kerning. Text is UTF-8. A character that the font lacks
 * is drawn as the font's box for missing glyphs, and an invalid byte as U+FFFD. */
#ifndef ADAPTORS_TYPEFACE_H
#define ADAPTORS_TYPEFACE_H

#include <functional>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

struct FT_LibraryRec_;
struct FT_FaceRec_;

/* Callback for a pixel that a glyph covers by the fraction `covered`, 0 to 1. x points to the right from the beginning
 * of the line, y down from its baseline. */
using cover_pixel = std::function<void(int x, int y, double covered)>;

/* A font. Every member may throw std::bad_alloc. */
class typeface
{
  public:
    /* Opens the first of the known fonts found in the folders of OPENIMAGEIO_FONTS, or otherwise in the system's
     * folders. */
    typeface();
    ~typeface();
    typeface(const typeface &) = delete;
    typeface &operator=(const typeface &) = delete;

    /* Returns the length of the line in pixels for letters of this height; 0 if no font was found. */
    int width_of(const std::string &text, int size) const;
    /* Draws a line of text; halo > 0 widens the glyphs by this number of pixels on every side. */
    void draw(const std::string &text, int size, double halo, const cover_pixel &cover);
    /* Records the characters of the line that are drawn as boxes, for missing(). */
    void record_missing(const std::string &text);
    /* Returns a message about characters that are drawn as boxes, or an empty string. */
    std::string missing() const;
    /* Returns a message if no font was found, or none in the folders of OPENIMAGEIO_FONTS; otherwise an empty
     * string. */
    std::string font_fault() const;

  private:
    int compute_glyph_advance(unsigned glyph, int size) const;

    FT_LibraryRec_ *library_ = nullptr;
    FT_FaceRec_ *face_ = nullptr;
    /* name_: name of the font; file_: path of the font; unreadable_: path of the first file that could not be read as a
     * font */
    std::string name_, file_, unreadable_;
    bool is_from_system_ = false;
    mutable std::map<std::pair<int, unsigned>, int> advances_; /* cache of glyph advances, by size and glyph */
    std::set<char32_t> missing_;
    bool has_bad_bytes_ = false;
};

/* Decodes UTF-8. Each invalid byte, overlong form, surrogate, and number above U+10FFFF becomes U+FFFD and sets
 * is_bad. */
std::vector<char32_t> decode_utf8(const std::string &text, bool &is_bad);

#endif
