# Sessions: on any ranks, right and wrong input. Pictures are caught by the fixture; test_api writes them.
function(insitu_session_program target)
  add_executable(${target} ${target}.c test_session_fixture.c)
  target_link_libraries(${target} PRIVATE insitu_flags test_meshes insitu_internal PkgConfig::CMOCKA)
endfunction()

insitu_session_program(test_session_input)
insitu_add_mpi_test(session_input test_session_input 1 2 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_faces)
insitu_add_mpi_test(session_faces test_session_faces 1 2 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_recentre)
insitu_add_mpi_test(session_recentre test_session_recentre 1 2 3 4 7 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_space)
insitu_add_mpi_test(session_space test_session_space 1 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session)
insitu_add_mpi_test(session test_session 1 2 3 4 7 TIMEOUT 180 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_shown)
insitu_add_mpi_test(session_shown test_session_shown 1 3 TIMEOUT 180 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_kept)
insitu_add_mpi_test(session_kept test_session_kept 1 3 TIMEOUT 180 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_changes)
insitu_add_mpi_test(session_changes test_session_changes 1 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

add_executable(test_session_guard test_session_guard.c)
target_link_libraries(test_session_guard PRIVATE insitu_flags insitu_internal PkgConfig::CMOCKA)
add_test(NAME session_guard COMMAND test_session_guard)

# The shared library and the public header alone.
add_executable(test_api test_api.c)
target_link_libraries(test_api PRIVATE insitu_flags insitu PkgConfig::CMOCKA)
add_dependencies(test_api insitu_image)
insitu_add_mpi_test(api test_api 1 2 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})
