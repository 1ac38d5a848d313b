# The VTK adaptor against a session that records, and insitu-render on real files.
add_executable(test_vtk_adaptor test_vtk_adaptor.cpp test_vtk_session_stub.cpp)
target_link_libraries(test_vtk_adaptor PRIVATE insitu_vtk_objects PkgConfig::CMOCKA insitu_flags)
add_test(NAME vtk_adaptor COMMAND test_vtk_adaptor)
set_tests_properties(vtk_adaptor PROPERTIES TIMEOUT 30)
