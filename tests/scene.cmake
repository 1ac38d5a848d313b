# Scene files, colour maps and images.
add_executable(test_scene test_scene.c)
target_link_libraries(test_scene PRIVATE insitu_quick_flags insitu_internal PkgConfig::CMOCKA)
add_test(NAME scene COMMAND test_scene ${PROJECT_SOURCE_DIR}/examples)
set_tests_properties(scene PROPERTIES TIMEOUT 60)

add_executable(test_scene_colour test_scene_colour.c)
target_link_libraries(test_scene_colour PRIVATE insitu_quick_flags insitu_internal PkgConfig::CMOCKA)
add_test(NAME scene_colour COMMAND test_scene_colour)
set_tests_properties(scene_colour PROPERTIES TIMEOUT 60)

add_executable(test_scene_shorthand test_scene_shorthand.c)
target_link_libraries(test_scene_shorthand PRIVATE insitu_quick_flags insitu_internal PkgConfig::CMOCKA)
add_test(NAME scene_shorthand COMMAND test_scene_shorthand)
set_tests_properties(scene_shorthand PROPERTIES TIMEOUT 60)

add_executable(test_scene_mistakes test_scene_mistakes.c)
target_link_libraries(test_scene_mistakes PRIVATE insitu_quick_flags insitu_internal PkgConfig::CMOCKA)
add_test(NAME scene_mistakes COMMAND test_scene_mistakes)
set_tests_properties(scene_mistakes PROPERTIES TIMEOUT 60)

add_executable(test_scene_series test_scene_series.c)
target_link_libraries(test_scene_series PRIVATE insitu_quick_flags insitu_internal PkgConfig::CMOCKA m)
add_test(NAME scene_series COMMAND test_scene_series)
set_tests_properties(scene_series PROPERTIES TIMEOUT 60)

add_executable(scene_reference scene_reference.c)
target_link_libraries(scene_reference PRIVATE insitu_quick_flags insitu_internal)
add_test(NAME scene_reference_is_in_step COMMAND scene_reference ${PROJECT_SOURCE_DIR}/docs/scene.md)
set_tests_properties(scene_reference_is_in_step PROPERTIES TIMEOUT 60)
add_custom_target(scene_docs COMMAND scene_reference > ${PROJECT_SOURCE_DIR}/docs/scene.md VERBATIM)

add_executable(test_colour_map test_colour_map.c)
target_link_libraries(test_colour_map PRIVATE insitu_quick_flags insitu_internal PkgConfig::CMOCKA)
add_test(NAME colour_map COMMAND test_colour_map)
set_tests_properties(colour_map PROPERTIES TIMEOUT 60)

# Reads back by OpenImageIO what the adaptor wrote, which it loads as libinsitu does.
add_executable(test_image_output test_image_output.cpp)
add_dependencies(test_image_output insitu_image)
target_include_directories(test_image_output SYSTEM PRIVATE ${OPENIMAGEIO_INCLUDE_DIR})
target_link_libraries(test_image_output PRIVATE
  insitu_quick_flags insitu_internal ${OPENIMAGEIO_LIBRARY} ${OPENIMAGEIO_UTIL_LIBRARY} PkgConfig::CMOCKA)
add_test(NAME image_output COMMAND test_image_output ${CMAKE_CURRENT_BINARY_DIR}/image_output)
set_tests_properties(image_output PROPERTIES TIMEOUT 120)

# For compare_builds.sh.
add_executable(picture_difference picture_difference.cpp)
target_include_directories(picture_difference SYSTEM PRIVATE ${OPENIMAGEIO_INCLUDE_DIR})
target_link_libraries(picture_difference PRIVATE insitu_quick_flags ${OPENIMAGEIO_LIBRARY} ${OPENIMAGEIO_UTIL_LIBRARY})

add_executable(test_decorations test_decorations.c)
target_link_libraries(test_decorations PRIVATE insitu_quick_flags insitu_internal PkgConfig::CMOCKA m)
add_test(NAME decorations COMMAND test_decorations)
set_tests_properties(decorations PROPERTIES TIMEOUT 60)

add_executable(test_session_camera test_session_camera.c)
target_link_libraries(test_session_camera PRIVATE insitu_quick_flags insitu_internal PkgConfig::CMOCKA m)
add_test(NAME session_camera COMMAND test_session_camera)
set_tests_properties(session_camera PROPERTIES TIMEOUT 60)

# Decorations, tested below the C face of the image library.
add_library(test_decorate OBJECT
  ${PROJECT_SOURCE_DIR}/adaptors/image/decorate.cpp ${PROJECT_SOURCE_DIR}/adaptors/image/layout.cpp
  ${PROJECT_SOURCE_DIR}/adaptors/image/typeface.cpp)
target_include_directories(test_decorate PUBLIC ${PROJECT_SOURCE_DIR}/adaptors/image)
target_link_libraries(test_decorate PUBLIC insitu_quick_flags insitu_internal PkgConfig::FREETYPE PkgConfig::CMOCKA)
foreach(test decorated_image random_decorations glyphs layout)
  add_executable(test_${test} test_${test}.cpp)
  target_link_libraries(test_${test} PRIVATE test_decorate)
endforeach()
add_test(NAME decorated_image COMMAND test_decorated_image)
set_tests_properties(decorated_image PROPERTIES TIMEOUT 60)
add_test(NAME glyphs COMMAND test_glyphs)
set_tests_properties(glyphs PROPERTIES TIMEOUT 60)
insitu_add_split_test(layout $<TARGET_FILE:test_layout>)
set_tests_properties(layout PROPERTIES TIMEOUT 60)
insitu_add_split_test(random_decorations $<TARGET_FILE:test_random_decorations>)
set_tests_properties(random_decorations PROPERTIES TIMEOUT 120)

# Memory runs out: quickly at every 41st allocation of the first picture, in the long tests at each.
add_library(test_failing_heap OBJECT failing_heap.c)
target_link_libraries(test_failing_heap PRIVATE insitu_quick_flags ${CMAKE_DL_LIBS})
set_target_properties(test_failing_heap PROPERTIES C_VISIBILITY_PRESET default) # libraries are to find it
add_executable(test_image_memory test_image_memory.c)
add_dependencies(test_image_memory insitu_image)
target_link_libraries(test_image_memory PRIVATE test_failing_heap insitu_quick_flags insitu_internal PkgConfig::CMOCKA)
add_test(NAME image_memory COMMAND test_image_memory ${CMAKE_CURRENT_BINARY_DIR}/image_memory)
set_tests_properties(image_memory PROPERTIES TIMEOUT 180)
insitu_add_long_test(image_memory_long test_image_memory ${CMAKE_CURRENT_BINARY_DIR}/image_memory_long 1)
