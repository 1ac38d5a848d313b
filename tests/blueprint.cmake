# The adaptors for Conduit's Mesh Blueprint and for Catalyst, on a stand-in of the functions that they call.
add_library(test_blueprint_fixture OBJECT conduit_stand_in.c test_blueprint_door.c test_blueprint_layouts.c)
target_link_libraries(test_blueprint_fixture PUBLIC test_session_fixture PRIVATE insitu_blueprint_objects insitu_quick_flags)

foreach(test blueprint blueprint_faults blueprint_levels)
  add_executable(test_${test} test_${test}.c)
  target_link_libraries(test_${test} PRIVATE
    insitu_blueprint_objects test_blueprint_fixture test_session_fixture insitu_quick_flags)
  insitu_add_mpi_test(${test} test_${test} 1 2 WHOLE 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})
endforeach()

add_executable(test_catalyst test_catalyst.c)
target_link_libraries(test_catalyst PRIVATE
  insitu_catalyst_objects insitu_blueprint_objects test_blueprint_fixture test_session_fixture insitu_quick_flags)
insitu_add_mpi_test(catalyst test_catalyst 1 2 WHOLE 3 TIMEOUT 60 ARGS ${CMAKE_CURRENT_BINARY_DIR})
