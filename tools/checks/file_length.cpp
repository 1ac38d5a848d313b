/* A number that is cut off is often still a valid number, so plain text must end with a newline. Files of VTK's XML
 * formats must end with their last tag. This also applies to the files that they reference and that VTK's readers
 * open. */
#include "file_length.h"

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <stdexcept>

#include <sys/stat.h>

#include "ensight_check.h"
#include "legacy_check.h"
#include "netcdf_size.h"
#include "number_check.h"
#include "xml_tag.h"

namespace render_tool
{

namespace
{

bool has_ending(const std::string &path, const std::string &ending)
{
    return path.size() >= ending.size() && path.compare(path.size() - ending.size(), ending.size(), ending) == 0;
}

void check_last_line(const std::string &path)
{
    std::ifstream in(path, std::ios::binary);
    in.seekg(-1, std::ios::end);
    if (!in || in.get() == '\n') return;
    throw std::runtime_error(path + ": is cut short: its last line has no end");
}

std::string read_last_bytes(const std::string &path, int64_t count)
{
    std::ifstream in(path, std::ios::binary | std::ios::ate);
    const int64_t size = in ? static_cast<int64_t>(in.tellg()) : 0, start = std::max<int64_t>(size - count, 0);
    std::string bytes(static_cast<size_t>(size - start), '\0');
    in.seekg(start);
    in.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return bytes;
}

/* Throws unless the last 4096 bytes of the file contain the last tag of VTK's XML formats, </VTKFile>. */
void check_last_tag(const std::string &path)
{
    const bool is_whole = read_last_bytes(path, 4096).find("</VTKFile>") != std::string::npos;
    if (!is_whole) throw std::runtime_error(path + ": is cut short: it has no </VTKFile> at its end");
}

/* Checks whether the file's extension is that of one of VTK's XML formats. */
bool is_vtk_xml(const std::string &path)
{
    const std::string name = path.substr(path.find_last_of('/') + 1);
    const size_t dot = name.find_last_of('.');
    const std::string ending = dot == std::string::npos ? "" : name.substr(dot);
    return ending.compare(0, 4, ".pvt") == 0 || ending == ".pvd" || ending == ".vthb" ||
           (ending.compare(0, 3, ".vt") == 0 && ending != ".vtk" && ending != ".vtkhdf");
}

} // namespace

void check_length(const std::string &path)
{
    const int64_t expected = netcdf_bytes(path);
    struct stat info;
    if (expected > 0 && stat(path.c_str(), &info) == 0 && info.st_size < expected)
        throw std::runtime_error(path + ": is cut short: " + std::to_string(info.st_size) + " bytes of " +
                                 std::to_string(expected));
    if (is_vtk_xml(path)) {
        check_last_tag(path);
        check_xml_tags(path);
    }
    if (has_ending(path, ".vtk")) check_legacy(path);
    if (has_ending(path, ".case")) {
        check_last_line(path);
        check_ensight(path);
    }
}

bool is_empty_vtu(const std::string &path)
{
    std::ifstream in(path, std::ios::binary);
    int64_t offset = 0;
    for (std::string tag; read_xml_tag(in.rdbuf(), offset, tag);) {
        const bool has_data =
            get_xml_attribute(tag, "NumberOfPoints") != "0" || get_xml_attribute(tag, "NumberOfCells") != "0";
        if (tag.compare(0, 5, "Piece") == 0 && has_data) return false;
        if (tag == "/UnstructuredGrid") return true;
    }
    return false;
}

} // namespace render_tool
