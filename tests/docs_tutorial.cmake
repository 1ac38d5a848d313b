# cmake -DBUILD=... -DPYTHON=... -DSCRIPT=... -DFOLDER=... -P docs_tutorial.cmake: docs/tutorial.md by an installation of its own.
execute_process(COMMAND ${CMAKE_COMMAND} --install ${BUILD} --prefix ${FOLDER}/installed OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${PYTHON} ${SCRIPT} ${FOLDER}/installed ${FOLDER}/work COMMAND_ERROR_IS_FATAL ANY)
