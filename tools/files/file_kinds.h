/* Knows for each ending which of VTK's readers reads it, and makes it ready to load everything. */
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
    vtkSmartPointer<vtkAlgorithm> (*make)(const std::string &path); // null: no reader of VTK's (see data_file.cpp)
    bool may_hold_steps;
    bool names_files;      // it names files of its own folder, which the reader opens
    const char *piece_tag; // an XML tag that the file has once for each piece that can be read separately
};

const std::vector<file_kind> &file_kinds();

/* Null where the name has no ending that is known. */
const file_kind *kind_of(const std::string &path);

} // namespace render_tool

#endif
