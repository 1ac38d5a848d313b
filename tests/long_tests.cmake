# insitu_add_long_test(NAME COMMAND [arg ...]): a slow proof, run by ./test --long alone. Two hours each at most.
function(insitu_add_long_test name)
  add_test(NAME ${name} COMMAND ${ARGN} CONFIGURATIONS Long)
  set_tests_properties(${name} PROPERTIES LABELS long TIMEOUT 7200)
endfunction()

# insitu_add_split_test(NAME COMMAND [arg ...]): the usual part of a test as NAME, and the whole of it, which is slow, as
# NAME_whole among the long ones: with INSITU_TEST_WHOLE=1 (test_effort.h). The command is a path, as of $<TARGET_FILE:...>.
function(insitu_add_split_test name)
  add_test(NAME ${name} COMMAND ${ARGN})
  insitu_add_long_test(${name}_whole ${CMAKE_COMMAND} -E env INSITU_TEST_WHOLE=1 ${ARGN})
endfunction()
