# A user's view: install into a prefix of its own, then build and run an outside project against it.
# Leaks are looked for elsewhere: here MPI's own would be found in programs that do not know how to excuse them.
add_test(NAME outside_project_builds_and_runs
  COMMAND ${CMAKE_COMMAND} -DBUILD=${PROJECT_BINARY_DIR} -DSOURCE=${CMAKE_CURRENT_SOURCE_DIR}/outside
    -DFOLDER=${CMAKE_CURRENT_BINARY_DIR}/outside -DLIBDIR=${CMAKE_INSTALL_LIBDIR} -DWITH_VTK=$<TARGET_EXISTS:insitu_vtk>
    -DWITH_FORTRAN=$<AND:$<TARGET_EXISTS:insitu_fortran>,$<NOT:$<BOOL:${CMAKE_PROJECT_INCLUDE}>>>
    "-DFLAGS=$<$<BOOL:${CMAKE_PROJECT_INCLUDE}>:-fsanitize=address,undefined>"
    -DCC=${CMAKE_C_COMPILER} -DCXX=${CMAKE_CXX_COMPILER} -DGENERATOR=${CMAKE_GENERATOR} -DMPICC=${MPI_C_COMPILER}
    -DPYTHON=${INSITU_TEST_PYTHON} -DPYTHON_DIR=${INSITU_PYTHON_DIR}
    -DPKG_CONFIG=${PKG_CONFIG_EXECUTABLE} -P ${CMAKE_CURRENT_SOURCE_DIR}/outside_run.cmake)
set_tests_properties(outside_project_builds_and_runs PROPERTIES
  ENVIRONMENT "${INSITU_TEST_ENVIRONMENT};ASAN_OPTIONS=detect_leaks=0" TIMEOUT 180)

# Without OpenImageIO the library is configured, in the long tests built, and draws into memory.
add_test(NAME library_without_image COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/without_image.sh ${PROJECT_SOURCE_DIR}
  ${CMAKE_CURRENT_BINARY_DIR}/without_image)
insitu_add_long_test(library_without_image_draws ${CMAKE_CURRENT_SOURCE_DIR}/without_image.sh ${PROJECT_SOURCE_DIR}
  ${CMAKE_CURRENT_BINARY_DIR}/without_image_built build)
set_tests_properties(library_without_image_draws PROPERTIES ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}")

# The library exports the functions that the headers declare, and nothing else.
set(insitu_headers_of ${PROJECT_SOURCE_DIR}/libinsitu/include/insitu)
add_test(NAME exported_symbols COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/exported_symbols.sh $<TARGET_FILE:insitu> libinsitu.so.0
  ${insitu_headers_of}/insitu.h ${insitu_headers_of}/status.h)
add_test(NAME exported_symbols_of_archive COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/exported_symbols.sh $<TARGET_FILE:insitu_static> -
  ${insitu_headers_of}/insitu.h ${insitu_headers_of}/status.h)
add_test(NAME exported_symbols_of_image COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/exported_symbols.sh $<TARGET_FILE:insitu_image>
  libinsitu_image.so ${insitu_headers_of}/image_output.h)
add_test(NAME exported_symbols_of_blueprint COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/exported_symbols.sh
  $<TARGET_FILE:insitu_blueprint> libinsitu_blueprint.so.0
  ${PROJECT_SOURCE_DIR}/adaptors/blueprint/include/insitu/blueprint.h)
if(TARGET insitu_vtk)
  add_test(NAME exported_symbols_of_vtk COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/exported_symbols.sh $<TARGET_FILE:insitu_vtk>
    libinsitu_vtk.so.0 ${PROJECT_SOURCE_DIR}/adaptors/vtk/include/insitu/vtk.h
    ${PROJECT_SOURCE_DIR}/adaptors/vtk/include/insitu/vtk_grids.h)
endif()

# Debian packages: made daily; in a bare Debian by the long tests, which takes root and a network.
add_test(NAME packages COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/packages.sh ${CMAKE_CPACK_COMMAND} ${PROJECT_BINARY_DIR}
  ${CMAKE_CURRENT_BINARY_DIR}/packages)
set_tests_properties(packages PROPERTIES TIMEOUT 180 SKIP_RETURN_CODE 77)
# The lines of docs/packaging.md, run as they stand: a build from the source, an installation, and programs linked to it.
insitu_add_long_test(packaging_by_the_letter ${CMAKE_CURRENT_SOURCE_DIR}/packaging_by_the_letter.sh ${PROJECT_SOURCE_DIR}
  ${CMAKE_CURRENT_BINARY_DIR}/by_the_letter)
insitu_add_long_test(packages_in_a_bare_debian ${CMAKE_CURRENT_SOURCE_DIR}/package_chroot.sh ${CMAKE_CPACK_COMMAND}
  ${PROJECT_BINARY_DIR} ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_BINARY_DIR}/bare)
set_tests_properties(packages_in_a_bare_debian PROPERTIES SKIP_RETURN_CODE 77)
