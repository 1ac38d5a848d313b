/* Checks numbers that are written as text. Fortran leaves the E out where an exponent has three digits (0.123-101), and
 * VTK's readers take that for two numbers, or for the first of them. */
#ifndef NUMBER_CHECK_H
#define NUMBER_CHECK_H

#include <cstdint>
#include <string>

namespace render_tool
{

/* Tells whether a word is a number as C has it: 1, -2.5, 1e-101, nan, inf. */
bool is_number(const std::string &word);

/* Throws std::runtime_error with the line of the file in which the byte `offset` lies. */
[[noreturn]] void refuse_number(const std::string &path, const std::string &word, int64_t offset);

/* Throws std::runtime_error, as above, where a data array of one of VTK's XML files has a word that is no number. */
void check_xml_numbers(const std::string &path);

} // namespace render_tool

#endif
