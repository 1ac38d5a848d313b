# Other compilers read the sources, without making objects, so that every run sees what they would say. Whole builds and
# tests by them are among the long tests.
function(insitu_add_reading_test who)
  add_test(NAME compilers_${who}_reads
    COMMAND python3 ${CMAKE_CURRENT_SOURCE_DIR}/compilers_read.py ${who} ${PROJECT_BINARY_DIR})
  set_tests_properties(compilers_${who}_reads PROPERTIES PROCESSORS 2 TIMEOUT 600 SKIP_RETURN_CODE 77)
endfunction()
if(CMAKE_C_COMPILER_ID STREQUAL "GNU" AND NOT CMAKE_PROJECT_INCLUDE)
  insitu_add_reading_test(clang)
  insitu_add_reading_test(aarch64)
  add_test(NAME compilers_can_find_fault
    COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/compilers_seeded.sh ${CMAKE_CURRENT_BINARY_DIR}/compilers_seeded)
  set_tests_properties(compilers_can_find_fault PROPERTIES TIMEOUT 60 SKIP_RETURN_CODE 77)
endif()

# insitu_add_whole_build_test(NAME REGEX [cmake options]): a build of its own, and its tests that match, among the long tests.
function(insitu_add_whole_build_test name regex)
  insitu_add_long_test(compilers_${name}_whole sh ${CMAKE_CURRENT_SOURCE_DIR}/compilers_whole.sh ${PROJECT_SOURCE_DIR}
    ${CMAKE_CURRENT_BINARY_DIR}/whole_${name} ${regex} ${ARGN})
  set_tests_properties(compilers_${name}_whole PROPERTIES PROCESSORS 2)
endfunction()
if(CMAKE_C_COMPILER_ID STREQUAL "GNU" AND NOT CMAKE_PROJECT_INCLUDE AND NOT INSITU_TEST_RANKS)
  insitu_add_whole_build_test(clang . -DCMAKE_C_COMPILER=clang -DCMAKE_CXX_COMPILER=clang++)
  # VTK of Debian is built with Open MPI, hence without it.
  insitu_add_whole_build_test(mpich _np[0-9]+$ -DINSITU_VTK=OFF -DMPI_C_COMPILER=/usr/bin/mpicc.mpich
    -DMPI_CXX_COMPILER=/usr/bin/mpicxx.mpich -DMPI_Fortran_COMPILER=/usr/bin/mpifort.mpich
    -DMPIEXEC_EXECUTABLE=/usr/bin/mpiexec.mpich
    "-DINSITU_TEST_RANKS=1$<SEMICOLON>2$<SEMICOLON>4")
endif()
