# The documentation: its links, snippets and commands, the tutorial as it is written, and the site, without a network.
find_program(INSITU_SYSTEM_PYTHON NAMES python3 PATHS /usr/bin NO_CACHE NO_DEFAULT_PATH)
if(NOT INSITU_SYSTEM_PYTHON)
  find_program(INSITU_SYSTEM_PYTHON NAMES python3 REQUIRED)
endif()
set(docs_scripts ${PROJECT_SOURCE_DIR}/docs/site)

# Scenes on the pages are read by the library's Python module, where that can be loaded.
add_test(NAME docs_links_and_snippets COMMAND ${INSITU_SYSTEM_PYTHON} ${docs_scripts}/check_pages.py ${PROJECT_SOURCE_DIR})
set_tests_properties(docs_links_and_snippets PROPERTIES TIMEOUT 60 ENVIRONMENT
  "${INSITU_TEST_ENVIRONMENT};PYTHONDONTWRITEBYTECODE=1;PYTHONPATH=${CMAKE_LIBRARY_OUTPUT_DIRECTORY};INSITU_CHECK_SCENES=${INSITU_TEST_PYTHON}")
add_test(NAME docs_checks_can_fail COMMAND sh ${CMAKE_CURRENT_SOURCE_DIR}/docs_seeded.sh ${PROJECT_SOURCE_DIR}
  ${INSITU_SYSTEM_PYTHON} ${CMAKE_CURRENT_BINARY_DIR}/docs_seeded)
set_tests_properties(docs_checks_can_fail PROPERTIES TIMEOUT 60 ENVIRONMENT PYTHONDONTWRITEBYTECODE=1)
# Builds by other compilers and with sanitizers lack some tests.
if(CMAKE_C_COMPILER_ID STREQUAL "GNU" AND NOT CMAKE_PROJECT_INCLUDE)
  add_test(NAME docs_claims_have_tests COMMAND ${INSITU_SYSTEM_PYTHON} ${docs_scripts}/check_claims.py ${PROJECT_SOURCE_DIR}
    ${PROJECT_BINARY_DIR})
  set_tests_properties(docs_claims_have_tests PROPERTIES TIMEOUT 60)
endif()

# In a shell as a user has one. The address sanitizer would have to be loaded before Python, and linked into the programs.
if(CMAKE_PROJECT_INCLUDE)
  add_test(NAME docs_tutorial COMMAND ${CMAKE_COMMAND} -E echo "skipped: sanitizers are on")
else()
  add_test(NAME docs_tutorial COMMAND ${CMAKE_COMMAND} -DBUILD=${PROJECT_BINARY_DIR} -DPYTHON=${INSITU_SYSTEM_PYTHON}
    -DSCRIPT=${docs_scripts}/run_tutorial.py -DFOLDER=${CMAKE_CURRENT_BINARY_DIR}/tutorial
    -P ${CMAKE_CURRENT_SOURCE_DIR}/docs_tutorial.cmake)
endif()
set_tests_properties(docs_tutorial PROPERTIES SKIP_REGULAR_EXPRESSION "^skipped" TIMEOUT 180
  ENVIRONMENT "${INSITU_TEST_ENVIRONMENT};PYTHONDONTWRITEBYTECODE=1")

# cmake/site.cmake has looked for mkdocs.
if(INSITU_MKDOCS)
  add_test(NAME docs_site COMMAND sh -e -c "\"$0\" build --strict --quiet --config-file \"$1/mkdocs.yml\" --site-dir \"$2\"
    \"$3\" \"$1/docs/site/check_site.py\" \"$2\"" ${INSITU_MKDOCS} ${PROJECT_SOURCE_DIR}
    ${CMAKE_CURRENT_BINARY_DIR}/site ${INSITU_SYSTEM_PYTHON})
else()
  add_test(NAME docs_site COMMAND ${CMAKE_COMMAND} -E echo "skipped: there is no mkdocs with the theme material")
endif()
set_tests_properties(docs_site PROPERTIES SKIP_REGULAR_EXPRESSION "^skipped" TIMEOUT 60 ENVIRONMENT PYTHONDONTWRITEBYTECODE=1)
