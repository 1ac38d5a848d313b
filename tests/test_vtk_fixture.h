/* Sets up an adaptor on a session that only records its input. This header must be included after cmocka.h. */
#ifndef TEST_VTK_FIXTURE_H
#define TEST_VTK_FIXTURE_H

#include <string>

#include "insitu/vtk.h"
#include "test_vtk_session_stub.h"

struct fixture {
    insitu_session session;
    insitu_vtk_adaptor *adaptor = nullptr;
    insitu_vtk_report report{};

    fixture() { assert_int_equal(insitu_vtk_create(&session, &adaptor), INSITU_OK); }
    ~fixture() { insitu_vtk_destroy(&adaptor); }
    fixture(const fixture &) = delete;
    fixture &operator=(const fixture &) = delete;

    insitu_status set(vtkDataObject *data) { return insitu_vtk_set(adaptor, "m", data, &report); }
    const stub_mesh &mesh(const std::string &name = "m") { return session.meshes.at(name); }
};

#endif
