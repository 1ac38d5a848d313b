# Tests start MPI programs with more ranks than cores, which yield while they wait, with one thread per rank, and in a
# container as root too.
set(INSITU_TEST_ENVIRONMENT
  OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMP_NUM_THREADS=1
  OMPI_MCA_rmaps_base_oversubscribe=1 OMPI_MCA_hwloc_base_binding_policy=none
  OMPI_MCA_mpi_yield_when_idle=1 OMPI_MCA_btl_base_warn_component_unused=0)

# Ranks sleep while others keep the cores busy (sleeping_yield.c). LD_PRELOAD cannot name a path that has a blank or a colon.
# AddressSanitizer must be the first library, so its programs contain the function (cmake/asan.cmake).
if(NOT CMAKE_PROJECT_INCLUDE AND NOT PROJECT_BINARY_DIR MATCHES "[ :]")
  add_library(sleeping_yield MODULE ${CMAKE_CURRENT_SOURCE_DIR}/sleeping_yield.c)
  set_target_properties(sleeping_yield PROPERTIES LIBRARY_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR})
  list(APPEND INSITU_TEST_ENVIRONMENT LD_PRELOAD=$<TARGET_FILE:sleeping_yield>)
endif()

# Ranks that all MPI tests run on, instead of their own.
set(INSITU_TEST_RANKS "" CACHE STRING "Ranks to run each MPI test on, instead of those that it names")

# Sets OUT to the command that runs a program on so many ranks. One rank runs without mpiexec, which takes longer to start
# than most programs to run.
function(insitu_rank_command out ranks target)
  set(command $<TARGET_FILE:${target}> ${ARGN})
  if(NOT ranks EQUAL 1)
    list(PREPEND command ${MPIEXEC_EXECUTABLE} ${MPIEXEC_NUMPROC_FLAG} ${ranks})
  endif()
  set(${out} ${command} PARENT_SCOPE)
endfunction()

# insitu_add_mpi_test(NAME TARGET RANKS [RANKS ...] [WHOLE RANKS ...] [ARGS arg ...] [ENVIRONMENT variable ...]): one ctest
# case a count, named NAME_np<RANKS>. WHOLE: with INSITU_TEST_WHOLE=1 (test_effort.h), NAME_np<RANKS>_whole, among the
# long ones. A slow test usually runs on one count: on 2 or 3 ranks, which meet what one rank does as well.
function(insitu_add_mpi_test name target)
  cmake_parse_arguments(PARSE_ARGV 2 arg "" "TIMEOUT" "ARGS;WHOLE;ENVIRONMENT")
  set(environment ${INSITU_TEST_ENVIRONMENT} ${arg_ENVIRONMENT})
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 120)
  endif()
  foreach(ranks IN LISTS arg_WHOLE)
    insitu_rank_command(command ${ranks} ${target} ${arg_ARGS})
    insitu_add_long_test(${name}_np${ranks}_whole ${command})
    set_tests_properties(${name}_np${ranks}_whole PROPERTIES
      ENVIRONMENT "${environment};INSITU_TEST_WHOLE=1")
  endforeach()
  set(counts ${arg_UNPARSED_ARGUMENTS})
  if(INSITU_TEST_RANKS)
    set(counts ${INSITU_TEST_RANKS})
    if(NOT 1 IN_LIST arg_UNPARSED_ARGUMENTS)
      list(REMOVE_ITEM counts 1) # the test needs several
    endif()
    get_property(has_name GLOBAL PROPERTY insitu_mpi_test_${name})
    if(has_name)
      return()
    endif()
    set_property(GLOBAL PROPERTY insitu_mpi_test_${name} 1)
  endif()
  foreach(ranks IN LISTS counts)
    # Ranks wait for each other half of the time, and give the cores away meanwhile: other tests fill two cores.
    set(cores 1)
    if(ranks GREATER 3)
      set(cores 2)
    endif()
    insitu_rank_command(command ${ranks} ${target} ${arg_ARGS})
    add_test(NAME ${name}_np${ranks} COMMAND ${command})
    set_tests_properties(${name}_np${ranks} PROPERTIES
      ENVIRONMENT "${environment}" TIMEOUT ${arg_TIMEOUT} PROCESSORS ${cores})
  endforeach()
endfunction()
