# cmake -DPROGRAM=... -DSCENE=... -DFOLDER=... -DMPIRUN=<command, a list> -P readme_run.cmake: the README's program and scene, on
# 2 ranks, write the pictures that the README says, and nothing on the standard output.
file(REMOVE_RECURSE ${FOLDER})
file(MAKE_DIRECTORY ${FOLDER})
execute_process(COMMAND ${MPIRUN} 2 ${PROGRAM} ${SCENE} WORKING_DIRECTORY ${FOLDER}
  RESULT_VARIABLE status OUTPUT_VARIABLE out ERROR_VARIABLE complaints)
if(NOT status EQUAL 0 OR NOT "${out}${complaints}" STREQUAL "")
  message(FATAL_ERROR "status ${status}, output: ${out}${complaints}")
endif()
file(GLOB_RECURSE pictures RELATIVE ${FOLDER} ${FOLDER}/*)
if(NOT "${pictures}" STREQUAL "pictures/pressure_000.png;pictures/pressure_002.png")
  message(FATAL_ERROR "other pictures than expected: ${pictures}")
endif()
