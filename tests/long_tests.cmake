# insitu_add_long_test(NAME COMMAND [arg ...]): a slow proof, run by ./test --long alone. Two hours each at most.
function(insitu_add_long_test name)
  add_test(NAME ${name} COMMAND ${ARGN} CONFIGURATIONS Long)
  set_tests_properties(${name} PROPERTIES LABELS long TIMEOUT 7200)
endfunction()
