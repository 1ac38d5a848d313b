/* Each file extension has a function that creates its reader, with every array enabled, because some of VTK's readers
 * load nothing by default. Readers that a VTK installation may lack are compiled only if CMake found them. */
#include "file_kinds.h"

#include <vtkAlgorithm.h>
#include <vtkGenericDataObjectReader.h>
#include <vtkXMLImageDataReader.h>
#include <vtkXMLMultiBlockDataReader.h>
#include <vtkXMLPImageDataReader.h>
#include <vtkXMLPRectilinearGridReader.h>
#include <vtkXMLPStructuredGridReader.h>
#include <vtkXMLPartitionedDataSetCollectionReader.h>
#include <vtkXMLRectilinearGridReader.h>
#include <vtkXMLPolyDataReader.h>
#include <vtkXMLStructuredGridReader.h>
#include <vtkXMLUniformGridAMRReader.h>
#include <vtkXMLUnstructuredGridReader.h>
#ifdef INSITU_VTK_HDF
#include <vtkHDFReader.h>
#endif
#ifdef INSITU_VTK_EXODUS
#include "exodus_reader.h"
#endif
#ifdef INSITU_VTK_CGNS
#include "cgns_reader.h"
#endif
#ifdef INSITU_VTK_ENSIGHT
#include <vtkGenericEnSightReader.h>
#endif
#ifdef INSITU_VTK_OPENFOAM
#include <vtkOpenFOAMReader.h>
#endif

#include "part_files.h"

namespace render_tool
{

namespace
{

using reader = vtkSmartPointer<vtkAlgorithm>;

template <typename Reader> reader make_plain_reader(const std::string &path)
{
    auto r = vtkSmartPointer<Reader>::New();
    r->SetFileName(path.c_str());
    return r;
}

reader make_legacy_reader(const std::string &path)
{
    auto r = vtkSmartPointer<vtkGenericDataObjectReader>::New();
    r->SetFileName(path.c_str());
    r->ReadAllScalarsOn();
    r->ReadAllColorScalarsOn();
    r->ReadAllVectorsOn();
    r->ReadAllTensorsOn();
    r->ReadAllNormalsOn();
    r->ReadAllTCoordsOn();
    r->ReadAllFieldsOn();
    return r;
}

reader make_amr(const std::string &path)
{
    auto r = vtkSmartPointer<vtkXMLUniformGridAMRReader>::New();
    r->SetFileName(path.c_str());
    r->SetMaximumLevelsToReadByDefault(0); // 0 makes the reader read all levels
    return r;
}

#ifdef INSITU_VTK_ENSIGHT
reader make_ensight_reader(const std::string &path)
{
    auto r = vtkSmartPointer<vtkGenericEnSightReader>::New();
    r->SetCaseFileName(path.c_str());
    r->ReadAllVariablesOn();
    return r;
}
#endif

#ifdef INSITU_VTK_OPENFOAM
/* Creates a reader of the mesh's cells with the values that the solver computed, without VTK's averages at the
 * points. */
reader make_openfoam_reader(const std::string &path)
{
    auto r = vtkSmartPointer<vtkOpenFOAMReader>::New();
    r->SetFileName(path.c_str());
    r->DecomposePolyhedraOff();
    r->CreateCellToPointOff();
    r->UpdateInformation();
    r->EnableAllCellArrays();
    r->EnableAllPointArrays();
    r->DisableAllLagrangianArrays();
    r->DisableAllPatchArrays();
    r->SetPatchArrayStatus("internalMesh", 1);
    return r;
}
#endif

} // namespace

const std::vector<file_kind> &file_kinds()
{
    constexpr bool no = false, yes = true;
    static const std::vector<file_kind> kinds = {
        {".vtu", make_plain_reader<vtkXMLUnstructuredGridReader>, no, no, nullptr, no},
        {".pvtu", nullptr, no, no, nullptr, no},
        {".vti", make_plain_reader<vtkXMLImageDataReader>, no, no, nullptr, yes},
        {".pvti", make_plain_reader<vtkXMLPImageDataReader>, no, yes, nullptr, yes},
        {".vtr", make_plain_reader<vtkXMLRectilinearGridReader>, no, no, nullptr, yes},
        {".pvtr", make_plain_reader<vtkXMLPRectilinearGridReader>, no, yes, nullptr, yes},
        {".vtp", make_plain_reader<vtkXMLPolyDataReader>, no, no, nullptr, no},
        {".vts", make_plain_reader<vtkXMLStructuredGridReader>, no, no, nullptr, yes},
        {".pvts", make_plain_reader<vtkXMLPStructuredGridReader>, no, yes, nullptr, yes},
        {".vtm", make_plain_reader<vtkXMLMultiBlockDataReader>, no, yes, "<DataSet", no},
        {".vtmb", make_plain_reader<vtkXMLMultiBlockDataReader>, no, yes, "<DataSet", no},
        {".vtpc", make_plain_reader<vtkXMLPartitionedDataSetCollectionReader>, no, yes, nullptr, no},
        {".vthb", make_amr, no, yes, nullptr, no},
        {".vtk", make_legacy_reader, no, no, nullptr, no},
        {".pvd", nullptr, yes, no, nullptr, no},
        {".series", nullptr, yes, no, nullptr, no},
#ifdef INSITU_VTK_HDF
        {".vtkhdf", make_plain_reader<vtkHDFReader>, yes, no, nullptr, no},
#endif
#ifdef INSITU_VTK_EXODUS
        {".ex2", make_exodus_reader, yes, no, nullptr, no},
        {".exo", make_exodus_reader, yes, no, nullptr, no},
        {".exii", make_exodus_reader, yes, no, nullptr, no},
        {".e", make_exodus_reader, yes, no, nullptr, no},
        {".g", make_exodus_reader, yes, no, nullptr, no},
#endif
#ifdef INSITU_VTK_CGNS
        {".cgns", make_cgns_reader, yes, no, nullptr, no},
#endif
#ifdef INSITU_VTK_ENSIGHT
        {".case", make_ensight_reader, yes, no, nullptr, no},
#endif
#ifdef INSITU_VTK_OPENFOAM
        {".foam", make_openfoam_reader, yes, no, nullptr, no},
#endif
    };
    return kinds;
}

const file_kind *kind_of(const std::string &path)
{
    const std::string name = logical_name(path.substr(path.find_last_of('/') + 1));
    const size_t dot = name.find_last_of('.');
    if (dot == std::string::npos) return nullptr;
    for (const file_kind &kind : file_kinds())
        if (name.substr(dot) == kind.ending) return &kind;
    return nullptr;
}

} // namespace render_tool
