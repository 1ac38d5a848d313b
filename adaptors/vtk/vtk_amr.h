/* Which cells of overlapping AMR's finer levels stand for, by the boxes of its levels. */
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

/* The ghost flags of data, which is the number-th of its level, with REFINEDCELL where a box of the next level lies:
 * what vtkAMRUtilities::BlankCells() would write into it. Null where no such box does. A warning in count where the
 * boxes and data contradict each other. amr and data are left as they are. */
vtkSmartPointer<vtkUnsignedCharArray> refined_flags(vtkOverlappingAMR *amr, unsigned level, unsigned number,
                                                    vtkDataSet *data, const std::string &what, tally &count);

} // namespace insitu_vtk

#endif
