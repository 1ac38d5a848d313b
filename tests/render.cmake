# The renderer against brute force in double, against itself, on every instruction set and on ranks.
add_library(test_render_support STATIC test_render_fixture.c)
target_link_libraries(test_render_support PUBLIC test_truth PkgConfig::CMOCKA PRIVATE insitu_flags)

function(insitu_render_program name)
  add_executable(${name} ${name}.c)
  target_link_libraries(${name} PRIVATE test_render_support insitu_flags)
endfunction()

# Programs that compare with a truth draw by every instruction set themselves; of the others there is one run a set, which
# is skipped where the machine lacks it. insitu_add_set_tests(NAME TIMEOUT [split]): test_NAME so; split: in parts.
function(insitu_add_set_tests name timeout)
  foreach(isa plain sse4.2 avx2 avx512)
    if("split" IN_LIST ARGN)
      insitu_add_split_test(${name}_${isa} $<TARGET_FILE:test_${name}>)
      set_tests_properties(${name}_${isa}_whole PROPERTIES ENVIRONMENT "INSITU_ISA=${isa}" SKIP_RETURN_CODE 77)
    else()
      add_test(NAME ${name}_${isa} COMMAND test_${name})
    endif()
    set_tests_properties(${name}_${isa} PROPERTIES
      ENVIRONMENT "INSITU_ISA=${isa}" TIMEOUT ${timeout} SKIP_RETURN_CODE 77)
  endforeach()
endfunction()

insitu_render_program(test_reference)
insitu_render_program(test_render)
add_test(NAME reference COMMAND test_reference)
set_tests_properties(reference PROPERTIES TIMEOUT 60)

insitu_add_split_test(render $<TARGET_FILE:test_render>)
set_tests_properties(render PROPERTIES TIMEOUT 180)

insitu_render_program(test_colour_scales)
insitu_add_split_test(colour_scales $<TARGET_FILE:test_colour_scales>)
set_tests_properties(colour_scales PROPERTIES TIMEOUT 60)

insitu_render_program(test_slice)
add_test(NAME slice COMMAND test_slice)
set_tests_properties(slice PROPERTIES TIMEOUT 120)

insitu_render_program(test_lines)
add_test(NAME lines COMMAND test_lines)
set_tests_properties(lines PROPERTIES TIMEOUT 120)

insitu_render_program(test_light)
target_sources(test_light PRIVATE test_mesh_honeycomb.c)
insitu_add_split_test(light $<TARGET_FILE:test_light>)
set_tests_properties(light PROPERTIES TIMEOUT 180)

insitu_render_program(test_render_invariance)
add_test(NAME render_invariance COMMAND test_render_invariance)
set_tests_properties(render_invariance PROPERTIES TIMEOUT 120)

insitu_render_program(test_render_batches)
insitu_add_set_tests(render_batches 120 split)


insitu_render_program(test_render_isa)
insitu_add_split_test(render_isa $<TARGET_FILE:test_render_isa>)
set_tests_properties(render_isa PROPERTIES TIMEOUT 120)

insitu_render_program(test_partition_mpi)
insitu_add_mpi_test(partition test_partition_mpi 2 7 WHOLE 1 2 3 4 7)
insitu_render_program(test_overlap_mpi)
insitu_add_mpi_test(overlap test_overlap_mpi 2 WHOLE 1 2 3 4 7 TIMEOUT 300)
insitu_render_program(test_hanging_mpi)
insitu_add_mpi_test(hanging test_hanging_mpi 3 WHOLE 1 2 7)

insitu_render_program(test_segments)
insitu_add_split_test(segments $<TARGET_FILE:test_segments>)
insitu_render_program(test_clipped_segments)
insitu_add_split_test(clipped_segments $<TARGET_FILE:test_clipped_segments>)
set_tests_properties(segments PROPERTIES TIMEOUT 180)

insitu_render_program(test_opaque_media)
insitu_add_split_test(opaque_media $<TARGET_FILE:test_opaque_media>)
set_tests_properties(opaque_media PROPERTIES TIMEOUT 120)

insitu_render_program(test_segment_ends)
add_test(NAME segment_ends COMMAND test_segment_ends)
set_tests_properties(segment_ends PROPERTIES TIMEOUT 120)

add_library(test_step_fixture OBJECT test_step_fixture.c)
target_link_libraries(test_step_fixture PUBLIC test_render_support PRIVATE insitu_flags)
function(insitu_step_program name)
  insitu_render_program(${name})
  target_link_libraries(${name} PRIVATE test_step_fixture)
endfunction()
foreach(name segment_steps step_scenes segment_ramps segment_bends)
  insitu_step_program(test_${name})
  insitu_add_split_test(${name} $<TARGET_FILE:test_${name}>)
  set_tests_properties(${name} PROPERTIES TIMEOUT 180)
endforeach()

add_executable(test_integral test_integral.c integral_doubles.c integral_floats.c)
target_link_libraries(test_integral PRIVATE test_render_support insitu_flags)
add_test(NAME integral COMMAND test_integral)
set_tests_properties(integral PROPERTIES TIMEOUT 120)


# The root finder's headers compiled into the test, on the compiler's own vectors. A test uses a part of them.
foreach(program test_roots test_roots_bent test_contraction)
  add_executable(${program} ${program}.c)
  set_source_files_properties(${program}.c PROPERTIES COMPILE_OPTIONS "-Wno-unused-function") # after all others
  target_compile_definitions(${program} PRIVATE SIMD_PLAIN)
  target_compile_options(${program} PRIVATE -fno-math-errno -fno-trapping-math)
  target_link_libraries(${program} PRIVATE test_truth test_meshes insitu_internal PkgConfig::CMOCKA insitu_flags)
endforeach()
add_test(NAME roots COMMAND test_roots)
set_tests_properties(roots PROPERTIES TIMEOUT 120)
add_test(NAME roots_bent COMMAND test_roots_bent 30000)
set_tests_properties(roots_bent PROPERTIES TIMEOUT 120)

add_test(NAME contraction COMMAND test_contraction)
set_tests_properties(contraction PROPERTIES TIMEOUT 120)

insitu_add_long_test(roots_long test_roots 10000000)
insitu_add_long_test(roots_bent_long test_roots_bent 1000000)
insitu_add_long_test(contraction_long test_contraction 10000000)

insitu_render_program(test_hits)
insitu_add_split_test(hits $<TARGET_FILE:test_hits>)
set_tests_properties(hits PROPERTIES TIMEOUT 180)

add_executable(test_polygon test_polygon.c)
target_link_libraries(test_polygon PRIVATE insitu_flags test_truth PkgConfig::CMOCKA)
add_test(NAME polygon COMMAND test_polygon)
insitu_render_program(test_render_polyhedra)
insitu_add_split_test(render_polyhedra $<TARGET_FILE:test_render_polyhedra>)
set_tests_properties(render_polyhedra PROPERTIES TIMEOUT 120)

insitu_render_program(test_polyhedron_rays)
insitu_add_set_tests(polyhedron_rays 120)
insitu_add_long_test(polyhedron_rays_long test_polyhedron_rays 1000000)

add_library(test_own_tets OBJECT test_own_tets.c)
target_link_libraries(test_own_tets PUBLIC test_render_support PRIVATE insitu_flags)
insitu_render_program(test_duals)
target_link_libraries(test_duals PRIVATE test_own_tets)
add_test(NAME duals COMMAND test_duals)
set_tests_properties(duals PROPERTIES TIMEOUT 120)
insitu_add_long_test(duals_long test_duals 16)

insitu_render_program(test_folded)
insitu_add_set_tests(folded 120 split)

# Rays' intervals: the kernels' headers compiled into the test, once an instruction set.
# Not all of the headers is used here. GCC 12 takes a vector that is written lane by lane for uninitialized. A source's
# options come after all others.
set_source_files_properties(chord_trace.c PROPERTIES
  COMPILE_OPTIONS "-Wno-unused-function;$<$<C_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>")
add_executable(test_chords test_chords.c chord_aim.c chord_hull.c test_mesh_honeycomb.c test_mesh_refined.c
  test_mesh_order.c)
target_link_libraries(test_chords PRIVATE test_render_support insitu_flags)
function(insitu_chords isa definition)
  add_library(chord_trace_${isa} OBJECT chord_trace.c)
  target_compile_definitions(chord_trace_${isa} PRIVATE CHORD_TABLE=chord_table_${isa} ${definition})
  target_compile_options(chord_trace_${isa} PRIVATE ${ARGN} -fno-math-errno -fno-trapping-math)
  target_link_libraries(chord_trace_${isa} PRIVATE insitu_internal insitu_flags)
  target_link_libraries(test_chords PRIVATE chord_trace_${isa})
endfunction()
insitu_chords(plain SIMD_PLAIN)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
  insitu_chords(sse42 SIMD_SSE42 -msse4.2)
  insitu_chords(avx2 SIMD_AVX2 -mavx2 -mfma)
  insitu_chords(avx512 SIMD_AVX512 -mavx512f -mavx512dq -mavx512bw -mavx512vl)
endif()
insitu_add_set_tests(chords 180 split)

insitu_add_long_test(chords_long test_chords 10000000)

insitu_render_program(test_hard_cases)
add_test(NAME hard_cases COMMAND test_hard_cases)
set_tests_properties(hard_cases PROPERTIES TIMEOUT 120)

insitu_render_program(test_degenerate)
insitu_add_split_test(degenerate $<TARGET_FILE:test_degenerate>)
set_tests_properties(degenerate PROPERTIES TIMEOUT 120)
