# The documentation as a site, by mkdocs where that and its theme are: build/site/index.html, whatever is built elsewhere.
find_program(INSITU_MKDOCS mkdocs NO_CACHE)
if(INSITU_MKDOCS)
  execute_process(COMMAND ${INSITU_MKDOCS} build --help OUTPUT_VARIABLE help ERROR_QUIET)
  if(NOT help MATCHES "material")
    set(INSITU_MKDOCS NOTFOUND)
  endif()
endif()
if(INSITU_MKDOCS)
  add_custom_target(site COMMAND ${INSITU_MKDOCS} build --strict --quiet
    COMMAND ${CMAKE_COMMAND} -E echo "${PROJECT_SOURCE_DIR}/build/site/index.html"
    WORKING_DIRECTORY ${PROJECT_SOURCE_DIR} VERBATIM)
endif()
