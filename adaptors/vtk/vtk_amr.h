/* Finds the cells of overlapping AMR that finer levels replace, by the boxes of the levels. */
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

/* The ghost flags of data, which is the number-th of its level, with REFINEDCELL where a box of the next level lies, as
 * vtkAMRUtilities::BlankCells() would set them. Null where no such box lies. count gets a warning where the boxes and
 * data contradict each other. amr and data are not changed. */
vtkSmartPointer<vtkUnsignedCharArray> refined_flags(vtkOverlappingAMR *amr, unsigned level, unsigned number,
                                                    vtkDataSet *data, const std::string &what, tally &count);

} // namespace insitu_vtk

#endif
