/* Words as FreeType draws them: each glyph's own pixels, side by side with the font's kerning. Text is UTF-8; a
 * character that the font lacks is its box for missing glyphs, and a byte that is not UTF-8 is U+FFFD. */
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

/* How much of one pixel a glyph covers, 0 to 1; x to the right of the line's begin, y down from its baseline. */
using cover_pixel = std::function<void(int x, int y, double covered)>;

/* Every call may throw std::bad_alloc. */
class typeface
{
  public:
    /* Opens the first of the usual fonts that is in a folder that OPENIMAGEIO_FONTS names, else in the system's. */
    typeface();
    ~typeface();
    typeface(const typeface &) = delete;
    typeface &operator=(const typeface &) = delete;

    /* Pixels from the line's begin to its end, for letters of this height. 0 where no font was found. */
    int width_of(const std::string &text, int size) const;
    /* Covers the pixels of glyphs; where halo > 0, those of glyphs that are wider by so many pixels on every side. */
    void draw(const std::string &text, int size, double halo, const cover_pixel &cover);
    /* Keeps the characters of the line that are drawn as boxes, for missing(). */
    void look_up(const std::string &text);
    /* Empty, or a message about characters that are drawn as boxes. */
    std::string missing() const;
    /* Empty, or a message: no font was found, or none where OPENIMAGEIO_FONTS names folders. */
    std::string fault() const;

  private:
    int advance_of(unsigned glyph, int size) const;

    FT_LibraryRec_ *library_ = nullptr;
    FT_FaceRec_ *face_ = nullptr;
    std::string name_, file_, unreadable_; /* the font's; a file that is no font or cannot be read */
    bool is_from_system_ = false;
    mutable std::map<std::pair<int, unsigned>, int> advances_; /* by size and glyph */
    std::set<char32_t> missing_;
    bool has_bad_bytes_ = false;
};

/* Decodes UTF-8. A byte that belongs to no character, an overlong form, a surrogate and a number above U+10FFFF are
 * U+FFFD each, and set is_bad. */
std::vector<char32_t> decode_utf8(const std::string &text, bool &is_bad);

#endif
