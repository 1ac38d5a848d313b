add_executable(test_mmbvh test_mmbvh.c)
target_link_libraries(test_mmbvh PRIVATE insitu_internal insitu_flags PkgConfig::CMOCKA)
add_test(NAME mmbvh COMMAND test_mmbvh)
set_tests_properties(mmbvh PROPERTIES TIMEOUT 300 PROCESSORS 2)

add_executable(test_mmbvh_check test_mmbvh_check.c)
target_link_libraries(test_mmbvh_check PRIVATE insitu_internal insitu_flags PkgConfig::CMOCKA)
add_test(NAME mmbvh_check COMMAND test_mmbvh_check)
set_tests_properties(mmbvh_check PROPERTIES TIMEOUT 60)

add_executable(test_mmbvh_layout test_mmbvh_layout.c)
target_link_libraries(test_mmbvh_layout PRIVATE insitu_internal insitu_flags PkgConfig::CMOCKA)
add_test(NAME mmbvh_layout COMMAND test_mmbvh_layout)
set_tests_properties(mmbvh_layout PROPERTIES TIMEOUT 120 PROCESSORS 2)

add_executable(test_mmbvh_sort test_mmbvh_sort.c)
target_link_libraries(test_mmbvh_sort PRIVATE insitu_internal insitu_flags PkgConfig::CMOCKA)
add_test(NAME mmbvh_sort COMMAND test_mmbvh_sort)
set_tests_properties(mmbvh_sort PROPERTIES TIMEOUT 120 PROCESSORS 2)

add_executable(test_mmbvh_select test_mmbvh_select.c)
target_link_libraries(test_mmbvh_select PRIVATE test_meshes insitu_internal insitu_flags PkgConfig::CMOCKA)
add_test(NAME mmbvh_select COMMAND test_mmbvh_select)
set_tests_properties(mmbvh_select PROPERTIES TIMEOUT 60 PROCESSORS 2)
