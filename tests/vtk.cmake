# The VTK adaptor against a session that records, and insitu-render on files.
find_package(VTK 9.1 REQUIRED
  COMPONENTS CommonCore CommonDataModel CommonExecutionModel FiltersExtraction IOLegacy IOXML)

add_executable(test_vtk_adaptor test_vtk_adaptor.cpp test_vtk_session_stub.cpp)
target_link_libraries(test_vtk_adaptor PRIVATE insitu_vtk_objects PkgConfig::CMOCKA insitu_flags)
add_test(NAME vtk_adaptor COMMAND test_vtk_adaptor)
set_tests_properties(vtk_adaptor PROPERTIES TIMEOUT 30)

add_executable(test_vtk_deal test_vtk_deal.cpp ${PROJECT_SOURCE_DIR}/tools/cell_deal.cpp)
target_include_directories(test_vtk_deal PRIVATE ${PROJECT_SOURCE_DIR}/tools)
target_link_libraries(test_vtk_deal PRIVATE insitu_flags PkgConfig::CMOCKA VTK::CommonDataModel VTK::FiltersExtraction)
add_test(NAME vtk_deal COMMAND test_vtk_deal)
set_tests_properties(vtk_deal PROPERTIES TIMEOUT 60)
