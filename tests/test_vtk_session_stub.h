/* A session that only records its input, with which tests check what the VTK adaptor passes. */
#ifndef TEST_VTK_SESSION_STUB_H
#define TEST_VTK_SESSION_STUB_H

#include <map>
#include <string>

#include "insitu/insitu.h"

struct stub_mesh {
    insitu_mesh mesh;
    std::map<std::string, insitu_field> fields;
};

struct insitu_session {
    std::map<std::string, stub_mesh> meshes;     // by name; block 3 of mesh "m" has the name "m[3]"
    insitu_status next_mesh_status = INSITU_OK;  // what insitu_set_mesh() returns for a mesh
    insitu_status next_field_status = INSITU_OK; // what insitu_set_field() returns
};

#endif
