# The VTK adaptor against a session that records, and insitu-render on files.
find_package(VTK 9.1 REQUIRED
  COMPONENTS CommonCore CommonDataModel CommonExecutionModel IOLegacy IOParallel IOXML cgns)

add_executable(test_vtk_adaptor test_vtk_adaptor.cpp test_vtk_session_stub.cpp)
target_link_libraries(test_vtk_adaptor PRIVATE insitu_vtk_objects PkgConfig::CMOCKA insitu_quick_flags)
add_test(NAME vtk_adaptor COMMAND test_vtk_adaptor)
set_tests_properties(vtk_adaptor PROPERTIES TIMEOUT 30)

add_executable(test_vtk_amr test_vtk_amr.cpp test_vtk_session_stub.cpp)
target_link_libraries(test_vtk_amr PRIVATE insitu_vtk_objects PkgConfig::CMOCKA insitu_quick_flags)
add_test(NAME vtk_amr COMMAND test_vtk_amr)
set_tests_properties(vtk_amr PROPERTIES TIMEOUT 30)

add_executable(test_vtk_deal test_vtk_deal.cpp)
target_link_libraries(test_vtk_deal PRIVATE insitu_render_files insitu_quick_flags PkgConfig::CMOCKA)
add_test(NAME vtk_deal COMMAND test_vtk_deal)
set_tests_properties(vtk_deal PROPERTIES TIMEOUT 60)

# Places of nodes of higher order, by VTK's own cells.
add_executable(test_order_nodes test_order_nodes.cpp)
target_link_libraries(test_order_nodes PRIVATE insitu_quick_flags insitu_internal VTK::CommonDataModel PkgConfig::CMOCKA)
add_test(NAME order_nodes COMMAND test_order_nodes)
set_tests_properties(order_nodes PROPERTIES TIMEOUT 60)

add_library(test_vtk_run STATIC test_vtk_run.cpp)
target_link_libraries(test_vtk_run PRIVATE insitu_quick_flags)

# Files of every format, written by VTK's own writers where it has one.
add_library(test_vtk_samples STATIC test_vtk_samples.cpp)
target_link_libraries(test_vtk_samples PUBLIC test_vtk_run VTK::CommonDataModel PRIVATE insitu_quick_flags VTK::IOParallel VTK::IOLegacy VTK::IOXML VTK::cgns)

add_executable(test_vtk_files test_vtk_files.cpp)
target_link_libraries(test_vtk_files PRIVATE test_vtk_samples insitu_render_files insitu_quick_flags PkgConfig::CMOCKA VTK::IOXML)
add_test(NAME vtk_files COMMAND test_vtk_files)
insitu_add_long_test(vtk_files_cut_often test_vtk_files 2000)

# Element types of Exodus files, and VTK's HDF files, where this VTK reads them.
find_package(VTK 9.1 QUIET OPTIONAL_COMPONENTS exodusII hdf5)
if(TARGET VTK::exodusII)
  add_executable(test_vtk_exodus test_vtk_exodus.cpp)
  target_link_libraries(test_vtk_exodus PRIVATE test_vtk_run insitu_render_files insitu_quick_flags PkgConfig::CMOCKA VTK::exodusII)
  add_test(NAME vtk_exodus COMMAND test_vtk_exodus)
  set_tests_properties(vtk_exodus PROPERTIES TIMEOUT 60)
endif()

if(TARGET VTK::hdf5)
  add_executable(test_vtk_hdf test_vtk_hdf.cpp)
  target_link_libraries(test_vtk_hdf PRIVATE test_vtk_run insitu_render_files insitu_quick_flags PkgConfig::CMOCKA VTK::hdf5)
  add_test(NAME vtk_hdf COMMAND test_vtk_hdf)
  set_tests_properties(vtk_hdf PROPERTIES TIMEOUT 60)
endif()

# A copy of insitu-render whose pictures are plain numbers: it finds the libraries of the build by links, and the image
# library beside them.
set(plain ${CMAKE_CURRENT_BINARY_DIR}/plain)
add_library(plain_image MODULE plain_image.c)
target_link_libraries(plain_image PRIVATE insitu_quick_flags insitu_headers)
set_target_properties(plain_image PROPERTIES PREFIX lib OUTPUT_NAME insitu_image LIBRARY_OUTPUT_DIRECTORY ${plain}/lib)
add_custom_command(OUTPUT ${plain}/bin/insitu-render
  COMMAND ${CMAKE_COMMAND} -E copy $<TARGET_FILE:insitu-render> ${plain}/bin/insitu-render
  COMMAND ${CMAKE_COMMAND} -E create_symlink $<TARGET_FILE:insitu> ${plain}/lib/$<TARGET_SONAME_FILE_NAME:insitu>
  COMMAND ${CMAKE_COMMAND} -E create_symlink $<TARGET_FILE:insitu_vtk> ${plain}/lib/$<TARGET_SONAME_FILE_NAME:insitu_vtk>
  DEPENDS insitu-render VERBATIM)
add_custom_target(plain_render ALL DEPENDS ${plain}/bin/insitu-render plain_image)

add_executable(test_vtk_formats test_vtk_formats.cpp)
target_link_libraries(test_vtk_formats PRIVATE test_vtk_samples insitu_quick_flags PkgConfig::CMOCKA VTK::IOXML)
add_test(NAME vtk_formats COMMAND test_vtk_formats ${plain}/bin/insitu-render ${MPIEXEC_EXECUTABLE})
insitu_add_long_test(vtk_formats_cut_often
  test_vtk_formats ${plain}/bin/insitu-render ${MPIEXEC_EXECUTABLE} 50 90 95 99)
# One program after the other, most of whose time is to be loaded, on one core: others run beside.
set_tests_properties(vtk_formats vtk_formats_cut_often PROPERTIES
  ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}" TIMEOUT 300)

add_executable(test_vtk_structured test_vtk_structured.cpp)
target_link_libraries(test_vtk_structured PRIVATE test_vtk_run insitu_render_files insitu_quick_flags PkgConfig::CMOCKA VTK::IOXML)
insitu_add_split_test(vtk_structured $<TARGET_FILE:test_vtk_structured> ${plain}/bin/insitu-render ${MPIEXEC_EXECUTABLE})
set_tests_properties(vtk_structured vtk_structured_whole PROPERTIES ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}")
set_tests_properties(vtk_structured PROPERTIES TIMEOUT 300)

add_executable(test_vtk_tool test_vtk_tool.cpp)
target_link_libraries(test_vtk_tool PRIVATE test_vtk_run insitu_quick_flags PkgConfig::CMOCKA VTK::IOLegacy VTK::IOXML)
insitu_add_split_test(vtk_tool $<TARGET_FILE:test_vtk_tool> $<TARGET_FILE:insitu-render> ${plain}/bin/insitu-render
  ${MPIEXEC_EXECUTABLE})

add_executable(test_vtk_images test_vtk_images.cpp)
target_link_libraries(test_vtk_images PRIVATE test_vtk_run insitu_quick_flags PkgConfig::CMOCKA)
insitu_add_split_test(vtk_images $<TARGET_FILE:test_vtk_images> ${plain}/bin/insitu-render ${MPIEXEC_EXECUTABLE})

# Every type of cell of higher order.
add_executable(test_vtk_order test_vtk_order.cpp)
target_link_libraries(test_vtk_order PRIVATE test_vtk_run insitu_quick_flags PkgConfig::CMOCKA VTK::CommonDataModel VTK::IOLegacy VTK::IOXML)
add_test(NAME vtk_order COMMAND test_vtk_order ${plain}/bin/insitu-render)
set_tests_properties(vtk_order PROPERTIES ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}" TIMEOUT 120)

add_executable(test_vtk_default test_vtk_default.cpp)
target_include_directories(test_vtk_default SYSTEM PRIVATE ${OPENIMAGEIO_INCLUDE_DIR})
target_link_libraries(test_vtk_default PRIVATE test_vtk_run
  insitu_quick_flags PkgConfig::CMOCKA VTK::IOXML ${OPENIMAGEIO_LIBRARY} ${OPENIMAGEIO_UTIL_LIBRARY})
add_test(NAME vtk_default COMMAND test_vtk_default $<TARGET_FILE:insitu-render> ${MPIEXEC_EXECUTABLE})

# Real grids as the renderer's tests have their meshes. The C headers are not C++'s style, hence SYSTEM.
add_library(test_data_mesh STATIC test_data_mesh.cpp test_vtk_session_stub.cpp)
target_include_directories(test_data_mesh SYSTEM PRIVATE ${PROJECT_SOURCE_DIR}/libinsitu/base)
target_link_libraries(test_data_mesh PRIVATE insitu_vtk_objects insitu_quick_flags VTK::IOXML)

foreach(noun volumes polyhedra)
  add_executable(test_data_${noun} test_data_${noun}.c)
  target_link_libraries(test_data_${noun} PRIVATE test_data_mesh test_render_support insitu_quick_flags)
  insitu_add_split_test(data_${noun} $<TARGET_FILE:test_data_${noun}>)
  set_tests_properties(data_${noun} PROPERTIES TIMEOUT 300)
  set_tests_properties(data_${noun} data_${noun}_whole PROPERTIES
    ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}" SKIP_RETURN_CODE 77)
endforeach()
target_link_libraries(test_data_polyhedra PRIVATE test_own_tets)

set_tests_properties(vtk_tool_whole vtk_images_whole PROPERTIES ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}" SKIP_RETURN_CODE 77)
set_tests_properties(vtk_tool vtk_images vtk_default PROPERTIES
  ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}" TIMEOUT 300 SKIP_RETURN_CODE 77)

# The manual page names the options of --help, and is well formed.
add_test(NAME manual_page COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/manual_page.sh $<TARGET_FILE:insitu-render>
  ${PROJECT_SOURCE_DIR}/docs/insitu-render.1)
set_tests_properties(manual_page PROPERTIES ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}")

# Real grids with all nodes of their cells.
add_library(test_data_cells STATIC test_data_cells.cpp)
target_link_libraries(test_data_cells PRIVATE insitu_quick_flags VTK::IOXML)

# Every scene of the gallery is drawn, where its grids are to be had.
add_test(NAME gallery COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/gallery.sh $<TARGET_FILE:insitu-render>
  ${PROJECT_SOURCE_DIR}/docs/gallery ${CMAKE_CURRENT_BINARY_DIR}/gallery)
set_tests_properties(gallery PROPERTIES ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}" TIMEOUT 120 SKIP_RETURN_CODE 77)

# Derived fields beside VTK's gradient filter.
find_package(VTK 9.1 REQUIRED COMPONENTS CommonCore CommonDataModel CommonExecutionModel FiltersGeneral)
add_executable(test_derived_accuracy test_derived_accuracy.c test_derived_vtk.cpp)
target_link_libraries(test_derived_accuracy PRIVATE insitu_flags test_meshes insitu_internal PkgConfig::CMOCKA VTK::CommonCore
  VTK::CommonDataModel VTK::CommonExecutionModel VTK::FiltersGeneral)
insitu_add_split_test(derived_accuracy $<TARGET_FILE:test_derived_accuracy>)
set_tests_properties(derived_accuracy PROPERTIES TIMEOUT 60)

# Contour lines beside VTK's.
find_package(VTK 9.1 REQUIRED COMPONENTS CommonCore CommonDataModel CommonExecutionModel FiltersCore)
add_executable(test_contour_points test_contour_points.c test_contour_vtk.cpp)
target_link_libraries(test_contour_points PRIVATE test_render_support insitu_quick_flags VTK::CommonCore
  VTK::CommonDataModel VTK::CommonExecutionModel VTK::FiltersCore)
add_test(NAME contour_points COMMAND test_contour_points)
set_tests_properties(contour_points PROPERTIES TIMEOUT 60)
