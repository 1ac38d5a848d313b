# The renderer against brute force in double, against itself, on every instruction set and on ranks.
add_library(test_meshes STATIC test_meshes.c)
target_include_directories(test_meshes PUBLIC . ${PROJECT_SOURCE_DIR}/libinsitu/base)
target_link_libraries(test_meshes PUBLIC m PRIVATE insitu_flags)

add_library(test_render_support STATIC
  reference_cell.c reference_polyhedron.c reference_render.c test_render_fixture.c)
target_link_libraries(test_render_support
  PUBLIC test_meshes insitu_internal PkgConfig::CMOCKA PRIVATE insitu_flags)

function(insitu_render_program name)
  add_executable(${name} ${name}.c)
  target_link_libraries(${name} PRIVATE test_render_support insitu_flags)
endfunction()

insitu_render_program(test_reference)
insitu_render_program(test_render)
add_test(NAME reference COMMAND test_reference)
set_tests_properties(reference PROPERTIES TIMEOUT 60)

# One run an instruction set; where the machine lacks one the next lower runs.
foreach(isa plain sse4.2 avx2 avx512)
  add_test(NAME render_${isa} COMMAND test_render)
  set_tests_properties(render_${isa} PROPERTIES ENVIRONMENT "INSITU_ISA=${isa}" TIMEOUT 180)
endforeach()

insitu_render_program(test_render_invariance)
add_test(NAME render_invariance COMMAND test_render_invariance)
set_tests_properties(render_invariance PROPERTIES TIMEOUT 120)

insitu_render_program(test_render_isa)
add_test(NAME render_isa COMMAND test_render_isa)
set_tests_properties(render_isa PROPERTIES TIMEOUT 120)

insitu_render_program(test_partition_mpi)
insitu_add_mpi_test(partition test_partition_mpi 1 2 3 4 7)

insitu_render_program(test_overlap_mpi)
insitu_add_mpi_test(overlap test_overlap_mpi 1 2 3 4 7)

insitu_render_program(test_render_polyhedra)
add_test(NAME render_polyhedra COMMAND test_render_polyhedra)
set_tests_properties(render_polyhedra PROPERTIES TIMEOUT 120)
