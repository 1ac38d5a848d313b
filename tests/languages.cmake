# Other languages than C: each example draws the pictures of six_calls.c, to the byte, on 2 ranks.
function(insitu_add_same_pictures_test name)
  add_test(NAME ${name}
    COMMAND ${CMAKE_COMMAND} "-DPROGRAM=${ARGN}" -DTRUTH=$<TARGET_FILE:six_calls>
      -DSCENE=${PROJECT_SOURCE_DIR}/examples/six_calls.yaml -DFOLDER=${CMAKE_CURRENT_BINARY_DIR}/${name}
      "-DMPIRUN=${MPIEXEC_EXECUTABLE};${MPIEXEC_NUMPROC_FLAG}" -P ${CMAKE_CURRENT_SOURCE_DIR}/languages_run.cmake)
  set_tests_properties(${name} PROPERTIES ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}" TIMEOUT 120 PROCESSORS 2)
endfunction()

# Python: one that has numpy and mpi4py. The address sanitizer would have to be loaded before the interpreter.
find_program(INSITU_PYTHON NAMES python3 PATHS /usr/bin NO_DEFAULT_PATH)
find_program(INSITU_PYTHON NAMES python3)
if(INSITU_PYTHON)
  execute_process(COMMAND ${INSITU_PYTHON} -c "import numpy, mpi4py" RESULT_VARIABLE python_lacks OUTPUT_QUIET ERROR_QUIET)
endif()
if(NOT INSITU_PYTHON OR python_lacks OR CMAKE_PROJECT_INCLUDE)
  add_test(NAME python COMMAND ${CMAKE_COMMAND} -E echo "skipped: no python3 with numpy and mpi4py, or sanitizers are on")
  set_tests_properties(python PROPERTIES SKIP_REGULAR_EXPRESSION "^skipped")
else()
  set(python_path PYTHONPATH=${CMAKE_LIBRARY_OUTPUT_DIRECTORY} PYTHONDONTWRITEBYTECODE=1)
  insitu_add_same_pictures_test(python_example_draws_on_2_ranks ${INSITU_PYTHON}
    ${PROJECT_SOURCE_DIR}/examples/six_calls.py)
  foreach(ranks 1 2)
    add_test(NAME python_np${ranks} COMMAND ${MPIEXEC_EXECUTABLE} ${MPIEXEC_NUMPROC_FLAG} ${ranks} ${INSITU_PYTHON}
      ${CMAKE_CURRENT_SOURCE_DIR}/test_python.py ${CMAKE_CURRENT_BINARY_DIR}/python_np${ranks}
      ${PROJECT_SOURCE_DIR}/libinsitu/include/insitu/insitu.h)
  endforeach()
  foreach(test python_example_draws_on_2_ranks python_np1 python_np2)
    set_tests_properties(${test} PROPERTIES ENVIRONMENT "${INSITU_TEST_ENVIRONMENT};${python_path}" TIMEOUT 120
      PROCESSORS 2)
  endforeach()
endif()
