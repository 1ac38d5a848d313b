#include "utf8_text.h"

namespace render_tool
{

size_t decode_character(const std::string &text, size_t at, uint32_t &code)
{
    const auto byte = [&](size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U; };
    static const uint32_t smallest[] = {0, 0, 0x80, 0x800, 0x10000}; // code point of a character of this many bytes
    const unsigned first = byte(at);
    const size_t length = first < 0x80   ? 1
                          : first < 0xc2 ? 0
                          : first < 0xe0 ? 2
                          : first < 0xf0 ? 3
                          : first < 0xf5 ? 4
                                         : 0;
    code = length < 2 ? first : first & (0xffU >> (length + 1));
    for (size_t i = 1; i < length; i++) {
        if ((byte(at + i) & 0xc0) != 0x80) return 0;
        code = code << 6 | (byte(at + i) & 0x3f);
    }
    const bool is_surrogate = code >= 0xd800 && code < 0xe000;
    return is_surrogate || code < smallest[length] || code > 0x10ffff ? 0 : length;
}

bool is_utf8(const std::string &text)
{
    for (size_t at = 0; at < text.size();) {
        uint32_t code = 0;
        const size_t length = decode_character(text, at, code);
        if (length == 0) return false;
        at += length;
    }
    return true;
}

} // namespace render_tool
