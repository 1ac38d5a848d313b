#include "number_check.h"

#include <cctype>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <stdexcept>

#include "piece_check.h"
#include "xml_tag.h"

namespace render_tool
{

namespace
{

bool is_digit(char c)
{
    return c >= '0' && c <= '9';
}

/* Advances `at` past the digits that begin at this index, if any; returns their number. */
size_t skip_digits(const std::string &word, size_t &at)
{
    const size_t first = at;
    while (at < word.size() && is_digit(word[at])) at++;
    return at - first;
}

/* Checks whether the element that begins with `tag` contains text values, which is the default of VTK's readers. */
bool has_text_values(const std::string &tag)
{
    if (tag.compare(0, 10, "DataArray ") != 0 || tag.back() == '/') return false;
    const std::string format = get_xml_attribute(tag, "format");
    return format.empty() || format == "ascii";
}

/* Returns the type that a tag states: Int8 to UInt64, Float32 or Float64. Any other is taken for Float64. */
number_type get_number_type(const std::string &tag)
{
    number_type type;
    type.name = get_xml_attribute(tag, "type");
    type.has_sign = type.name.compare(0, 1, "U") != 0;
    const size_t digits = type.name.find_first_of("0123456789");
    const std::string kind = type.name.substr(0, digits);
    type.is_integer = kind == "Int" || kind == "UInt";
    for (const int bits : {8, 16, 32})
        if (digits != std::string::npos && type.name.substr(digits) == std::to_string(bits)) type.bits = bits;
    return type;
}

/* Checks whether the word has only a sign and digits, and is in the range of the type. */
bool is_integer_in_range(const std::string &word, const number_type &type)
{
    constexpr uint64_t all_bits = std::numeric_limits<uint64_t>::max();
    const bool is_negative = word[0] == '-';
    uint64_t value = 0;
    for (size_t at = is_negative || word[0] == '+' ? 1 : 0; at < word.size(); at++) {
        if (!is_digit(word[at])) return false;
        const auto digit = static_cast<uint64_t>(word[at] - '0');
        if (value > (all_bits - digit) / 10) return false;
        value = 10 * value + digit;
    }
    const uint64_t largest = all_bits >> (64 - type.bits + (type.has_sign ? 1 : 0));
    if (is_negative) return value <= (type.has_sign ? largest + 1 : 0);
    return value <= largest;
}

/* Throws if VTK does not read one of the words before the next tag as a number of the type. It reads nan and inf only
 * if a blank follows. */
void check_words(const std::string &path, std::streambuf *in, const number_type &type, int64_t &offset)
{
    std::string word;
    const int end = std::char_traits<char>::eof();
    for (int c = in->sgetc();; c = in->snextc(), offset++) {
        if (c != end && c != '<' && !is_xml_blank(c)) {
            word += static_cast<char>(c);
            continue;
        }
        if (!word.empty() && !is_readable_number(word, is_xml_blank(c), type))
            refuse_number(path, word, offset - static_cast<int64_t>(word.size()), type);
        word.clear();
        if (c == end || c == '<') return;
    }
}

} // namespace

bool is_number(const std::string &word)
{
    size_t at = !word.empty() && (word[0] == '-' || word[0] == '+') ? 1 : 0;
    if (at < word.size() && std::isalpha(static_cast<unsigned char>(word[at]))) {
        std::string name = word.substr(at);
        for (char &c : name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
        return name == "nan" || name == "inf" || name == "infinity";
    }
    size_t digits = skip_digits(word, at);
    if (at < word.size() && word[at] == '.') digits += skip_digits(word, ++at);
    if (digits == 0) return false;
    if (at == word.size()) return true;
    if (word[at] != 'e' && word[at] != 'E') return false;
    at++;
    if (at < word.size() && (word[at] == '-' || word[at] == '+')) at++;
    return skip_digits(word, at) > 0 && at == word.size();
}

bool is_readable_number(const std::string &word, bool has_names, const number_type &type)
{
    constexpr size_t digits_always_in_range = 38; // of float
    if (!is_number(word)) return false;
    if (type.is_integer) return is_integer_in_range(word, type);
    if (std::isalpha(static_cast<unsigned char>(word.back())))
        return has_names && word.size() == (std::isalpha(static_cast<unsigned char>(word[0])) ? 3U : 4U);
    if (word.size() <= digits_always_in_range && word.find_first_of("eE") == std::string::npos) return true;
    return type.bits == 32 ? std::isfinite(std::strtof(word.c_str(), nullptr))
                           : std::isfinite(std::strtod(word.c_str(), nullptr));
}

void refuse_number(const std::string &path, const std::string &word, int64_t offset, const number_type &type)
{
    std::ifstream in(path, std::ios::binary);
    int64_t line = 1;
    for (int64_t i = 0; i < offset && in; i++) line += in.get() == '\n';
    const std::string place = type.is_integer ? "as " + type.name : "here",
                      what = is_number(word) ? "a number that VTK does not read " + place : "no number";
    throw std::runtime_error(path + ": line " + std::to_string(line) + ": \"" + word.substr(0, 60) + "\" is " + what);
}

void check_xml_tags(const std::string &path)
{
    std::ifstream in(path, std::ios::binary);
    std::streambuf *bytes = in.rdbuf();
    int64_t offset = 0;
    piece_check pieces;
    for (std::string tag; read_xml_tag(bytes, offset, tag) && !tag.empty();) {
        if (tag.compare(0, 12, "AppendedData") == 0) break;
        pieces.add_tag(tag);
        if (has_text_values(tag)) check_words(path, bytes, get_number_type(tag), offset);
    }
    pieces.check(path);
}

} // namespace render_tool
