/* Decodes text in UTF-8. Names of files and of fields may be any bytes. */
#ifndef UTF8_TEXT_H
#define UTF8_TEXT_H

#include <cstddef>
#include <cstdint>
#include <string>

namespace render_tool
{

/* Returns the number of bytes of the character that begins at this index, and its code point. Returns 0 if the bytes
 * there are no character of UTF-8. */
size_t decode_character(const std::string &text, size_t at, uint32_t &code);

bool is_utf8(const std::string &text);

} // namespace render_tool

#endif
