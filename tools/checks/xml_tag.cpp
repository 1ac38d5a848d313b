#include "xml_tag.h"

namespace render_tool
{

bool is_xml_blank(int c)
{
    return c == ' ' || (c >= '\t' && c <= '\r');
}

bool read_xml_tag(std::streambuf *in, int64_t &offset, std::string &tag)
{
    const int end = std::char_traits<char>::eof();
    int c = in->sbumpc();
    for (; c != end && c != '<'; c = in->sbumpc()) offset++;
    if (c == end) return false;
    offset++;
    tag.clear();
    char quote = 0;
    for (c = in->sbumpc(); c != end; c = in->sbumpc()) {
        offset++;
        const bool is_comment = tag.compare(0, 3, "!--") == 0;
        if (c == '>' && (is_comment ? tag.size() >= 5 && tag.compare(tag.size() - 2, 2, "--") == 0 : quote == 0))
            return true;
        if (!is_comment && (c == '"' || c == '\'') && (quote == 0 || quote == c))
            quote = quote == 0 ? static_cast<char>(c) : '\0';
        tag += is_xml_blank(c) ? ' ' : static_cast<char>(c);
    }
    return false;
}

std::string get_xml_attribute(const std::string &tag, const std::string &name)
{
    for (size_t at = tag.find(' '); at < tag.size();) {
        const size_t begin = tag.find_first_not_of(' ', at), equals = tag.find('=', begin),
                     quote = tag.find_first_of("\"'", equals);
        if (quote == std::string::npos) return "";
        const size_t end = tag.find(tag[quote], quote + 1);
        if (end == std::string::npos) return "";
        if (tag.substr(begin, tag.find_first_of(" =", begin) - begin) == name)
            return tag.substr(quote + 1, end - quote - 1);
        at = end + 1;
    }
    return "";
}

} // namespace render_tool
