/* Implements the functions of a session that the adaptor calls. Defaults are those that the public header documents. */
#include "test_vtk_session_stub.h"

#include <iterator>

void insitu_mesh_defaults(insitu_mesh *mesh)
{
    *mesh = insitu_mesh{};
    mesh->cell_type = INSITU_TET;
    mesh->changed = INSITU_CHANGED_ALL;
}

void insitu_field_defaults(insitu_field *field)
{
    *field = insitu_field{};
    field->component_count = 1;
    field->changed = INSITU_CHANGED_ALL;
}

insitu_status insitu_set_mesh(insitu_session *session, const char *name, const insitu_mesh *mesh)
{
    if (!mesh) {
        const std::string blocks = std::string(name) + "[";
        session->meshes.erase(name);
        for (auto it = session->meshes.begin(); it != session->meshes.end();)
            it = it->first.compare(0, blocks.size(), blocks) == 0 ? session->meshes.erase(it) : std::next(it);
        return INSITU_OK;
    }
    if (session->next_mesh_status != INSITU_OK) return session->next_mesh_status;
    session->meshes[name] = {*mesh, {}};
    return INSITU_OK;
}

insitu_status insitu_set_field(insitu_session *session, const char *mesh, const insitu_field *field)
{
    if (session->next_field_status != INSITU_OK) return session->next_field_status;
    session->meshes.at(mesh).fields[field->name] = *field;
    return INSITU_OK;
}

namespace
{

std::string make_block_name(const char *mesh, int64_t number)
{
    return std::string(mesh) + "[" + std::to_string(number) + "]";
}

} // namespace

insitu_status insitu_set_block(insitu_session *session, const char *mesh, int64_t number, const insitu_mesh *block)
{
    session->meshes.erase(mesh);
    return insitu_set_mesh(session, make_block_name(mesh, number).c_str(), block);
}

insitu_status insitu_set_block_field(insitu_session *session, const char *mesh, int64_t number,
                                     const insitu_field *field)
{
    return insitu_set_field(session, make_block_name(mesh, number).c_str(), field);
}

const char *insitu_error(const insitu_session *)
{
    return "stub";
}
