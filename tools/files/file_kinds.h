/* The table of file extensions, with the VTK reader for each. */
#ifndef FILE_KINDS_H
#define FILE_KINDS_H

#include <string>
#include <vector>

#include <vtkSmartPointer.h>

class vtkAlgorithm;

namespace render_tool
{

struct file_kind {
    const char *ending;
    vtkSmartPointer<vtkAlgorithm> (*make)(const std::string &path); // creates the reader; null if VTK has none
    bool may_hold_steps;
    bool names_files;      // the file references files in its folder, which the reader opens
    const char *piece_tag; // XML tag that occurs once for each piece that can be read separately
    bool has_extents;      // the file is one structured grid, of which any part can be read
};

const std::vector<file_kind> &file_kinds();

/* Returns the table's entry for the extension of the path, or null if the extension is unknown. */
const file_kind *kind_of(const std::string &path);

} // namespace render_tool

#endif
