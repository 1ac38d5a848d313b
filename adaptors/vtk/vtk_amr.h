/* Finds the cells of overlapping AMR that are covered by finer levels, from the boxes of the levels. */
#ifndef VTK_AMR_H
#define VTK_AMR_H

#include <string>

#include <vtkSmartPointer.h>

#include "vtk_arrays.h"

class vtkDataSet;
class vtkOverlappingAMR;
class vtkUnsignedCharArray;

namespace insitu_vtk
{

/* Returns the ghost flags of data, the grid with this number in its level, with REFINEDCELL set in cells that a box of
 * the next level covers, as vtkAMRUtilities::BlankCells() does. Returns null if no box covers any. If the boxes do not
 * match data, adds a warning to log. amr and data do not change. */
vtkSmartPointer<vtkUnsignedCharArray> make_refined_flags(vtkOverlappingAMR *amr, unsigned level, unsigned number,
                                                         vtkDataSet *data, const std::string &what,
                                                         conversion_log &log);

} // namespace insitu_vtk

#endif
