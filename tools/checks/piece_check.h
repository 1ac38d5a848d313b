/* Checks that all pieces of one file of VTK's XML formats have the same fields. VTK's readers create the arrays that
 * the first piece lists, and fill the values of the other pieces into them by position. If another piece lists fewer
 * arrays, their values there are uninitialised memory; if it lists them in another order, the values of fields are
 * exchanged. */
#ifndef PIECE_CHECK_H
#define PIECE_CHECK_H

#include <array>
#include <string>
#include <vector>

namespace render_tool
{

class piece_check
{
  public:
    /* Adds the next tag of the file, without its angle brackets. White space in it must be blanks. */
    void add_tag(const std::string &tag);

    /* Throws std::runtime_error with the fields of the first piece that has others than piece 1. Later pieces without
     * points and, for fields of cells, later pieces without cells may have any fields. */
    void check(const std::string &path) const;

  private:
    /* The arrays of one piece: of points and of cells, and whether there are no points or cells. An array is described
     * by its name, type and number of components. */
    struct piece {
        std::array<std::string, 2> arrays;
        std::array<bool, 2> is_empty;
    };
    std::vector<piece> pieces_;
    std::string *list_ = nullptr; // the list within which the last tag is; null if it is outside of all lists
};

} // namespace render_tool

#endif
