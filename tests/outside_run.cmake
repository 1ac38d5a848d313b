# Installs into one folder and moves it to another, so that a path which survived in some file would be found out.
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT status EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "status ${status} of: ${command}\n${output}")
  endif()
endfunction()

file(REMOVE_RECURSE ${FOLDER})
file(MAKE_DIRECTORY ${FOLDER})
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${FOLDER}/installed)
file(RENAME ${FOLDER}/installed ${FOLDER}/moved)
set(prefix ${FOLDER}/moved)

run(${CMAKE_COMMAND} -G ${GENERATOR} -S ${SOURCE} -B ${FOLDER}/project -DCMAKE_PREFIX_PATH=${prefix}
  -DCMAKE_FIND_USE_PACKAGE_REGISTRY=OFF -DWITH_VTK=${WITH_VTK} -DWITH_FORTRAN=${WITH_FORTRAN}
  -DFORTRAN_EXAMPLE=${SOURCE}/../../examples/six_calls.f90 -DCMAKE_C_COMPILER=${CC} -DCMAKE_CXX_COMPILER=${CXX}
  "-DCMAKE_C_FLAGS=${FLAGS}" "-DCMAKE_CXX_FLAGS=${FLAGS}")
run(${CMAKE_COMMAND} --build ${FOLDER}/project)
run(${FOLDER}/project/outside_user)
run(${FOLDER}/project/outside_user_cpp)
run(${FOLDER}/project/outside_user_static)
if(WITH_VTK)
  run(${FOLDER}/project/outside_vtk)
endif()
if(WITH_FORTRAN)
  file(WRITE ${FOLDER}/scene.yaml "images: [{name: a, layers: [{surface: {}}], outputs: [{path: fortran.png}]}]")
  run(${CMAKE_COMMAND} -E chdir ${FOLDER} project/outside_fortran scene.yaml)
  if(NOT EXISTS ${FOLDER}/fortran.png)
    message(FATAL_ERROR "the program in Fortran drew nothing")
  endif()
endif()

# Projects of C++ and of Fortran alone.
function(build_alone language compiler sources)
  set(folder ${FOLDER}/alone_${language})
  file(WRITE ${folder}/CMakeLists.txt "cmake_minimum_required(VERSION 3.16)
project(alone LANGUAGES ${language})
find_package(insitu REQUIRED)
find_package(MPI REQUIRED COMPONENTS ${language})
add_executable(alone ${sources})
target_link_libraries(alone PRIVATE insitu::insitu MPI::MPI_${language})
")
  run(${CMAKE_COMMAND} -G ${GENERATOR} -S ${folder} -B ${folder}/build -DCMAKE_PREFIX_PATH=${prefix}
    -DCMAKE_FIND_USE_PACKAGE_REGISTRY=OFF ${compiler} "-DCMAKE_${language}_FLAGS=${FLAGS}")
  run(${CMAKE_COMMAND} --build ${folder}/build)
endfunction()
build_alone(CXX -DCMAKE_CXX_COMPILER=${CXX} ${SOURCE}/outside_user.cpp)
run(${FOLDER}/alone_CXX/build/alone)
if(WITH_FORTRAN)
  build_alone(Fortran -Wno-dev "${SOURCE}/../../examples/six_calls.f90 \${insitu_FORTRAN_SOURCE}")
endif()

# Python's module finds the library from where it is installed.
if(PYTHON)
  set(ENV{PYTHONPATH} ${prefix}/${PYTHON_DIR})
  run(${PYTHON} -c "import insitu\nassert insitu.__file__.startswith('${prefix}/')")
endif()

# By pkg-config, as a makefile would; by the library's own compiler, as a static one needs its OpenMP.
set(ENV{OMPI_CC} ${CC})
set(ENV{MPICH_CC} ${CC})
set(ENV{PKG_CONFIG_PATH} ${prefix}/${LIBDIR}/pkgconfig)
execute_process(COMMAND ${PKG_CONFIG} --cflags --libs insitu
  OUTPUT_VARIABLE flags OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
separate_arguments(flags UNIX_COMMAND "${flags} ${FLAGS}")
run(${MPICC} ${SOURCE}/outside_user.c -o ${FOLDER}/by_pkg_config ${flags} -Wl,-rpath,${prefix}/${LIBDIR})
run(${FOLDER}/by_pkg_config)
execute_process(COMMAND ${PKG_CONFIG} --static --cflags --libs insitu
  OUTPUT_VARIABLE flags OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
string(REPLACE "-linsitu" "-l:libinsitu.a" flags "${flags} ${FLAGS}")
separate_arguments(flags UNIX_COMMAND "${flags}")
run(${MPICC} ${SOURCE}/outside_user.c -o ${FOLDER}/static_by_pkg_config ${flags})
run(${FOLDER}/static_by_pkg_config)

# An installation can be taken away.
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${FOLDER}/again)
run(${CMAKE_COMMAND} -DMANIFEST=${BUILD}/install_manifest.txt -P ${SOURCE}/../../cmake/uninstall.cmake)
if(EXISTS ${FOLDER}/again)
  message(FATAL_ERROR "uninstall left ${FOLDER}/again")
endif()
