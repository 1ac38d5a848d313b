/* See the header. The defaults are what the public header says they are. */
#include "test_vtk_session_stub.h"

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
        session->meshes.erase(name);
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

const char *insitu_error(const insitu_session *)
{
    return "stub";
}
