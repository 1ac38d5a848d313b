# The truth that tests and benchmarks compare with, made without libinsitu's kernels: meshes whose answers are known, and
# brute force in double.
set(here ${CMAKE_CURRENT_LIST_DIR})
add_library(test_meshes STATIC
  ${here}/test_meshes.c ${here}/test_mesh_changes.c ${here}/test_mesh_dual.c ${here}/test_mesh_lattice.c
  ${here}/test_meshes.c ${here}/test_mesh_changes.c ${here}/test_mesh_hanging.c ${here}/test_mesh_lattice.c
  ${here}/test_mesh_parts.c
  ${here}/test_mesh_polyhedra.c ${here}/test_mesh_shapes.c ${here}/test_mesh_views.c)
target_include_directories(test_meshes PUBLIC ${here} ${PROJECT_SOURCE_DIR}/libinsitu/base)
target_link_libraries(test_meshes PUBLIC m PRIVATE insitu_flags)

add_library(test_truth STATIC
  ${here}/reference_base.c ${here}/reference_cell.c ${here}/reference_integral.c ${here}/reference_polygon.c ${here}/reference_polyhedron.c
  ${here}/reference_render.c)
target_link_libraries(test_truth PUBLIC test_meshes insitu_internal PRIVATE insitu_flags)
