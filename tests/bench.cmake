# The benchmarks' programs do what their pages are drawn from; no time is looked at.
add_test(NAME bench_accuracy
  COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/bench_accuracy.sh $<TARGET_FILE:bench_accuracy> ${PROJECT_SOURCE_DIR}/bench)
set_tests_properties(bench_accuracy PROPERTIES PROCESSORS 2 TIMEOUT 180)

add_test(NAME bench_speed
  COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/bench_speed.sh $<TARGET_FILE_DIR:bench_render> ${PROJECT_SOURCE_DIR}/bench)
set_tests_properties(bench_speed PROPERTIES PROCESSORS 2 TIMEOUT 240)

add_test(NAME bench_pages COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/bench_pages.sh ${PROJECT_SOURCE_DIR})
set_tests_properties(bench_pages PROPERTIES TIMEOUT 60)
