/* Reads real grids for the tests: converts a VTU file, read through the VTK adaptor, to a test_mesh. */
#ifndef TEST_DATA_MESH_H
#define TEST_DATA_MESH_H

#include "test_meshes.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Reads the file's cells as the adaptor passes them, and the named field, which must have one component at the
 * vertices. Returns false, with a message on stderr, if there is no such file or field. The caller frees the mesh with
 * test_mesh_free(). */
bool test_data_mesh(const char *path, const char *field, test_mesh *out);

#ifdef __cplusplus
}
#endif

#endif
