# The room alone: its objects and the ground's.
add_executable(test_comp test_comp.c)
target_link_libraries(test_comp PRIVATE insitu_compositing insitu_base insitu_flags PkgConfig::CMOCKA OpenMP::OpenMP_C m)
add_test(NAME comp COMMAND test_comp)
set_tests_properties(comp PROPERTIES TIMEOUT 60)

add_executable(test_comp_mpi test_comp_mpi.c)
target_link_libraries(test_comp_mpi
  PRIVATE insitu_compositing insitu_base insitu_flags PkgConfig::CMOCKA OpenMP::OpenMP_C m)
insitu_add_mpi_test(comp_mpi test_comp_mpi 1 2 3 4 7)
