# Other languages than C: each example draws the pictures of six_calls.c, which the README's test draws, to the byte, on
# 2 ranks.
set(truth ${CMAKE_CURRENT_BINARY_DIR}/readme)
set(scene ${PROJECT_SOURCE_DIR}/examples/six_calls.yaml)
function(insitu_add_same_pictures_test name)
  add_test(NAME ${name}
    COMMAND ${CMAKE_COMMAND} "-DPROGRAM=${ARGN}" "-DTRUTH=${truth}"
      -DSCENE=${scene} -DFOLDER=${CMAKE_CURRENT_BINARY_DIR}/${name}
      "-DMPIRUN=${MPIEXEC_EXECUTABLE};${MPIEXEC_NUMPROC_FLAG}" -P ${CMAKE_CURRENT_SOURCE_DIR}/languages_run.cmake)
  set_tests_properties(${name} PROPERTIES ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}" TIMEOUT 120
    FIXTURES_REQUIRED readme)
endfunction()

# Not other languages, but other descriptions of the mesh: faces by owner and neighbour; nodes of higher order.
foreach(example finite_volume finite_elements)
  add_executable(${example} ${PROJECT_SOURCE_DIR}/examples/${example}.c)
  target_link_libraries(${example} PRIVATE insitu insitu_flags m)
  insitu_add_same_pictures_test(${example}_example_draws_on_2_ranks $<TARGET_FILE:${example}>)
endforeach()

# Structured blocks: a domain is the same picture on 1 rank and on 2, whose blocks are others.
function(insitu_add_block_example name scene)
  add_test(NAME ${name}_example_draws_the_same_on_2_ranks
    COMMAND ${CMAKE_COMMAND} "-DPROGRAM=${ARGN}" "-DTRUTH=${ARGN}" -DTRUTH_RANKS=1
      -DSCENE=${PROJECT_SOURCE_DIR}/examples/${scene}.yaml -DFOLDER=${CMAKE_CURRENT_BINARY_DIR}/${name}_example
      "-DMPIRUN=${MPIEXEC_EXECUTABLE};${MPIEXEC_NUMPROC_FLAG}" -P ${CMAKE_CURRENT_SOURCE_DIR}/languages_run.cmake)
  set_tests_properties(${name}_example_draws_the_same_on_2_ranks PROPERTIES ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}"
    TIMEOUT 120)
endfunction()
add_executable(blocks ${PROJECT_SOURCE_DIR}/examples/blocks.c)
target_link_libraries(blocks PRIVATE insitu insitu_flags m)
insitu_add_block_example(blocks blocks $<TARGET_FILE:blocks>)
add_executable(levels ${PROJECT_SOURCE_DIR}/examples/levels.c)
target_link_libraries(levels PRIVATE insitu insitu_flags m)
insitu_add_block_example(levels levels $<TARGET_FILE:levels>)

# C++: from the header alone, under more warnings than our own code has. MPI's header is the system's, and not asked.
add_executable(six_calls_cpp ${PROJECT_SOURCE_DIR}/examples/six_calls.cpp)
set_target_properties(six_calls_cpp PROPERTIES CXX_EXTENSIONS OFF) # -std=c++17
target_link_libraries(six_calls_cpp PRIVATE insitu)
target_compile_options(six_calls_cpp PRIVATE -Wall -Wextra -Wold-style-cast -Wpedantic ${insitu_werror} -ffp-contract=off)
insitu_add_same_pictures_test(cpp_example_draws_on_2_ranks $<TARGET_FILE:six_calls_cpp>)

# Fortran, where there is a compiler whose MPI module it reads: with every check that gfortran has.
include(CheckLanguage)
check_language(Fortran)
if(CMAKE_Fortran_COMPILER)
  enable_language(Fortran)
  find_package(MPI COMPONENTS Fortran)
endif()
if(NOT MPI_Fortran_HAVE_F08_MODULE)
  add_test(NAME fortran COMMAND ${CMAKE_COMMAND} -E echo "skipped: no Fortran compiler, or no mpi_f08 for it")
  set_tests_properties(fortran PROPERTIES SKIP_REGULAR_EXPRESSION "^skipped")
else()
  add_library(insitu_fortran STATIC ${PROJECT_SOURCE_DIR}/libinsitu/fortran/insitu.f90)
  target_link_libraries(insitu_fortran PUBLIC insitu MPI::MPI_Fortran)
  set_target_properties(insitu_fortran PROPERTIES Fortran_MODULE_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/fortran)
  target_include_directories(insitu_fortran PUBLIC ${CMAKE_CURRENT_BINARY_DIR}/fortran)
  add_executable(six_calls_fortran ${PROJECT_SOURCE_DIR}/examples/six_calls.f90)
  add_executable(curvilinear ${PROJECT_SOURCE_DIR}/examples/curvilinear.f90)
  add_executable(test_fortran test_fortran.f90 test_fortran_blocks.f90)
  foreach(target insitu_fortran six_calls_fortran curvilinear test_fortran)
    if(CMAKE_Fortran_COMPILER_ID STREQUAL GNU)
      target_compile_options(${target} PRIVATE -std=f2008 -Wall -Wextra -Wno-function-elimination ${insitu_werror}
        -fcheck=all -ffp-contract=off)
    endif()
  endforeach()
  foreach(target six_calls_fortran curvilinear test_fortran)
    target_link_libraries(${target} PRIVATE insitu_fortran)
  endforeach()
  insitu_add_same_pictures_test(fortran_example_draws_on_2_ranks $<TARGET_FILE:six_calls_fortran>)
  insitu_add_block_example(curvilinear curvilinear $<TARGET_FILE:curvilinear>)
  insitu_add_mpi_test(fortran test_fortran 1 2 ARGS ${CMAKE_CURRENT_BINARY_DIR}/fortran_)
endif()

# Python. The address sanitizer would have to be loaded before the interpreter.
if(NOT INSITU_TEST_PYTHON)
  add_test(NAME python COMMAND ${CMAKE_COMMAND} -E echo "skipped: no python3 with numpy and this MPI's mpi4py, or sanitizers are on")
  set_tests_properties(python PROPERTIES SKIP_REGULAR_EXPRESSION "^skipped")
else()
  set(python_path PYTHONPATH=${CMAKE_LIBRARY_OUTPUT_DIRECTORY} PYTHONDONTWRITEBYTECODE=1)
  insitu_add_same_pictures_test(python_example_draws_on_2_ranks ${INSITU_TEST_PYTHON}
    ${PROJECT_SOURCE_DIR}/examples/six_calls.py)
  insitu_add_same_pictures_test(discontinuous_example_draws_on_2_ranks ${INSITU_TEST_PYTHON}
    ${PROJECT_SOURCE_DIR}/examples/discontinuous.py)
  insitu_add_block_example(uniform_block blocks ${INSITU_TEST_PYTHON} ${PROJECT_SOURCE_DIR}/examples/uniform_block.py)
  # Telling what has changed saves work and changes no picture: the program that tells nothing draws the same.
  set(moving_mesh ${PROJECT_SOURCE_DIR}/examples/moving_mesh.py)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${moving_mesh})
  file(READ ${moving_mesh} text)
  string(REGEX REPLACE ", changed=[^)]*" "" silent "${text}")
  file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/silent_mesh.py "${silent}")
  set(truth ${INSITU_TEST_PYTHON} ${CMAKE_CURRENT_BINARY_DIR}/silent_mesh.py)
  insitu_add_same_pictures_test(moving_mesh_example_draws_on_2_ranks ${INSITU_TEST_PYTHON} ${moving_mesh})
  foreach(ranks 1 2)
    add_test(NAME python_np${ranks} COMMAND ${MPIEXEC_EXECUTABLE} ${MPIEXEC_NUMPROC_FLAG} ${ranks} ${INSITU_TEST_PYTHON}
      ${CMAKE_CURRENT_SOURCE_DIR}/test_python.py ${CMAKE_CURRENT_BINARY_DIR}/python_np${ranks}
      ${PROJECT_SOURCE_DIR}/libinsitu/include/insitu/insitu.h)
  endforeach()
  # No borrowed array is read after it is gone: Python gives and takes memory by malloc then, so that valgrind knows. Of
  # values that are not initialized the interpreter has its own.
  find_program(INSITU_VALGRIND valgrind)
  if(INSITU_VALGRIND)
    add_test(NAME python_under_valgrind COMMAND ${CMAKE_COMMAND} -E env PYTHONMALLOC=malloc HWLOC_COMPONENTS=-x86
      OMP_NUM_THREADS=1 INSITU_ISA=plain ${INSITU_VALGRIND} -q --undef-value-errors=no --error-exitcode=99
      ${INSITU_TEST_PYTHON} ${CMAKE_CURRENT_SOURCE_DIR}/test_python.py ${CMAKE_CURRENT_BINARY_DIR}/python_under_valgrind
      ${PROJECT_SOURCE_DIR}/libinsitu/include/insitu/insitu.h CONFIGURATIONS Long)
    set_tests_properties(python_under_valgrind PROPERTIES ENVIRONMENT "${INSITU_TEST_ENVIRONMENT};${python_path}"
      TIMEOUT 7200 LABELS long)
  endif()
  foreach(test python_example_draws_on_2_ranks discontinuous_example_draws_on_2_ranks
      moving_mesh_example_draws_on_2_ranks uniform_block_example_draws_the_same_on_2_ranks python_np1 python_np2)
    set_tests_properties(${test} PROPERTIES ENVIRONMENT "${INSITU_TEST_ENVIRONMENT};${python_path}" TIMEOUT 120)
  endforeach()
endif()

# Plane runs, whose truth is the program in C.
set(plane ${PROJECT_SOURCE_DIR}/examples/plane)
set(scene ${plane}/plate.yaml)
add_executable(plane_plate ${plane}/plate.c)
target_link_libraries(plane_plate PRIVATE insitu insitu_flags)
set(truth $<TARGET_FILE:plane_plate>)
if(TARGET insitu_fortran)
  add_executable(plane_plate_fortran ${plane}/plate.f90)
  target_link_libraries(plane_plate_fortran PRIVATE insitu_fortran)
  target_compile_options(plane_plate_fortran PRIVATE $<$<Fortran_COMPILER_ID:GNU>:-ffp-contract=off>)
  insitu_add_same_pictures_test(plane_fortran_example_draws_on_2_ranks $<TARGET_FILE:plane_plate_fortran>)
endif()
if(INSITU_TEST_PYTHON)
  insitu_add_same_pictures_test(plane_python_example_draws_on_2_ranks ${INSITU_TEST_PYTHON} ${plane}/plate.py)
  set_tests_properties(plane_python_example_draws_on_2_ranks PROPERTIES
    ENVIRONMENT "${INSITU_TEST_ENVIRONMENT};${python_path}")
endif()
