#include "number_check.h"

#include <cctype>
#include <cmath>
#include <cstdlib>
#include <fstream>
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

bool is_blank(int c)
{
    return c == ' ' || (c >= '\t' && c <= '\r');
}

/* Advances `at` past the digits that begin at this index, if any; returns their number. */
size_t skip_digits(const std::string &word, size_t &at)
{
    const size_t first = at;
    while (at < word.size() && is_digit(word[at])) at++;
    return at - first;
}

/* Reads a tag or a comment, of which '<' has been read, up to its '>'. Returns what is in between, with a blank for
 * each white-space character; "" at the end of the file. A '>' in quotes or within a comment ends neither. */
std::string read_tag(std::streambuf *in, int64_t &offset)
{
    std::string tag;
    char quote = 0;
    for (int c = in->sbumpc(); c != std::char_traits<char>::eof(); c = in->sbumpc()) {
        offset++;
        const bool is_comment = tag.compare(0, 3, "!--") == 0;
        if (c == '>' && (is_comment ? tag.size() >= 5 && tag.compare(tag.size() - 2, 2, "--") == 0 : quote == 0))
            return tag;
        if (!is_comment && (c == '"' || c == '\'') && (quote == 0 || quote == c))
            quote = quote == 0 ? static_cast<char>(c) : '\0';
        tag += is_blank(c) ? ' ' : static_cast<char>(c);
    }
    return "";
}

/* Checks whether the element that begins with `tag` contains text values, which is the default of VTK's readers. */
bool has_text_values(const std::string &tag)
{
    if (tag.compare(0, 10, "DataArray ") != 0 || tag.back() == '/') return false;
    const std::string format = get_xml_attribute(tag, "format");
    return format.empty() || format == "ascii";
}

/* Throws if VTK does not read one of the words before the next tag as a number. It reads nan and inf only if a blank
 * follows. */
void check_words(const std::string &path, std::streambuf *in, bool is_single, int64_t &offset)
{
    std::string word;
    const int end = std::char_traits<char>::eof();
    for (int c = in->sgetc();; c = in->snextc(), offset++) {
        if (c != end && c != '<' && !is_blank(c)) {
            word += static_cast<char>(c);
            continue;
        }
        if (!word.empty() && !is_readable_number(word, is_blank(c), is_single))
            refuse_number(path, word, offset - static_cast<int64_t>(word.size()));
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

bool is_readable_number(const std::string &word, bool has_names, bool is_single)
{
    constexpr size_t digits_of_largest_float = 38;
    if (!is_number(word)) return false;
    if (std::isalpha(static_cast<unsigned char>(word.back())))
        return has_names && word.size() == (std::isalpha(static_cast<unsigned char>(word[0])) ? 3U : 4U);
    if (word.size() <= digits_of_largest_float && word.find_first_of("eE") == std::string::npos) return true;
    return is_single ? std::isfinite(std::strtof(word.c_str(), nullptr))
                     : std::isfinite(std::strtod(word.c_str(), nullptr));
}

void refuse_number(const std::string &path, const std::string &word, int64_t offset)
{
    std::ifstream in(path, std::ios::binary);
    int64_t line = 1;
    for (int64_t i = 0; i < offset && in; i++) line += in.get() == '\n';
    throw std::runtime_error(path + ": line " + std::to_string(line) + ": \"" + word.substr(0, 60) + "\" is " +
                             (is_number(word) ? "a number that VTK does not read here" : "no number"));
}

void check_xml_tags(const std::string &path)
{
    std::ifstream in(path, std::ios::binary);
    std::streambuf *bytes = in.rdbuf();
    int64_t offset = 0;
    piece_check pieces;
    for (int c = bytes->sbumpc(); c != std::char_traits<char>::eof(); c = bytes->sbumpc()) {
        offset++;
        if (c != '<') continue;
        const std::string tag = read_tag(bytes, offset);
        if (tag.empty() || tag.compare(0, 12, "AppendedData") == 0) break;
        pieces.add_tag(tag);
        if (has_text_values(tag)) check_words(path, bytes, get_xml_attribute(tag, "type") == "Float32", offset);
    }
    pieces.check(path);
}

} // namespace render_tool
