/* Checks numbers that are written as text. Fortran omits the E if an exponent has three digits (0.123-101); VTK's
 * readers parse this as two numbers, or as the first of them. */
#ifndef NUMBER_CHECK_H
#define NUMBER_CHECK_H

#include <cstdint>
#include <string>

namespace render_tool
{

/* Checks whether a word is a number in the syntax of C: 1, -2.5, 1e-101, nan, inf. */
bool is_number(const std::string &word);

/* The type of numbers in a text file. */
struct number_type {
    std::string name; // name in the file, for messages
    int bits = 64;    // size of a number
    bool is_integer = false;
    bool has_sign = true;
};

/* Checks whether VTK reads a word as the number of this type that it stands for. It reads the names nan and inf only in
 * XML files (has_names). It does not read "infinity", nor numbers beyond the range of the type. Integers must have
 * neither a point nor an exponent: VTK stops reading there, and reads 4e2 as 4. */
bool is_readable_number(const std::string &word, bool has_names, const number_type &type);

/* Throws a std::runtime_error whose message contains the word, what is wrong with it, and the number of the file's line
 * at this byte offset. */
[[noreturn]] void refuse_number(const std::string &path, const std::string &word, int64_t offset,
                                const number_type &type = {});

/* Throws std::runtime_error, as refuse_number() does, if a data array of a VTK XML file contains a word that VTK does
 * not read as a number. Throws too if the pieces in the file have different fields (piece_check.h). */
void check_xml_tags(const std::string &path);

} // namespace render_tool

#endif
