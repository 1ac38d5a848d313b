#include "piece_check.h"

#include <stdexcept>

#include "xml_tag.h"

namespace render_tool
{

namespace
{

/* Returns whether the tag begins an element of this name. */
bool begins(const std::string &tag, const std::string &element)
{
    if (tag.compare(0, element.size(), element) != 0) return false;
    return tag.size() == element.size() || tag[element.size()] == ' ' || tag[element.size()] == '/';
}

/* Returns the description of an array for comparisons and messages, such as "u (Float64, 3 components)". */
std::string describe_array(const std::string &tag)
{
    const std::string components = get_xml_attribute(tag, "NumberOfComponents");
    return get_xml_attribute(tag, "Name") + " (" + get_xml_attribute(tag, "type") +
           (components.empty() || components == "1" ? ")" : ", " + components + " components)");
}

} // namespace

void piece_check::add_tag(const std::string &tag)
{
    const bool is_closed = tag.back() == '/';
    if (begins(tag, "Piece")) {
        const bool has_no_points = get_xml_attribute(tag, "NumberOfPoints") == "0",
                   has_no_cells = get_xml_attribute(tag, "NumberOfCells") == "0";
        list_ = nullptr;
        pieces_.push_back({{}, {has_no_points, has_no_points || has_no_cells}});
    } else if (begins(tag, "/PointData") || begins(tag, "/CellData")) {
        list_ = nullptr;
    } else if (!pieces_.empty() && !is_closed && (begins(tag, "PointData") || begins(tag, "CellData"))) {
        list_ = &pieces_.back().arrays[begins(tag, "CellData") ? 1 : 0];
    } else if (list_ && (begins(tag, "DataArray") || begins(tag, "Array"))) {
        *list_ += (list_->empty() ? "" : ", ") + describe_array(tag);
    }
}

void piece_check::check(const std::string &path) const
{
    const char *const fields[] = {"point", "cell"};
    const auto text = [](const std::string &arrays) { return arrays.empty() ? "none" : arrays; };
    for (size_t i = 1; i < pieces_.size(); i++)
        for (size_t k = 0; k < 2; k++) {
            const std::string &first = pieces_[0].arrays[k], &other = pieces_[i].arrays[k];
            if (other == first || pieces_[i].is_empty[k]) continue;
            throw std::runtime_error(path + ": the " + fields[k] + " data of piece " + std::to_string(i + 1) + " of " +
                                     std::to_string(pieces_.size()) + " are " + text(other) +
                                     ", expected those of piece 1: " + text(first));
        }
}

} // namespace render_tool
