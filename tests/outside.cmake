# A user's view: install into a prefix of its own, then build and run an outside project against it.
# Leaks are looked for elsewhere: here MPI's own would be found in programs that do not know how to excuse them.
add_test(NAME outside_project_builds_and_runs
  COMMAND ${CMAKE_COMMAND} -DBUILD=${PROJECT_BINARY_DIR} -DSOURCE=${CMAKE_CURRENT_SOURCE_DIR}/outside
    -DFOLDER=${CMAKE_CURRENT_BINARY_DIR}/outside -DLIBDIR=${CMAKE_INSTALL_LIBDIR} -DWITH_VTK=$<TARGET_EXISTS:insitu_vtk>
    "-DFLAGS=$<$<BOOL:${CMAKE_PROJECT_INCLUDE}>:-fsanitize=address,undefined>"
    -DCC=${CMAKE_C_COMPILER} -DCXX=${CMAKE_CXX_COMPILER} -DGENERATOR=${CMAKE_GENERATOR} -DMPICC=${MPI_C_COMPILER}
    -DPYTHON=${INSITU_TEST_PYTHON} -DPYTHON_DIR=${INSITU_PYTHON_DIR}
    -DPKG_CONFIG=${PKG_CONFIG_EXECUTABLE} -P ${CMAKE_CURRENT_SOURCE_DIR}/outside_run.cmake)
set_tests_properties(outside_project_builds_and_runs PROPERTIES
  ENVIRONMENT "${INSITU_TEST_ENVIRONMENT};ASAN_OPTIONS=detect_leaks=0" TIMEOUT 180)
