/* Reads the tags of VTK's XML files. */
#ifndef XML_TAG_H
#define XML_TAG_H

#include <string>

namespace render_tool
{

/* Returns the value of a tag's attribute; "" if it has none. tag: the text between '<' and '>', in which blanks are the
 * only white space. */
std::string get_xml_attribute(const std::string &tag, const std::string &name);

} // namespace render_tool

#endif
