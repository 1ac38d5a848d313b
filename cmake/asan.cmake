# Read by the preset "asan" right after project(): AddressSanitizer and UndefinedBehaviorSanitizer for all that follows.
add_compile_options(-O1 -g1 -fno-var-tracking -fno-omit-frame-pointer -fsanitize=address,undefined -fno-sanitize-recover=all)
add_link_options(-fsanitize=address,undefined)

# Instrumented, the move of an empty std::function looks to gcc 12 as if it read memory without a value: <regex> does not
# compile with this warning (gcc's bug 105562).
add_compile_options("$<$<COMPILE_LANG_AND_ID:CXX,GNU>:-Wno-maybe-uninitialized>")

# Kernels are inlined into a few functions, in which a check in line at each access takes gcc three times as long to compile
# as a call: 108 CPU seconds instead of more than 300 for each instruction set.
set(kernels render_kernels_plain render_kernels_sse42 render_kernels_avx2 render_kernels_avx512)
add_compile_options(
  "$<$<AND:$<C_COMPILER_ID:GNU>,$<IN_LIST:$<TARGET_PROPERTY:NAME>,${kernels}>>:--param=asan-instrumentation-with-call-threshold=0>")

# Open MPI unloads its plugins before the process ends. LeakSanitizer then finds memory of theirs whose stack leads into
# nowhere and cannot be told from ours; so no program unloads anything.
file(WRITE ${CMAKE_BINARY_DIR}/keep_loaded.c "int dlclose(void *library);\nint dlclose(void *library) { return !library; }\n")
add_library(keep_loaded OBJECT ${CMAKE_BINARY_DIR}/keep_loaded.c ${CMAKE_CURRENT_LIST_DIR}/../tests/sleeping_yield.c)
link_libraries($<BUILD_INTERFACE:$<$<STREQUAL:$<TARGET_PROPERTY:TYPE>,EXECUTABLE>:$<TARGET_OBJECTS:keep_loaded>>>)

# The longest tests take ten times as long here.
set(INSITU_TEST_PATIENCE 10)
