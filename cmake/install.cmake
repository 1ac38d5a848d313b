# Installs headers, libraries, insitu::insitu, insitu::blueprint and insitu::vtk for find_package(), and insitu.pc for others. All of it may
# be moved after installation: no file names the prefix. A component is what a Debian package holds (package.cmake).
include(CMakePackageConfigHelpers)
set(insitu_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/insitu)

# The names users link by, for those too who add this tree to theirs.
add_library(insitu::insitu ALIAS insitu)
add_library(insitu::static ALIAS insitu_static)
set_target_properties(insitu_headers PROPERTIES EXPORT_NAME headers)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/libinsitu/include/insitu
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT dev FILES_MATCHING PATTERN "*.h")
install(DIRECTORY ${PROJECT_SOURCE_DIR}/adaptors/blueprint/include/insitu
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT dev FILES_MATCHING PATTERN "*.h")
add_library(insitu::blueprint ALIAS insitu_blueprint)
set_target_properties(insitu_blueprint PROPERTIES EXPORT_NAME blueprint)
install(TARGETS insitu insitu_static insitu_headers insitu_blueprint EXPORT insituTargets
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library NAMELINK_COMPONENT dev
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT dev
  INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(EXPORT insituTargets NAMESPACE insitu:: DESTINATION ${insitu_package_dir} COMPONENT dev)

# Loaded at run time, from beside libinsitu; nobody links it.
if(TARGET insitu_image)
  install(TARGETS insitu_image LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT image)
endif()

# Fortran's is compiled with the user's own code: modules are read by the compiler that wrote them alone.
install(FILES ${PROJECT_SOURCE_DIR}/libinsitu/fortran/insitu.f90 DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/insitu
  COMPONENT dev)

# Python's module finds the library in ../.. or where the loader looks. In the build tree it stands beside the library.
set(INSITU_PYTHON_DIR lib/python3/dist-packages CACHE STRING "Where insitu.py is installed, below the prefix")
install(FILES ${PROJECT_SOURCE_DIR}/libinsitu/python/insitu.py DESTINATION ${INSITU_PYTHON_DIR} COMPONENT python)
configure_file(${PROJECT_SOURCE_DIR}/libinsitu/python/insitu.py ${CMAKE_LIBRARY_OUTPUT_DIRECTORY}/insitu.py COPYONLY)

if(TARGET insitu_vtk)
  add_library(insitu::vtk ALIAS insitu_vtk)
  set_target_properties(insitu_vtk PROPERTIES EXPORT_NAME vtk)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/adaptors/vtk/include/insitu
    DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT dev FILES_MATCHING PATTERN "*.h")
  install(TARGETS insitu_vtk EXPORT insituVtkTargets
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT vtk NAMELINK_COMPONENT dev
    INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  install(EXPORT insituVtkTargets NAMESPACE insitu:: DESTINATION ${insitu_package_dir} COMPONENT dev)
endif()
install(PROGRAMS ${CMAKE_RUNTIME_OUTPUT_DIRECTORY}/insitu-view DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT view)
if(TARGET insitu-render)
  set_target_properties(insitu-render PROPERTIES INSTALL_RPATH "$ORIGIN/../${CMAKE_INSTALL_LIBDIR}")
  install(TARGETS insitu-render RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT tools)
  install(FILES ${PROJECT_SOURCE_DIR}/docs/insitu-render.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT tools)
endif()

configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/insituConfig.cmake.in
  ${PROJECT_BINARY_DIR}/insituConfig.cmake INSTALL_DESTINATION ${insitu_package_dir} PATH_VARS CMAKE_INSTALL_INCLUDEDIR)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/insituConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/insituConfig.cmake ${PROJECT_BINARY_DIR}/insituConfigVersion.cmake
  DESTINATION ${insitu_package_dir} COMPONENT dev)

set(insitu_pc_dir ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
file(RELATIVE_PATH insitu_pc_to_prefix /prefix/${insitu_pc_dir} /prefix)
configure_file(${CMAKE_CURRENT_LIST_DIR}/insitu.pc.in ${PROJECT_BINARY_DIR}/insitu.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/insitu.pc DESTINATION ${insitu_pc_dir} COMPONENT dev)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE ${PROJECT_SOURCE_DIR}/NOTICE DESTINATION ${CMAKE_INSTALL_DOCDIR}
  COMPONENT library)

# Takes away the files that the last installation of this build has put somewhere.
add_custom_target(uninstall COMMAND ${CMAKE_COMMAND} -DMANIFEST=${PROJECT_BINARY_DIR}/install_manifest.txt
  -P ${CMAKE_CURRENT_LIST_DIR}/uninstall.cmake)
