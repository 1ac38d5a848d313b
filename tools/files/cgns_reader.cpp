/* VTK 9.1 takes the elements with the numbers 1 to N for a zone's N cells. CGNS has no such rule: a section of boundary
 * elements may come first. VTK's cells are then triangles and quads of the boundary, and values of the volume's cells
 * stand on them. */
#include "cgns_reader.h"

#include <array>
#include <stdexcept>
#include <vector>

#include <vtkCGNSReader.h>
#include <vtk_cgns.h>
// clang-format off
#include VTK_CGNS(cgns_io.h)
#include VTK_CGNS(cgnslib.h)
// clang-format on

namespace render_tool
{

namespace
{

using name_buffer = std::array<char, 33>; // CGNS names have at most 32 bytes

/* An element's dimension, by what its type's name begins with, as in HEXA_27; 3 for polyhedra and what is not known. */
int dimension_of(CGNS_ENUMT(ElementType_t) type)
{
    const std::string name = cg_ElementTypeName(type);
    const auto begins = [&](const char *start) { return name.rfind(start, 0) == 0; };
    if (begins("NODE")) return 0;
    if (begins("BAR_")) return 1;
    return begins("TRI_") || begins("QUAD_") ? 2 : 3;
}

/* An open file. What cannot be read is passed over: VTK's reader reports it. */
class cgns_file
{
  public:
    explicit cgns_file(const std::string &path)
    {
        if (cg_open(path.c_str(), CG_MODE_READ, &file_) != CG_OK) file_ = -1;
    }
    ~cgns_file()
    {
        if (file_ >= 0) (void)cg_close(file_);
    }
    cgns_file(const cgns_file &) = delete;
    cgns_file &operator=(const cgns_file &) = delete;

    /* "" or which section of a boundary comes before the cells of its zone. */
    std::string first_boundary() const
    {
        int bases = 0;
        if (file_ < 0 || cg_nbases(file_, &bases) != CG_OK) return "";
        for (int base = 1; base <= bases; base++) {
            name_buffer name{};
            int dimension = 0, space = 0, zones = 0;
            if (cg_base_read(file_, base, name.data(), &dimension, &space) != CG_OK) continue;
            if (cg_nzones(file_, base, &zones) != CG_OK) continue;
            for (int zone = 1; zone <= zones; zone++) {
                const std::string found = boundary_of(base, zone, dimension);
                if (!found.empty()) return std::string(name.data()) + "/" + found;
            }
        }
        return "";
    }

  private:
    int file_ = -1;

    std::string boundary_of(int base, int zone, int dimension) const
    {
        name_buffer name{};
        std::array<cgsize_t, 9> sizes{};
        CGNS_ENUMT(ZoneType_t) kind = CGNS_ENUMV(ZoneTypeNull);
        int sections = 0;
        if (cg_zone_type(file_, base, zone, &kind) != CG_OK || kind != CGNS_ENUMV(Unstructured) ||
            cg_zone_read(file_, base, zone, name.data(), sizes.data()) != CG_OK ||
            cg_nsections(file_, base, zone, &sections) != CG_OK)
            return "";
        for (int number = 1; number <= sections; number++) {
            name_buffer section{};
            CGNS_ENUMT(ElementType_t) type = CGNS_ENUMV(ElementTypeNull);
            cgsize_t first = 0, last = 0;
            int boundary = 0, has_parents = 0;
            if (cg_section_read(file_, base, zone, number, section.data(), &type, &first, &last, &boundary,
                                &has_parents) != CG_OK)
                continue;
            if (type == CGNS_ENUMV(NGON_n) || first > sizes[1]) continue; /* VTK finds faces of polyhedra */
            if (type == CGNS_ENUMV(MIXED)) type = first_type(base, zone, number, first);
            if (dimension_of(type) >= dimension) continue;
            return std::string(name.data()) + ": its section \"" + section.data() + "\" of " +
                   cg_ElementTypeName(type) + " has the elements " + std::to_string(first) + " to " +
                   std::to_string(last);
        }
        return "";
    }

    /* The type of a mixed section's first element. */
    CGNS_ENUMT(ElementType_t) first_type(int base, int zone, int section, cgsize_t first) const
    {
        cgsize_t size = 0, starts[2] = {0, 0};
        if (cg_ElementPartialSize(file_, base, zone, section, first, first, &size) != CG_OK || size < 1)
            return CGNS_ENUMV(MIXED);
        std::vector<cgsize_t> nodes(static_cast<size_t>(size));
        if (cg_poly_elements_partial_read(file_, base, zone, section, first, first, nodes.data(), starts, nullptr) !=
            CG_OK)
            return CGNS_ENUMV(MIXED);
        return static_cast<CGNS_ENUMT(ElementType_t)>(nodes[0]);
    }
};

/* VTK's reader ends the program where a file cannot be opened, so it is opened here first. */
void check_cgns(const std::string &path)
{
    int type = CGIO_FILE_NONE, file = 0;
    if (cgio_check_file(path.c_str(), &type) != CGIO_ERR_NONE ||
        cgio_open_file(path.c_str(), CGIO_MODE_READ, type, &file) != CGIO_ERR_NONE)
        throw std::runtime_error(path + ": cannot be read: is no CGNS file, or is cut short");
    (void)cgio_close_file(file);
    const std::string boundary = cgns_file(path).first_boundary();
    if (boundary.empty()) return;
    throw std::runtime_error(path + ": cannot be read: zone " + boundary +
                             ", which VTK's reader takes for its cells: expected the cells numbered from 1, and "
                             "elements of the boundary behind them");
}

} // namespace

vtkSmartPointer<vtkAlgorithm> make_cgns(const std::string &path)
{
    check_cgns(path);
    auto r = vtkSmartPointer<vtkCGNSReader>::New();
    r->SetFileName(path.c_str());
    r->UpdateInformation();
    r->EnableAllBases();
    r->EnableAllPointArrays();
    r->EnableAllCellArrays();
    return r;
}

} // namespace render_tool
