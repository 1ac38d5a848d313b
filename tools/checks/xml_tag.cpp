#include "xml_tag.h"

namespace render_tool
{

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
