# Rules for the whole tree, and tests that these tests can fail.
add_test(NAME house_arrows_go_down COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/house_includes.sh ${PROJECT_SOURCE_DIR})
list(TRANSFORM MPI_C_INCLUDE_DIRS PREPEND -I OUTPUT_VARIABLE house_mpi)
add_test(NAME house_headers_compile_alone
  COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/house_headers.sh ${PROJECT_SOURCE_DIR} ${CMAKE_C_COMPILER} ${house_mpi}
  ${CYAML_CFLAGS} ${YAML_CFLAGS})
set_tests_properties(house_headers_compile_alone PROPERTIES TIMEOUT 180)
add_test(NAME house_library_shows_insitu_only
  COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/house_library.sh $<TARGET_FILE:insitu>)
add_test(NAME house_kernels_show_their_table_only
  COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/house_kernels.sh ${INSITU_KERNEL_OBJECTS}
  ${INSITU_SHEET_OBJECTS} ${INSITU_LANE_OBJECTS} COMMAND_EXPAND_LISTS)
set_tests_properties(house_kernels_show_their_table_only PROPERTIES SKIP_RETURN_CODE 77)
add_test(NAME house_tests_can_fail
  COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/house_seeded.sh ${PROJECT_SOURCE_DIR} ${CMAKE_C_COMPILER})
set_tests_properties(
  house_arrows_go_down house_library_shows_insitu_only house_kernels_show_their_table_only house_tests_can_fail
  PROPERTIES TIMEOUT 180)
add_test(NAME house_figures_are_held
  COMMAND python3 ${CMAKE_CURRENT_SOURCE_DIR}/house_figures.py --hold ${PROJECT_SOURCE_DIR})
add_test(NAME house_regions_are_entered COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/house_regions.sh ${PROJECT_SOURCE_DIR})
add_test(NAME house_hard_cases_are_tested COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/house_hard_cases.sh ${PROJECT_SOURCE_DIR})

# ./test itself, with stubs of what it calls.
add_test(NAME test_command COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/test_command.sh ${PROJECT_SOURCE_DIR}
  ${CMAKE_CURRENT_BINARY_DIR}/test_command)
set_tests_properties(test_command PROPERTIES TIMEOUT 60)
