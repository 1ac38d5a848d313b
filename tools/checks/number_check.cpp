#include "number_check.h"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <stdexcept>

#include "piece_check.h"

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

/* Checks whether the element that begins with `tag` contains text values, which is the default of VTK's readers. */
bool has_text_values(const std::string &tag)
{
    if (tag.compare(0, 10, "DataArray ") != 0 || tag.back() == '/') return false;
    const size_t format = tag.find(" format=");
    return format == std::string::npos || tag.compare(format + 9, 5, "ascii") == 0;
}

/* Throws if one of the words before the next tag is not a number. */
void check_words(const std::string &path, std::streambuf *in, int64_t &offset)
{
    std::string word;
    const int end = std::char_traits<char>::eof();
    for (int c = in->sgetc();; c = in->snextc(), offset++) {
        if (c != end && c != '<' && !is_blank(c)) {
            word += static_cast<char>(c);
            continue;
        }
        if (!word.empty() && !is_number(word)) refuse_number(path, word, offset - static_cast<int64_t>(word.size()));
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

void refuse_number(const std::string &path, const std::string &word, int64_t offset)
{
    std::ifstream in(path, std::ios::binary);
    int64_t line = 1;
    for (int64_t i = 0; i < offset && in; i++) line += in.get() == '\n';
    throw std::runtime_error(path + ": line " + std::to_string(line) + ": \"" + word.substr(0, 60) + "\" is no number");
}

void check_xml_tags(const std::string &path)
{
    std::ifstream in(path, std::ios::binary);
    std::streambuf *bytes = in.rdbuf();
    int64_t offset = 0;
    const int end = std::char_traits<char>::eof();
    std::string tag;
    piece_check pieces;
    for (int c = bytes->sbumpc(); c != end; c = bytes->sbumpc()) {
        offset++;
        if (c != '<') continue;
        tag.clear();
        for (c = bytes->sbumpc(); c != end && c != '>'; c = bytes->sbumpc()) tag += static_cast<char>(c);
        offset += static_cast<int64_t>(tag.size()) + 1;
        if (c == end || tag.compare(0, 12, "AppendedData") == 0) break;
        std::replace_if(tag.begin(), tag.end(), is_blank, ' ');
        if (!tag.empty()) pieces.add_tag(tag);
        if (has_text_values(tag)) check_words(path, bytes, offset);
    }
    pieces.check(path);
}

} // namespace render_tool
