# The room alone: its objects and the ground's.
add_executable(test_comp test_comp.c)
target_link_libraries(test_comp
  PRIVATE insitu_compositing ${INSITU_SHEETS} insitu_base insitu_flags PkgConfig::CMOCKA OpenMP::OpenMP_C m)
add_test(NAME comp COMMAND test_comp)
set_tests_properties(comp PROPERTIES TIMEOUT 60)

add_executable(test_comp_wire test_comp_wire.c)
target_link_libraries(test_comp_wire
  PRIVATE insitu_compositing ${INSITU_SHEETS} insitu_base insitu_flags PkgConfig::CMOCKA OpenMP::OpenMP_C m)
add_test(NAME comp_wire COMMAND test_comp_wire)
set_tests_properties(comp_wire PROPERTIES TIMEOUT 60)

add_executable(test_fold test_fold.c)
target_link_libraries(test_fold
  PRIVATE insitu_compositing ${INSITU_SHEETS} insitu_base insitu_flags PkgConfig::CMOCKA OpenMP::OpenMP_C m)
add_test(NAME fold COMMAND test_fold)
set_tests_properties(fold PROPERTIES TIMEOUT 60)

add_executable(test_comp_mpi test_comp_mpi.c)
target_link_libraries(test_comp_mpi
  PRIVATE insitu_compositing ${INSITU_SHEETS} insitu_base insitu_flags PkgConfig::CMOCKA OpenMP::OpenMP_C m)
insitu_add_mpi_test(comp_mpi test_comp_mpi 1 2 7 WHOLE 3 5 7 16 TIMEOUT 300)

# As above, with threads that share the merging.
add_test(NAME comp_mpi_4_threads
  COMMAND ${MPIEXEC_EXECUTABLE} ${MPIEXEC_NUMPROC_FLAG} 2 $<TARGET_FILE:test_comp_mpi>)
set_tests_properties(comp_mpi_4_threads PROPERTIES
  ENVIRONMENT "${INSITU_TEST_ENVIRONMENT};OMP_NUM_THREADS=4;OMP_WAIT_POLICY=passive" TIMEOUT 120 PROCESSORS 2)
