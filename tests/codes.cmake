# Codes of others that libinsitu is coupled to, by programs that their users would write. ./test --examples installs them.
set(INSITU_DEBIAN_PYTHON /usr/bin/python3)
add_test(NAME codes COMMAND ${CMAKE_COMMAND} -E echo "skipped: ./test --examples installs deal.II, dolfinx and OpenFOAM and runs them")
set_tests_properties(codes PROPERTIES SKIP_REGULAR_EXPRESSION "^skipped")
add_test(NAME code_dolfinx COMMAND ${INSITU_DEBIAN_PYTHON} ${CMAKE_CURRENT_SOURCE_DIR}/test_code_dolfinx.py
  ${MPIEXEC_EXECUTABLE} ${INSITU_DEBIAN_PYTHON} ${PROJECT_SOURCE_DIR}/examples/dolfinx/allen_cahn.py
  ${CMAKE_CURRENT_BINARY_DIR}/code_dolfinx CONFIGURATIONS Examples)
set_tests_properties(code_dolfinx PROPERTIES LABELS examples TIMEOUT 1200 PROCESSORS 2
  ENVIRONMENT "${INSITU_TEST_ENVIRONMENT};PYTHONPATH=${CMAKE_LIBRARY_OUTPUT_DIRECTORY};PYTHONDONTWRITEBYTECODE=1")

add_test(NAME code_dealii COMMAND ${INSITU_DEBIAN_PYTHON} ${CMAKE_CURRENT_SOURCE_DIR}/test_code_dealii.py ${CMAKE_COMMAND}
  ${PROJECT_BINARY_DIR} ${PROJECT_SOURCE_DIR}/examples/dealii ${MPIEXEC_EXECUTABLE} ${CMAKE_CURRENT_BINARY_DIR}/code_dealii
  CONFIGURATIONS Examples)
set_tests_properties(code_dealii PROPERTIES LABELS examples TIMEOUT 1200 PROCESSORS 2
  ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}")

add_test(NAME code_openfoam COMMAND ${INSITU_DEBIAN_PYTHON} ${CMAKE_CURRENT_SOURCE_DIR}/test_code_openfoam.py
  ${PROJECT_SOURCE_DIR}/examples/openfoam ${CMAKE_CURRENT_BINARY_DIR}/code_openfoam
  -I${PROJECT_SOURCE_DIR}/libinsitu/include -L${CMAKE_LIBRARY_OUTPUT_DIRECTORY} -linsitu
  -Wl,-rpath,${CMAKE_LIBRARY_OUTPUT_DIRECTORY} CONFIGURATIONS Examples)
set_tests_properties(code_openfoam PROPERTIES LABELS examples TIMEOUT 3600 PROCESSORS 2
  ENVIRONMENT "${INSITU_TEST_ENVIRONMENT}")
