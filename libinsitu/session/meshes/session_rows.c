#include "session_rows.h"

session_rows session_describe_caller_rows(const insitu_mesh *given)
{
    const int64_t nodes = session_count_cell_nodes(given), row = given->connectivity_row;
    return (session_rows){
        .cells = session_caller_grid(given), .nodes_per_cell = nodes, .row_stride = row ? row : nodes};
}

session_rows session_describe_rows(const session_mesh *mesh)
{
    session_rows rows = session_describe_caller_rows(&mesh->given);
    rows.is_discontinuous = mesh->discontinuous.is_active;
    return rows;
}

int session_find_cell_kind(const session_rows *rows, int type, int64_t count)
{
    for (int i = 0; i < rows->kind_count; i++)
        if (rows->kinds[i].type == type && rows->kinds[i].nodes.count == count) return i;
    return -1;
}

void session_list_cell_kinds(session_rows *rows)
{
    const int64_t cells = rows->cells.offsets.data ? rows->cells.cell_count : 1;
    int last_type = -1;
    int64_t last_size = -1;
    for (int64_t cell = 0; cell < cells && rows->kind_count < ROWS_MOST_KINDS; cell++) {
        const int type = grid_cell_type(&rows->cells, cell);
        const int64_t size = session_count_nodes_of_cell(rows, cell);
        if ((type == last_type && size == last_size) || session_find_cell_kind(rows, type, size) >= 0) continue;
        session_row_kind *kind = &rows->kinds[rows->kind_count++];
        *kind = (session_row_kind){type, {type, 1, (int)size, true, false}};
        session_describe_nodes(type, size, &kind->nodes); /* leaves the nodes unchanged if the type is linear */
        last_type = type;
        last_size = size;
    }
}
