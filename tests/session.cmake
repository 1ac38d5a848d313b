# Sessions: on any ranks, right and wrong input. Pictures are caught by the fixture; test_api writes them. Daily all run on 1
# and 3 ranks or, if they are slow, on several alone, session and session_recentre on 2 too, and session_partition and
# invariance on 2 and 7, as compositing's own tests do; the others do so in the long tests.
add_library(test_session_fixture OBJECT test_session_fixture.c)
target_link_libraries(test_session_fixture PUBLIC test_meshes insitu_internal PkgConfig::CMOCKA PRIVATE insitu_quick_flags)
function(insitu_session_program target)
  add_executable(${target} ${target}.c)
  target_link_libraries(${target} PRIVATE insitu_quick_flags test_session_fixture)
endfunction()

insitu_session_program(test_session_input)
insitu_add_mpi_test(session_input test_session_input 1 3 WHOLE 2 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_types)
insitu_add_mpi_test(session_types test_session_types 1 3 WHOLE 2 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_faces)
insitu_add_mpi_test(session_faces test_session_faces 1 3 WHOLE 2 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_recentre)
insitu_add_mpi_test(session_recentre test_session_recentre 1 2 3 WHOLE 2 4 7 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_lattice)
insitu_add_mpi_test(session_lattice test_session_lattice 1 3 WHOLE 2 7 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_lattice_changes)
insitu_add_mpi_test(session_lattice_changes test_session_lattice_changes 1 3 WHOLE 2 TIMEOUT 120
  ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_blocks)
insitu_add_mpi_test(session_blocks test_session_blocks 1 3 WHOLE 2 5 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_levels)
insitu_add_mpi_test(session_levels test_session_levels 3 WHOLE 1 2 3 5 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_slices)
insitu_add_mpi_test(session_slices test_session_slices 1 3 WHOLE 2 4 7 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_surfaces)
insitu_add_mpi_test(session_surfaces test_session_surfaces 3 WHOLE 1 2 4 7 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_channels)
insitu_add_mpi_test(session_channels test_session_channels 1 3 WHOLE 2 7 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_deep)
insitu_add_mpi_test(session_deep test_session_deep 3 WHOLE 1 2 7 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

add_executable(test_deep_file test_deep_file.cpp)
add_dependencies(test_deep_file insitu_image)
target_include_directories(test_deep_file SYSTEM PRIVATE ${OPENIMAGEIO_INCLUDE_DIR})
target_link_libraries(test_deep_file PRIVATE
  insitu_quick_flags insitu ${OPENIMAGEIO_LIBRARY} ${OPENIMAGEIO_UTIL_LIBRARY} PkgConfig::CMOCKA)
insitu_add_mpi_test(deep_file test_deep_file 1 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

add_executable(test_homes test_homes.c)
target_link_libraries(test_homes PRIVATE insitu_quick_flags insitu_internal PkgConfig::CMOCKA)
add_test(NAME homes COMMAND test_homes)

add_executable(test_session_lanes test_session_lanes.c)
target_link_libraries(test_session_lanes PRIVATE insitu_quick_flags test_meshes insitu_internal PkgConfig::CMOCKA)
add_test(NAME session_lanes COMMAND test_session_lanes)
add_executable(test_cell_volumes test_cell_volumes.c)
target_link_libraries(test_cell_volumes PRIVATE insitu_quick_flags test_meshes insitu_internal PkgConfig::CMOCKA)
add_test(NAME cell_volumes COMMAND test_cell_volumes)

# Ranks are not bound, so that all may run on all cores.
add_executable(test_session_cores test_session_cores.c)
target_link_libraries(test_session_cores PRIVATE insitu_quick_flags insitu_internal PkgConfig::CMOCKA OpenMP::OpenMP_C)
insitu_add_mpi_test(session_cores test_session_cores 1 2 3)
add_test(NAME session_cores_bound_by_openmp COMMAND ${CMAKE_COMMAND} -E env OMP_PROC_BIND=true
  ${MPIEXEC_EXECUTABLE} ${MPIEXEC_NUMPROC_FLAG} 1 $<TARGET_FILE:test_session_cores>)
set_tests_properties(session_cores_bound_by_openmp PROPERTIES ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}")

insitu_session_program(test_session_collectives)
insitu_add_mpi_test(session_collectives test_session_collectives 2 5 ARGS ${CMAKE_CURRENT_BINARY_DIR})
insitu_session_program(test_session_many)
insitu_add_mpi_test(session_many test_session_many 2 WHOLE 1 ARGS ${CMAKE_CURRENT_BINARY_DIR})
insitu_session_program(test_session_turns)
insitu_add_mpi_test(session_turns test_session_turns 1 3 WHOLE 8 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_smooth)
insitu_add_mpi_test(session_smooth test_session_smooth 2 WHOLE 1 3 7 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_derived)
insitu_add_mpi_test(session_derived test_session_derived 1 3 WHOLE 2 7 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_light)
insitu_add_mpi_test(session_light test_session_light 3 WHOLE 1 2 3 7 TIMEOUT 240 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_outline)
insitu_add_mpi_test(session_outline test_session_outline 1 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_concave)
insitu_add_mpi_test(session_concave test_session_concave 3 WHOLE 1 2 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})
insitu_session_program(test_session_hanging)
insitu_add_mpi_test(session_hanging test_session_hanging 3 WHOLE 1 2 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})
insitu_session_program(test_session_shells)
insitu_add_mpi_test(session_shells test_session_shells 1 3 WHOLE 2 7 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_montage)
insitu_add_mpi_test(session_montage test_session_montage 1 3 WHOLE 2 ARGS ${CMAKE_CURRENT_BINARY_DIR})
insitu_session_program(test_session_lines)
insitu_add_mpi_test(session_lines test_session_lines 1 3 WHOLE 2 7 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})
insitu_session_program(test_session_plane)
insitu_add_mpi_test(session_plane test_session_plane 1 3 WHOLE 2 7 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_clips)
insitu_add_mpi_test(session_clips test_session_clips 2 WHOLE 1 3 7 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_index_base)
insitu_add_mpi_test(session_index_base test_session_index_base 1 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

foreach(name indexed cell_order vertex_order corners filled writer)
  insitu_session_program(test_session_${name})
  insitu_add_mpi_test(session_${name} test_session_${name} 2 WHOLE 1 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})
endforeach()

# Cells of higher order.
add_executable(test_order_pieces test_order_pieces.c test_mesh_order.c)
target_link_libraries(test_order_pieces PRIVATE insitu_quick_flags test_meshes insitu_internal PkgConfig::CMOCKA)
add_test(NAME order_pieces COMMAND test_order_pieces)
set_tests_properties(order_pieces PROPERTIES TIMEOUT 60)
add_executable(test_order_derivatives test_order_derivatives.c test_mesh_order.c)
target_link_libraries(test_order_derivatives PRIVATE insitu_quick_flags insitu_internal PkgConfig::CMOCKA)
add_test(NAME order_derivatives COMMAND test_order_derivatives)
set_tests_properties(order_derivatives PROPERTIES TIMEOUT 60)
add_executable(test_order_interpolation test_order_interpolation.c test_mesh_order.c)
target_link_libraries(test_order_interpolation PRIVATE insitu_quick_flags insitu_internal PkgConfig::CMOCKA)
add_test(NAME order_interpolation COMMAND test_order_interpolation)
set_tests_properties(order_interpolation PROPERTIES TIMEOUT 60)
add_executable(test_order_integrals test_order_integrals.c test_mesh_order.c)
target_link_libraries(test_order_integrals PRIVATE insitu_quick_flags insitu_internal PkgConfig::CMOCKA)
add_test(NAME order_integrals COMMAND test_order_integrals)
set_tests_properties(order_integrals PROPERTIES TIMEOUT 60)
add_executable(test_order_bound test_order_bound.c test_mesh_order.c)
target_link_libraries(test_order_bound PRIVATE insitu_quick_flags insitu_internal PkgConfig::CMOCKA)
insitu_add_split_test(order_bound $<TARGET_FILE:test_order_bound>)
foreach(name order order_cells order_normals order_faults order_finer order_error order_lobatto order_volumes)
  insitu_session_program(test_session_${name})
  target_sources(test_session_${name} PRIVATE test_mesh_order.c)
  insitu_add_mpi_test(session_${name} test_session_${name} 2 WHOLE 1 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})
endforeach()
insitu_session_program(test_session_order_statistics)
target_sources(test_session_order_statistics PRIVATE test_mesh_order.c)
insitu_add_mpi_test(session_order_statistics test_session_order_statistics 2 WHOLE 1 3 5 TIMEOUT 120
  ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_order_partition)
target_sources(test_session_order_partition PRIVATE test_mesh_order.c)
insitu_add_mpi_test(session_order_partition test_session_order_partition 3 WHOLE 1 2 3 7 64 TIMEOUT 120
  ARGS ${CMAKE_CURRENT_BINARY_DIR})

if(INSITU_VTK) # reads a real grid
  insitu_session_program(test_session_order_pictures)
  target_sources(test_session_order_pictures PRIVATE test_mesh_order.c)
  target_link_libraries(test_session_order_pictures PRIVATE test_data_cells)
  insitu_add_mpi_test(session_order_pictures test_session_order_pictures 2 WHOLE 1 3 7 TIMEOUT 240
    ARGS ${CMAKE_CURRENT_BINARY_DIR})
endif()

# Faces by owner and neighbour.
foreach(name owner owner_faults patches patch_faults)
  insitu_session_program(test_session_${name})
  target_sources(test_session_${name} PRIVATE test_owned_faces.c)
  insitu_add_mpi_test(session_${name} test_session_${name} 1 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})
endforeach()
insitu_add_mpi_test(session_patches test_session_patches 2 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

# Meshes in all forms, wrong ones.
foreach(name zero_counts strides wrong_input)
  insitu_session_program(test_session_${name})
  target_sources(test_session_${name} PRIVATE test_mesh_forms.c test_owned_faces.c)
  insitu_add_mpi_test(session_${name} test_session_${name} 1 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})
endforeach()
insitu_add_mpi_test(session_wrong_input test_session_wrong_input WHOLE 1 3 ARGS ${CMAKE_CURRENT_BINARY_DIR})
foreach(name zero_counts strides)
  insitu_add_mpi_test(session_${name} test_session_${name} WHOLE 3 ARGS ${CMAKE_CURRENT_BINARY_DIR})
endforeach()

# Meshes that the scene warps or mirrors, of all forms.
foreach(name warp mirror)
  insitu_session_program(test_session_${name})
  target_sources(test_session_${name} PRIVATE test_transformed.c test_mesh_forms.c test_owned_faces.c test_mesh_order.c)
  insitu_add_mpi_test(session_${name} test_session_${name} 3 WHOLE 1 2 3 7 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})
endforeach()

insitu_session_program(test_session_statistics)
insitu_add_mpi_test(session_statistics test_session_statistics 1 3 WHOLE 2 7 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_cinema)
insitu_add_mpi_test(session_cinema test_session_cinema 1 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

# The databases' page in a browser, by Debian's python3, whose selenium is in no other interpreter.
find_program(INSITU_SYSTEM_PYTHON python3 PATHS /usr/bin NO_DEFAULT_PATH)
if(INSITU_SYSTEM_PYTHON)
  add_test(NAME session_cinema_page COMMAND ${INSITU_SYSTEM_PYTHON} ${CMAKE_CURRENT_SOURCE_DIR}/test_cinema_page.py
    $<TARGET_FILE:six_calls> ${CMAKE_CURRENT_BINARY_DIR}/cinema_page)
  set_tests_properties(session_cinema_page PROPERTIES
    ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}" TIMEOUT 240 SKIP_RETURN_CODE 77)
  # insitu-view: its server without a browser, and its page beside a running mini-app.
  set(insitu_view ${CMAKE_RUNTIME_OUTPUT_DIRECTORY}/insitu-view)
  add_test(NAME view_server COMMAND ${INSITU_SYSTEM_PYTHON} ${CMAKE_CURRENT_SOURCE_DIR}/test_view_server.py
    ${insitu_view} ${CMAKE_CURRENT_BINARY_DIR}/view_server)
  set_tests_properties(view_server PROPERTIES TIMEOUT 120)
  add_test(NAME view_page COMMAND ${INSITU_SYSTEM_PYTHON} ${CMAKE_CURRENT_SOURCE_DIR}/test_view_page.py
    ${insitu_view} $<TARGET_FILE:insitu-wave> ${CMAKE_CURRENT_BINARY_DIR}/view_page)
  set_tests_properties(view_page PROPERTIES
    ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}" TIMEOUT 240 SKIP_RETURN_CODE 77)
else()
  foreach(test session_cinema_page view_server view_page)
    add_test(NAME ${test} COMMAND ${CMAKE_COMMAND} -E echo "skipped: no /usr/bin/python3")
    set_tests_properties(${test} PROPERTIES SKIP_REGULAR_EXPRESSION "^skipped")
  endforeach()
endif()

insitu_session_program(test_session_thresholds)
insitu_add_mpi_test(session_thresholds test_session_thresholds 1 3 WHOLE 2 7 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_edges)
insitu_add_mpi_test(session_edges test_session_edges 3 WHOLE 1 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_antialias)
insitu_add_mpi_test(session_antialias test_session_antialias 1 3 WHOLE 2 7 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_space)
insitu_add_mpi_test(session_space test_session_space 1 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_invariance)
insitu_add_mpi_test(invariance test_invariance 2 7 WHOLE 1 2 3 5 7 16 64 TIMEOUT 240 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_partition)
target_sources(test_session_partition PRIVATE test_mesh_honeycomb.c)
insitu_add_mpi_test(session_partition test_session_partition 1 2 3 7 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})
foreach(ranks 16 64)
  insitu_add_long_test(session_partition_np${ranks}
    ${MPIEXEC_EXECUTABLE} ${MPIEXEC_NUMPROC_FLAG} ${ranks} $<TARGET_FILE:test_session_partition>
    ${CMAKE_CURRENT_BINARY_DIR})
  set_tests_properties(session_partition_np${ranks} PROPERTIES ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}")
endforeach()

insitu_session_program(test_session_left_out)
insitu_add_mpi_test(session_left_out test_session_left_out 1 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session)
insitu_add_mpi_test(session test_session 1 2 WHOLE 2 3 4 7 TIMEOUT 180 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_regions)
insitu_add_mpi_test(session_regions test_session_regions 1 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_files)
insitu_add_mpi_test(session_files test_session_files 1 2 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_overwrites)
insitu_add_mpi_test(session_overwrites test_session_overwrites 1 2 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_narrow)
insitu_add_mpi_test(session_narrow test_session_narrow 1 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_colour)
insitu_add_mpi_test(session_colour test_session_colour 1 3 WHOLE 2 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_messages)
insitu_add_mpi_test(session_messages test_session_messages 1 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_candidates)
insitu_add_mpi_test(session_candidates test_session_candidates 2 WHOLE 1 3 TIMEOUT 180 ARGS ${CMAKE_CURRENT_BINARY_DIR})


insitu_session_program(test_session_changes)
insitu_add_mpi_test(session_changes test_session_changes 1 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

# The process around a session: few threads, small teams, traps.
insitu_session_program(test_session_host)
target_link_libraries(test_session_host PRIVATE ${CMAKE_DL_LIBS} OpenMP::OpenMP_C)
insitu_add_mpi_test(session_host test_session_host 1 2 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

insitu_session_program(test_session_isa)
insitu_add_mpi_test(session_isa test_session_isa 3 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

# Stacks: of the widest kernels here, of the others in the long run. Those of one process are measured, on one rank
# whatever ranks others run on. The address sanitizer has its own, larger frames.
insitu_session_program(test_session_stack)
target_link_libraries(test_session_stack PRIVATE OpenMP::OpenMP_C)
if(NOT CMAKE_PROJECT_INCLUDE)
  # Each has a folder of its own, as they run at once and name their scene files by the program.
  foreach(name IN ITEMS session_stack session_told_stacks session_small_stacks session_stack_plain session_stack_sse4.2
      session_stack_avx2)
    file(MAKE_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/${name})
  endforeach()
  insitu_rank_command(stack_command 1 test_session_stack)
  add_test(NAME session_stack_np1 COMMAND ${stack_command} ${CMAKE_CURRENT_BINARY_DIR}/session_stack)
  add_test(NAME session_told_stacks_np1 COMMAND ${stack_command} ${CMAKE_CURRENT_BINARY_DIR}/session_told_stacks)
  set_tests_properties(session_stack_np1 PROPERTIES TIMEOUT 120 ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}")
  set_tests_properties(session_told_stacks_np1 PROPERTIES TIMEOUT 120
    ENVIRONMENT "${INSITU_TEST_ENVIRONMENT};OMP_STACKSIZE=280k;TOLD_STACKS=1")
  foreach(isa plain sse4.2 avx2)
    insitu_add_long_test(session_stack_${isa} ${CMAKE_COMMAND} -E env ${INSITU_TEST_ENVIRONMENT} INSITU_ISA=${isa}
      ${stack_command} ${CMAKE_CURRENT_BINARY_DIR}/session_stack_${isa})
  endforeach()
  insitu_add_mpi_test(session_small_stacks test_session_stack 1 2 TIMEOUT 120
    ARGS ${CMAKE_CURRENT_BINARY_DIR}/session_small_stacks ENVIRONMENT OMP_STACKSIZE=100k SMALL_STACKS=1)
endif()

add_executable(test_session_guard test_session_guard.c)
target_link_libraries(test_session_guard PRIVATE insitu_quick_flags insitu_internal PkgConfig::CMOCKA)
add_test(NAME session_guard COMMAND test_session_guard)

# Memory runs out: quickly at every 97th or 389th allocation, in the long tests at each.
insitu_session_program(test_step_memory)
target_sources(test_step_memory PRIVATE failing_heap_mpi.c)
target_link_libraries(test_step_memory PRIVATE test_failing_heap)
set_target_properties(test_step_memory PROPERTIES C_VISIBILITY_PRESET default)
insitu_add_mpi_test(step_memory test_step_memory 1 2 TIMEOUT 300 ARGS ${CMAKE_CURRENT_BINARY_DIR})
foreach(ranks 1 2)
  insitu_add_long_test(step_memory_long_np${ranks} ${MPIEXEC_EXECUTABLE} ${MPIEXEC_NUMPROC_FLAG} ${ranks}
    $<TARGET_FILE:test_step_memory> ${CMAKE_CURRENT_BINARY_DIR} 1)
  set_tests_properties(step_memory_long_np${ranks} PROPERTIES ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}")
endforeach()

# The shared library and the public header alone.
add_executable(test_api test_api.c)
target_link_libraries(test_api PRIVATE insitu_quick_flags insitu PkgConfig::CMOCKA)
add_dependencies(test_api insitu_image)
insitu_add_mpi_test(api test_api 1 3 WHOLE 2 TIMEOUT 120 ARGS ${CMAKE_CURRENT_BINARY_DIR})

# Each of its runs is a process of its own, without mpiexec.
add_executable(test_writer_end test_writer_end.c)
target_link_libraries(test_writer_end PRIVATE insitu_quick_flags insitu)
add_dependencies(test_writer_end insitu_image)
add_test(NAME writer_end COMMAND test_writer_end ${CMAKE_CURRENT_BINARY_DIR})
set_tests_properties(writer_end PROPERTIES ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}" TIMEOUT 120)

# An empty entry of LD_LIBRARY_PATH is the working directory. Files go to a folder of their own, as other runs of test_api
# may write theirs at the same time. By the shared library, and by a program that has its objects.
add_library(planted_image MODULE planted_image.c)
target_link_libraries(planted_image PRIVATE insitu_quick_flags insitu_headers)
set_target_properties(planted_image PROPERTIES
  PREFIX lib OUTPUT_NAME insitu_image LIBRARY_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/planted)
add_test(NAME image_library_is_not_of_the_working_directory
  COMMAND test_api ${CMAKE_CURRENT_BINARY_DIR}/planted WORKING_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/planted)
add_test(NAME image_library_of_programs_is_not_of_the_working_directory
  COMMAND test_image_output ${CMAKE_CURRENT_BINARY_DIR}/planted_output
  WORKING_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/planted)
set_tests_properties(image_library_is_not_of_the_working_directory
  image_library_of_programs_is_not_of_the_working_directory PROPERTIES
  ENVIRONMENT "${INSITU_TEST_ENVIRONMENT};LD_LIBRARY_PATH=:" TIMEOUT 120)
