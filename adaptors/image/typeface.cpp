/* FreeType reports a lack of memory by error codes; they are converted to std::bad_alloc. Glyphs are hinted, so that
 * their horizontal edges align with pixels and are sharp in small sizes. FreeType's own hinter is used, because
 * FreeType 2.12 crashes if memory runs out while it starts its interpreter of the hints that TrueType fonts contain. */
#include "typeface.h"

#include <ft2build.h>
#include FT_FREETYPE_H
#include FT_GLYPH_H
#include FT_MODULE_H
#include FT_STROKER_H

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <dirent.h>
#include <memory>
#include <new>
#include <sys/stat.h>
#include <unistd.h>

namespace
{

const char *const fonts[] = {"DejaVuSans", "LiberationSans-Regular", "NotoSans-Regular", "FreeSans", "DroidSans"};
const char32_t replacement = 0xFFFD;
const FT_Int32 load_flags = FT_LOAD_TARGET_LIGHT;

/* Returns whether the call succeeded; throws std::bad_alloc if memory ran out. */
bool succeeded(FT_Error code)
{
    if (code == FT_Err_Out_Of_Memory) throw std::bad_alloc();
    return code == FT_Err_Ok;
}

/* ---- finding a font --------------------------------------------------------------------------------------------- */

/* Returns the subfolders of the folder, sorted by name, without hidden ones. The function calls opendir(), because the
 * directory iterators of the C++ library terminate the process if memory runs out, and so does glob() of glibc 2.36. */
std::vector<std::string> find_folders(const std::string &folder)
{
    std::vector<std::string> out;
    errno = 0;
    const std::unique_ptr<DIR, int (*)(DIR *)> entries(opendir(folder.c_str()), closedir);
    if (!entries && errno == ENOMEM) throw std::bad_alloc();
    for (const dirent *entry; entries && (entry = readdir(entries.get()));) {
        const std::string path = folder + "/" + entry->d_name;
        struct stat about;
        if (entry->d_name[0] != '.' && stat(path.c_str(), &about) == 0 && S_ISDIR(about.st_mode)) out.push_back(path);
    }
    std::sort(out.begin(), out.end());
    return out;
}

/* Returns the files of this font in the folder and up to three levels below, those in higher folders first. */
std::vector<std::string> find_files(const std::string &folder, const std::string &font)
{
    std::vector<std::string> out, folders = {folder};
    for (int level = 0; level <= 3; level++) {
        std::vector<std::string> next;
        for (const char *ending : {".ttf", ".otf", ".ttc", ".pfb"}) {
            const std::string file = "/" + font + ending;
            for (const std::string &own : folders)
                if (access((own + file).c_str(), F_OK) == 0) out.push_back(own + file);
        }
        for (std::size_t i = 0; level < 3 && i < folders.size(); i++)
            for (const std::string &below : find_folders(folders[i])) next.push_back(below);
        folders.swap(next);
    }
    return out;
}

std::string configured_folders()
{
    const char *own = std::getenv("OPENIMAGEIO_FONTS");
    return own ? own : "";
}

/* Splits a list of folders at colons and semicolons. */
std::vector<std::string> split_folders(const std::string &list)
{
    std::vector<std::string> out;
    for (std::size_t at = 0; at < list.size();) {
        const std::size_t end = std::min(list.find_first_of(":;", at), list.size());
        if (end > at) out.push_back(list.substr(at, end - at));
        at = end + 1;
    }
    return out;
}

struct opened_font {
    FT_Face face;
    std::string name, file, unreadable;
};

bool try_font(FT_Library library, const char *name, const std::string &path, opened_font &out)
{
    FT_Face face = nullptr;
    if (!succeeded(FT_New_Face(library, path.c_str(), 0, &face)) || !FT_IS_SCALABLE(face)) {
        if (face) FT_Done_Face(face);
        if (out.unreadable.empty()) out.unreadable = path;
        return false;
    }
    out.face = face, out.name = name, out.file = path;
    return true;
}

bool open_font(FT_Library library, const std::vector<std::string> &folders, opened_font &out)
{
    for (const char *font : fonts)
        for (const std::string &folder : folders)
            for (const std::string &path : find_files(folder, font))
                if (try_font(library, font, path, out)) return true;
    return false;
}

std::string known_fonts()
{
    std::string out;
    for (const char *font : fonts) out += (out.empty() ? "" : ", ") + std::string(font);
    return out;
}

/* ---- characters ------------------------------------------------------------------------------------------------- */

/* Decodes the character that begins at byte `at`, and advances `at` to the first byte after it. Returns the replacement
 * character for invalid UTF-8. */
char32_t decode_next_character(const std::string &text, std::size_t &at)
{
    static const char32_t least[] = {0, 0x80, 0x800, 0x10000};
    const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U; };
    const unsigned first = byte(at);
    const std::size_t more = first < 0x80 ? 0 : first >> 5 == 6 ? 1 : first >> 4 == 14 ? 2 : first >> 3 == 30 ? 3 : 4;
    const std::size_t begin = at++;
    if (more == 0) return first;
    if (more == 4) return replacement;
    char32_t out = first & (0x3FU >> more);
    for (std::size_t i = 1; i <= more; i++) {
        if (byte(begin + i) >> 6 != 2) return replacement;
        out = out << 6 | (byte(begin + i) & 0x3FU);
    }
    if (out < least[more] || out > 0x10FFFF || (out >= 0xD800 && out < 0xE000)) return replacement;
    at = begin + more + 1;
    return out;
}

/* Returns the glyph of a character. Control characters are drawn as blanks, because the text is a single line. */
FT_UInt find_glyph(FT_Face face, char32_t character)
{
    const bool is_control = character < 0x20 || (character >= 0x7F && character < 0xA0);
    return FT_Get_Char_Index(face, is_control ? ' ' : character);
}

/* Returns the kerning between two glyphs in pixels, positive to the right. */
int get_kerning(FT_Face face, FT_UInt before, FT_UInt glyph)
{
    FT_Vector step = {0, 0};
    if (!before || !glyph || !FT_HAS_KERNING(face)) return 0;
    if (!succeeded(FT_Get_Kerning(face, before, glyph, FT_KERNING_DEFAULT, &step))) return 0;
    return static_cast<int>(step.x >> 6);
}

bool set_size(FT_Face face, int size)
{
    return face->size->metrics.y_ppem == size || succeeded(FT_Set_Pixel_Sizes(face, 0, static_cast<FT_UInt>(size)));
}

int advance_of_loaded(FT_Face face)
{
    return static_cast<int>((face->glyph->advance.x + 32) >> 6);
}

/* Loads each glyph and calls visit(x) with the pen's position; returns the pen's position after the last glyph. */
template <typename visitor>
int lay_out_glyphs(FT_Face face, const std::vector<char32_t> &characters, int size, FT_Int32 flags, visitor visit)
{
    int x = 0;
    FT_UInt before = 0;
    if (!set_size(face, size)) return 0;
    for (const char32_t character : characters) {
        const FT_UInt glyph = find_glyph(face, character);
        x += get_kerning(face, before, glyph);
        before = glyph;
        if (!succeeded(FT_Load_Glyph(face, glyph, flags))) continue;
        const int advance = advance_of_loaded(face);
        visit(x);
        x += advance;
    }
    return x;
}

void draw_bitmap(const FT_Bitmap &map, int left, int top, const cover_pixel &cover)
{
    for (unsigned row = 0; row < map.rows; row++)
        for (unsigned column = 0; column < map.width; column++) {
            const unsigned char grey = map.buffer[static_cast<std::ptrdiff_t>(row) * map.pitch + column];
            if (grey) cover(left + static_cast<int>(column), static_cast<int>(row) - top, grey / 255.0);
        }
}

/* Draws the loaded glyph, widened by the stroker's radius: calls `cover` for each of its pixels. */
void draw_widened_glyph(FT_GlyphSlot slot, FT_Stroker stroker, int x, const cover_pixel &cover)
{
    FT_Glyph glyph = nullptr;
    if (slot->format != FT_GLYPH_FORMAT_OUTLINE || !succeeded(FT_Get_Glyph(slot, &glyph))) return;
    FT_Error code = FT_Glyph_StrokeBorder(&glyph, stroker, 0, 1);
    if (!code) code = FT_Glyph_To_Bitmap(&glyph, FT_RENDER_MODE_NORMAL, nullptr, 1);
    const std::unique_ptr<FT_GlyphRec_, void (*)(FT_Glyph)> guard(glyph, FT_Done_Glyph);
    if (!succeeded(code)) return;
    const auto *const bitmap = reinterpret_cast<FT_BitmapGlyph>(glyph);
    draw_bitmap(bitmap->bitmap, x + bitmap->left, bitmap->top, cover);
}

} // namespace

std::vector<char32_t> decode_utf8(const std::string &text, bool &is_bad)
{
    std::vector<char32_t> out;
    out.reserve(text.size());
    for (std::size_t at = 0; at < text.size();) {
        const std::size_t begin = at;
        out.push_back(decode_next_character(text, at));
        is_bad = is_bad || (out.back() == replacement && at == begin + 1);
    }
    return out;
}

typeface::typeface()
{
    /* FT_Init_FreeType() fails only if memory runs out, but with another error code. It succeeds without the modules
     * for which there is no memory. */
    if (FT_Init_FreeType(&library_)) throw std::bad_alloc();
    try {
        for (const char *module : {"autofitter", "truetype", "sfnt", "smooth"})
            if (!FT_Get_Module(library_, module)) throw std::bad_alloc();
        opened_font font{};
        is_from_system_ = !open_font(library_, split_folders(configured_folders()), font) &&
                          open_font(library_, {"/usr/share/fonts", "/usr/local/share/fonts"}, font);
        face_ = font.face, name_ = font.name, file_ = font.file, unreadable_ = font.unreadable;
    } catch (...) {
        FT_Done_FreeType(library_);
        throw;
    }
}

typeface::~typeface()
{
    if (library_) FT_Done_FreeType(library_);
}

int typeface::width_of(const std::string &text, int size) const
{
    bool is_bad = false;
    int x = 0;
    FT_UInt before = 0;
    if (!face_ || !set_size(face_, size)) return 0;
    for (const char32_t character : decode_utf8(text, is_bad)) {
        const FT_UInt glyph = find_glyph(face_, character);
        x += get_kerning(face_, before, glyph) + compute_glyph_advance(glyph, size);
        before = glyph;
    }
    return x;
}

/* Returns the advance of a glyph in pixels. The size must be set already. */
int typeface::compute_glyph_advance(unsigned glyph, int size) const
{
    const auto known = advances_.find({size, glyph});
    if (known != advances_.end()) return known->second;
    const int advance = succeeded(FT_Load_Glyph(face_, glyph, load_flags)) ? advance_of_loaded(face_) : 0;
    advances_[{size, glyph}] = advance;
    return advance;
}

void typeface::draw(const std::string &text, int size, double halo, const cover_pixel &cover)
{
    if (!face_) return;
    bool is_bad = false;
    const std::vector<char32_t> characters = decode_utf8(text, is_bad);
    if (!(halo > 0)) {
        const FT_GlyphSlot slot = face_->glyph;
        lay_out_glyphs(face_, characters, size, load_flags | FT_LOAD_RENDER,
                       [&](int x) { draw_bitmap(slot->bitmap, x + slot->bitmap_left, slot->bitmap_top, cover); });
        return;
    }
    FT_Stroker stroker = nullptr;
    if (!succeeded(FT_Stroker_New(library_, &stroker))) return;
    const std::unique_ptr<FT_StrokerRec_, void (*)(FT_Stroker)> guard(stroker, FT_Stroker_Done);
    FT_Stroker_Set(stroker, std::lround(64 * halo), FT_STROKER_LINECAP_ROUND, FT_STROKER_LINEJOIN_ROUND, 0);
    lay_out_glyphs(face_, characters, size, load_flags | FT_LOAD_NO_BITMAP,
                   [&](int x) { draw_widened_glyph(face_->glyph, stroker, x, cover); });
}

void typeface::record_missing(const std::string &text)
{
    if (!face_) return;
    for (const char32_t character : decode_utf8(text, has_bad_bytes_))
        if (find_glyph(face_, character) == 0) missing_.insert(character);
}

std::string typeface::font_fault() const
{
    const std::string own = configured_folders();
    const std::string read = unreadable_.empty() ? "" : " (" + unreadable_ + " cannot be read as a font)";
    if (!face_)
        return "no font was found, so its words are left out" + read +
               "; expected DejaVuSans in the system's fonts or in a folder that OPENIMAGEIO_FONTS names";
    if (own.empty() || !is_from_system_) return "";
    return "no font was found in OPENIMAGEIO_FONTS, which is " + own + read + "; expected a file of " + known_fonts() +
           "; words are drawn by " + file_;
}

std::string typeface::missing() const
{
    enum { NAMED = 8 };
    std::string out = missing_.empty() ? "" : "the font " + name_ + " has no glyphs for";
    std::size_t count = 0;
    for (const char32_t character : missing_) {
        char name[24];
        if (++count > NAMED) break;
        std::snprintf(name, sizeof name, "%s U+%04X", count > 1 ? "," : "", static_cast<unsigned>(character));
        out += name;
    }
    if (missing_.size() > NAMED) out += " and " + std::to_string(missing_.size() - NAMED) + " others";
    if (!missing_.empty()) out += ", which are drawn as boxes";
    if (has_bad_bytes_)
        out += std::string(out.empty() ? "" : "; ") + "words have bytes that are not UTF-8, drawn as U+FFFD";
    return out;
}
