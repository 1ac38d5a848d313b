# Sessions: on any ranks, right and wrong input. Pictures are caught by the fixture; test_api writes them.
function(insitu_session_program target)
  add_executable(${target} ${target}.c test_session_fixture.c test_meshes.c)
  target_link_libraries(${target} PRIVATE insitu_flags insitu_internal PkgConfig::CMOCKA)
endfunction()

insitu_session_program(test_session_input)
insitu_add_mpi_test(session_input test_session_input 1 2 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_recentre)
insitu_add_mpi_test(session_recentre test_session_recentre 1 2 3 4 7 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})
