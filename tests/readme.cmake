# The README's program is a file of examples/, built and run as a user would.
add_executable(six_calls ${PROJECT_SOURCE_DIR}/examples/six_calls.c)
target_link_libraries(six_calls PRIVATE insitu insitu_flags m)

add_test(NAME readme_shows_the_files
  COMMAND ${CMAKE_COMMAND} -DROOT=${PROJECT_SOURCE_DIR} -P ${CMAKE_CURRENT_SOURCE_DIR}/readme_snippets.cmake)
add_test(NAME readme_program_draws_on_2_ranks
  COMMAND ${CMAKE_COMMAND} -DPROGRAM=$<TARGET_FILE:six_calls> -DSCENE=${PROJECT_SOURCE_DIR}/examples/six_calls.yaml
    -DFOLDER=${CMAKE_CURRENT_BINARY_DIR}/readme "-DMPIRUN=${MPIEXEC_EXECUTABLE};${MPIEXEC_NUMPROC_FLAG}"
    -P ${CMAKE_CURRENT_SOURCE_DIR}/readme_run.cmake)
set_tests_properties(readme_program_draws_on_2_ranks PROPERTIES
  ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}" TIMEOUT 120 FIXTURES_SETUP readme)
