# MPICH's MPI_STATUSES_IGNORE is the address 1, which gcc takes for an array that is too short.
if(CMAKE_C_COMPILER_ID STREQUAL "GNU")
  include(CheckCSourceCompiles)
  set(CMAKE_REQUIRED_LIBRARIES MPI::MPI_C)
  set(CMAKE_REQUIRED_FLAGS "-O2 -Wall -Werror=stringop-overflow")
  check_c_source_compiles("#include <mpi.h>
    int main(void) { MPI_Request r[1] = {MPI_REQUEST_NULL}; return MPI_Waitall(1, r, MPI_STATUSES_IGNORE); }"
    INSITU_STATUSES_IGNORE_IS_QUIET)
  unset(CMAKE_REQUIRED_LIBRARIES)
  unset(CMAKE_REQUIRED_FLAGS)
  if(NOT INSITU_STATUSES_IGNORE_IS_QUIET)
    # In the cache too: a later find_package(MPI) sets the target's options anew.
    set(quiet $<$<COMPILE_LANGUAGE:C,CXX>:-Wno-stringop-overflow>)
    list(APPEND MPI_C_COMPILE_OPTIONS ${quiet})
    list(REMOVE_DUPLICATES MPI_C_COMPILE_OPTIONS)
    set(MPI_C_COMPILE_OPTIONS ${MPI_C_COMPILE_OPTIONS} CACHE STRING "MPI C compilation options" FORCE)
    target_compile_options(MPI::MPI_C INTERFACE ${quiet})
  endif()
endif()
