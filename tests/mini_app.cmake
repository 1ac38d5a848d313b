foreach(noun mesh wave ranks)
  add_executable(test_mini_app_${noun} test_mini_app_${noun}.c)
  target_link_libraries(test_mini_app_${noun} PRIVATE insitu_wave_core insitu_flags PkgConfig::CMOCKA)
endforeach()
add_test(NAME mini_app_mesh COMMAND test_mini_app_mesh)
set_tests_properties(mini_app_mesh PROPERTIES TIMEOUT 60)
insitu_add_mpi_test(mini_app_wave test_mini_app_wave 1 TIMEOUT 120)
insitu_add_mpi_test(mini_app_ranks test_mini_app_ranks 1 2 3 4 7 TIMEOUT 120)
add_test(NAME mini_app_command
  COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/test_mini_app_command.sh $<TARGET_FILE:insitu-wave>
    ${MPIEXEC_EXECUTABLE} ${MPIEXEC_NUMPROC_FLAG} 3)
set_tests_properties(mini_app_command PROPERTIES
  ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}" TIMEOUT 120)
