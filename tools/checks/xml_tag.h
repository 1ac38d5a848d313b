/* Reads the tags of VTK's XML files. */
#ifndef XML_TAG_H
#define XML_TAG_H

#include <cstdint>
#include <streambuf>
#include <string>

namespace render_tool
{

bool is_xml_blank(int c);

/* Reads up to the end of the next tag or comment. tag: receives the text between its '<' and its '>', with a blank for
 * each white-space character. A '>' in quotes or within a comment ends neither. offset: increased by the number of
 * bytes read. Returns false at the end of the file, even within a tag. */
bool read_xml_tag(std::streambuf *in, int64_t &offset, std::string &tag);

/* Returns the value of an attribute of a tag that read_xml_tag() has read; "" if it has none. */
std::string get_xml_attribute(const std::string &tag, const std::string &name);

} // namespace render_tool

#endif
