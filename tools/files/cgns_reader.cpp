/* VTK 9.1 assumes that the N cells of a zone are the elements of those sections whose first element number is between 1
 * and N. CGNS has no such rule: a section of boundary elements may come first or in between, and VTK then reads
 * triangles and quads of the boundary as cells. VTK also computes wrong positions for the vertices of a section, unless
 * the sections of cells are also the first ones of the zone in the file.
 *
 * For such zones VTK is given a different file of a few kilobytes. Its nodes are links to those of the user's file,
 * except for the element numbers and the order of sections. In the new file the zone's cells, which are its elements
 * of highest dimension, come first; their relative order does not change, because the values are stored in that
 * order. */
#include "cgns_reader.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <stdexcept>
#include <vector>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <vtkCGNSReader.h>
#include <vtkObjectFactory.h>
#include <vtk_cgns.h>
// clang-format off
#include VTK_CGNS(cgns_io.h)
#include VTK_CGNS(cgnslib.h)
// clang-format on

namespace render_tool
{

namespace
{

using element_type = CGNS_ENUMT(ElementType_t);
using name_buffer = std::array<char, 33>; // CGNS names have at most 32 bytes

/* Returns the dimension of an element type, recognized by the prefix of its name, for example HEXA_27. Returns 3 for
 * polyhedra and unknown types. */
int get_element_dimension(element_type type)
{
    const std::string name = cg_ElementTypeName(type);
    const auto begins = [&](const char *start) { return name.rfind(start, 0) == 0; };
    if (begins("NODE")) return 0;
    if (begins("BAR_")) return 1;
    return begins("TRI_") || begins("QUAD_") ? 2 : 3;
}

struct section {
    int number; // index of the section in the file, counted from 1
    std::string name;
    element_type type;
    cgsize_t first, last;
    int dimension; // dimension of the elements; for a mixed section, that of its first element

    cgsize_t size() const { return last - first + 1; }
};

/* New first element numbers of sections, by the paths of their nodes. */
using new_numbers = std::map<std::string, cgsize_t>;

/* The sections of an unstructured zone. Sections that cannot be read are skipped, because VTK's reader reports them. */
class cgns_zone
{
  public:
    cgns_zone(int file, int base, int zone) : file_(file), base_(base), zone_(zone)
    {
        CGNS_ENUMT(ZoneType_t) kind = CGNS_ENUMV(ZoneTypeNull);
        std::array<cgsize_t, 9> sizes{};
        name_buffer name{};
        int count = 0;
        if (cg_zone_type(file, base, zone, &kind) != CG_OK || kind != CGNS_ENUMV(Unstructured) ||
            cg_zone_read(file, base, zone, name.data(), sizes.data()) != CG_OK ||
            cg_nsections(file, base, zone, &count) != CG_OK)
            return;
        name_ = name.data();
        cell_count_ = sizes[1];
        for (int number = 1; number <= count; number++) read_section(number);
        for (const section &s : sections_) dimension_ = std::max(dimension_, s.dimension);
        std::sort(sections_.begin(), sections_.end(), [](auto &a, auto &b) { return a.first < b.first; });
    }

    const std::string &name() const { return name_; }

    /* Checks whether VTK would read other elements than those of the highest dimension as cells. Zones of polyhedra are
     * always read correctly. */
    bool is_misread_by_vtk() const
    {
        cgsize_t taken = 0;
        int count = 0, last = 0;
        for (const section &s : sections_) {
            if (s.type == CGNS_ENUMV(NGON_n) || s.type == CGNS_ENUMV(NFACE_n)) return false;
            const bool is_taken = s.first <= cell_count_;
            if (is_taken != (s.dimension == dimension_)) return true;
            if (!is_taken) continue;
            taken += s.size();
            count++;
            last = std::max(last, s.number);
        }
        return taken > cell_count_ || last > count;
    }

    /* Assigns new element numbers to the sections, cells first. Throws if the numbers cannot be assigned. */
    void renumber(const std::string &where, const std::string &path, new_numbers &out) const
    {
        check(where);
        cgsize_t next = 1;
        for (const bool are_cells : {true, false})
            for (const section &s : sections_) {
                if ((s.dimension == dimension_) != are_cells) continue;
                out[path + "/" + s.name] = next;
                next += s.size();
            }
    }

  private:
    int file_, base_, zone_, dimension_ = 0;
    std::string name_;
    cgsize_t cell_count_ = 0;
    std::vector<section> sections_; // sections in ascending order of their element numbers

    void read_section(int number)
    {
        name_buffer name{};
        section s{number, "", CGNS_ENUMV(ElementTypeNull), 0, 0, 0};
        int boundary = 0, has_parents = 0;
        if (cg_section_read(file_, base_, zone_, number, name.data(), &s.type, &s.first, &s.last, &boundary,
                            &has_parents) != CG_OK)
            return;
        s.name = name.data();
        s.dimension = get_element_dimension(s.type == CGNS_ENUMV(MIXED) ? first_type(s) : s.type);
        sections_.push_back(s);
    }

    element_type first_type(const section &s) const
    {
        cgsize_t size = 0, starts[2] = {0, 0};
        if (cg_ElementPartialSize(file_, base_, zone_, s.number, s.first, s.first, &size) != CG_OK || size < 1)
            return s.type;
        std::vector<cgsize_t> nodes(static_cast<size_t>(size));
        if (cg_poly_elements_partial_read(file_, base_, zone_, s.number, s.first, s.first, nodes.data(), starts,
                                          nullptr) != CG_OK)
            return s.type;
        return static_cast<element_type>(nodes[0]);
    }

    /* Throws if the element numbers have gaps, because VTK would then write beyond its memory, or if sections mix cells
     * and boundary elements. */
    void check(const std::string &where) const
    {
        cgsize_t next = 1, cells = 0;
        for (const section &s : sections_) {
            if (s.first != next || s.last < s.first)
                throw std::runtime_error(where + ": its section \"" + s.name + "\" has the elements " +
                                         std::to_string(s.first) + " to " + std::to_string(s.last) +
                                         ", expected them to begin with " + std::to_string(next));
            next = s.last + 1;
            if (s.dimension == dimension_) cells += s.size();
        }
        if (cells == cell_count_) return;
        throw std::runtime_error(where + ": its sections of dimension " + std::to_string(dimension_) + " have " +
                                 std::to_string(cells) + " elements, expected its " + std::to_string(cell_count_) +
                                 " cells (sections that mix cells and boundary are not read)");
    }
};

/* Returns the new numbers for all zones that VTK would misread. Throws if the elements of a zone cannot be
 * renumbered. */
new_numbers renumber_for_vtk(const std::string &path)
{
    new_numbers all;
    int file = -1, bases = 0;
    if (cg_open(path.c_str(), CG_MODE_READ, &file) != CG_OK) return all;
    std::string wrong;
    if (cg_nbases(file, &bases) != CG_OK) bases = 0;
    for (int base = 1; base <= bases; base++) {
        name_buffer name{};
        int dimension = 0, space = 0, zones = 0;
        if (cg_base_read(file, base, name.data(), &dimension, &space) != CG_OK ||
            cg_nzones(file, base, &zones) != CG_OK)
            continue;
        for (int number = 1; number <= zones; number++) {
            const cgns_zone zone(file, base, number);
            const std::string place = std::string(name.data()) + "/" + zone.name();
            if (!zone.is_misread_by_vtk()) continue;
            try {
                zone.renumber(std::string(path).append(": cannot be read: zone ").append(place), "/" + place, all);
            } catch (const std::runtime_error &e) {
                wrong = e.what();
            }
        }
    }
    (void)cg_close(file);
    if (!wrong.empty()) throw std::runtime_error(wrong);
    return all;
}

/* A file that is accessed through CGNS's node interface (cgio). */
class node_file
{
  public:
    node_file(const std::string &path, int mode) : path_(path)
    {
        int type = CGIO_FILE_NONE;
        if (mode == CGIO_MODE_READ && cgio_check_file(path.c_str(), &type) != CGIO_ERR_NONE) fail();
        if (mode != CGIO_MODE_READ) type = CGIO_FILE_HDF5;
        if (cgio_open_file(path.c_str(), mode, type, &file_) != CGIO_ERR_NONE) fail();
        check(cgio_get_root_id(file_, &root_));
    }
    ~node_file()
    {
        if (file_ >= 0) (void)cgio_close_file(file_);
    }
    node_file(const node_file &) = delete;
    node_file &operator=(const node_file &) = delete;

    int file() const { return file_; }
    double root() const { return root_; }
    void check(int status) const
    {
        if (status != CGIO_ERR_NONE) fail();
    }
    std::vector<double> children(double node) const
    {
        int count = 0, found = 0;
        check(cgio_number_children(file_, node, &count));
        std::vector<double> ids(static_cast<size_t>(count));
        if (count > 0) check(cgio_children_ids(file_, node, 1, count, &found, ids.data()));
        return ids;
    }
    std::string name(double node) const
    {
        name_buffer text{};
        check(cgio_get_name(file_, node, text.data()));
        return text.data();
    }

  private:
    std::string path_;
    int file_ = -1;
    double root_ = 0;

    [[noreturn]] void fail() const
    {
        throw std::runtime_error(path_ + ": cannot be read: is no CGNS file, or is cut short");
    }
};

/* Writes a file whose nodes are links to the nodes of the user's file. */
class link_writer
{
  public:
    link_writer(const node_file &from, const node_file &to, std::string target, const new_numbers &numbers)
        : from_(from), to_(to), target_(std::move(target)), numbers_(numbers)
    {
    }

    /* Writes the children of a node to `into`. They become links, except for nodes on the path to a renumbered section,
     * which are copied. Renumbered sections are sorted by their numbers, behind all other nodes. */
    void write_children(double node, const std::string &path, double into) const
    {
        std::vector<double> children = from_.children(node);
        const auto number_of = [&](double child) {
            const auto found = numbers_.find(path + "/" + from_.name(child));
            return found == numbers_.end() ? 0 : found->second;
        };
        std::stable_sort(children.begin(), children.end(),
                         [&](double a, double b) { return number_of(a) < number_of(b); });
        for (const double child : children) {
            const std::string name = from_.name(child), child_path = std::string(path).append("/").append(name);
            const auto below = numbers_.lower_bound(child_path + "/");
            const bool is_ancestor = numbers_.count(child_path) > 0 ||
                                     (below != numbers_.end() && below->first.rfind(child_path + "/", 0) == 0);
            const auto number = numbers_.find(path);
            double made = 0;
            if (is_ancestor) {
                copy(child, name, into, made);
                write_children(child, child_path, made);
            } else if (number != numbers_.end() && name == "ElementRange") {
                copy(child, name, into, made);
                set_range(child, number->second, made);
            } else if (name != "CGNSLibraryVersion" || !path.empty()) {
                to_.check(cgio_create_link(to_.file(), into, name.c_str(), target_.c_str(), child_path.c_str(), &made));
            } else {
                copy(child, name, into, made);
            }
        }
    }

  private:
    const node_file &from_, &to_;
    std::string target_;
    const new_numbers &numbers_;

    void copy(double node, const std::string &name, double into, double &made) const
    {
        to_.check(cgio_create_node(to_.file(), into, name.c_str(), &made));
        to_.check(cgio_copy_node(from_.file(), node, to_.file(), made));
    }

    void set_range(double node, cgsize_t first, double made) const
    {
        int64_t range[2] = {0, 0};
        from_.check(cgio_read_all_data_type(from_.file(), node, "I8", range));
        range[1] += static_cast<int64_t>(first) - range[0];
        range[0] = static_cast<int64_t>(first);
        to_.check(cgio_write_all_data_type(to_.file(), made, "I8", range));
    }
};

/* A temporary file that exists only while VTK reads it. It needs a name, because HDF5 cannot open unnamed files. */
class link_file
{
  public:
    link_file(const std::string &path, const new_numbers &numbers)
        : name_((std::filesystem::temp_directory_path() / "insitu-render-XXXXXX").string())
    {
        const int made = mkstemp(name_.data());
        if (made < 0) throw std::runtime_error(name_ + ": cannot be written");
        (void)close(made);
        const removal at_end{name_};
        const node_file from(path, CGIO_MODE_READ);
        {
            const node_file to(name_, CGIO_MODE_WRITE);
            const std::string target = std::filesystem::absolute(path).string();
            link_writer(from, to, target, numbers).write_children(from.root(), "", to.root());
        }
        std::ifstream in(name_, std::ios::binary);
        content_.assign(std::istreambuf_iterator<char>(in), {});
    }

    const std::string &name() const { return name_; }

    /* Creates the file, calls read(), and deletes the file. Returns false if it cannot be written. */
    template <typename Read> bool with_temporary_file(const Read &read) const
    {
        const int file = open(name_.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, S_IRUSR | S_IWUSR);
        if (file < 0) return false;
        const removal at_end{name_};
        const bool is_whole = write(file, content_.data(), content_.size()) == static_cast<ssize_t>(content_.size());
        (void)close(file);
        return is_whole && read();
    }

  private:
    struct removal {
        const std::string &name;
        ~removal() { (void)unlink(name.c_str()); }
    };

    std::string name_, content_;
};

/* VTK's reader, which reads from the file of links if there is one. */
class reader : public vtkCGNSReader
{
  public:
    static reader *New();
    vtkTypeMacro(reader, vtkCGNSReader);

    void set_links(std::unique_ptr<link_file> links)
    {
        links_ = std::move(links);
        SetFileName(links_->name().c_str());
    }

  protected:
    int RequestInformation(vtkInformation *request, vtkInformationVector **in, vtkInformationVector *out) override
    {
        return with_temporary_file([&] { return Superclass::RequestInformation(request, in, out); });
    }
    int RequestData(vtkInformation *request, vtkInformationVector **in, vtkInformationVector *out) override
    {
        return with_temporary_file([&] { return Superclass::RequestData(request, in, out); });
    }

  private:
    std::unique_ptr<link_file> links_;

    template <typename Read> int with_temporary_file(const Read &read)
    {
        int status = 0;
        if (!links_) return read();
        const bool was_written = links_->with_temporary_file([&] {
            status = read();
            return true;
        });
        if (!was_written) vtkErrorMacro(<< links_->name() << " cannot be written");
        return status;
    }
};

vtkStandardNewMacro(reader)

} // namespace

vtkSmartPointer<vtkAlgorithm> make_cgns_reader(const std::string &path)
{
    /* Throws if the file cannot be opened, because VTK's reader would terminate the program. */
    (void)node_file(path, CGIO_MODE_READ);
    const new_numbers numbers = renumber_for_vtk(path);
    auto r = vtkSmartPointer<reader>::New();
    if (numbers.empty()) {
        r->SetFileName(path.c_str());
    } else {
        r->set_links(std::make_unique<link_file>(path, numbers));
    }
    r->UpdateInformation();
    r->EnableAllBases();
    r->EnableAllPointArrays();
    r->EnableAllCellArrays();
    return r;
}

} // namespace render_tool
