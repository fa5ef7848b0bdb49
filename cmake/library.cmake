# `cmake --install` also makes the simulation a library for other programs (docs/embedding.md): lib/libtetpbd_sim.a with the
# shaders inside it, its headers in include/tetpbd, and a package that find_package(tetpbd) finds. Component `library`.
include(CMakePackageConfigHelpers)
set_target_properties(tetpbd_sim PROPERTIES EXPORT_NAME sim)
set(TETPBD_PACKAGE lib/cmake/tetpbd)
install(TARGETS tetpbd_sim EXPORT tetpbd ARCHIVE DESTINATION lib COMPONENT library)
# What only the library's own files include stays here; formulas are GLSL and C++ at once.
install(DIRECTORY sim shaders DESTINATION include/tetpbd COMPONENT library
        FILES_MATCHING PATTERN "*.h" PATTERN "*.glsl" PATTERN "rotation.h" EXCLUDE PATTERN "shaders/render" EXCLUDE)
install(FILES ${CMAKE_BINARY_DIR}/generated/constraint_formulas.inc ${CMAKE_BINARY_DIR}/generated/obstacle_formulas.inc
        DESTINATION include/tetpbd COMPONENT library)
install(EXPORT tetpbd FILE tetpbd-targets.cmake NAMESPACE tetpbd:: DESTINATION ${TETPBD_PACKAGE} COMPONENT library)
set(TETPBD_WITH_OPENVDB OFF)
if(TARGET tetpbd::openvdb)
  set(TETPBD_WITH_OPENVDB ON)
endif()
configure_package_config_file(cmake/tetpbd-config.cmake.in ${CMAKE_BINARY_DIR}/tetpbd-config.cmake INSTALL_DESTINATION ${TETPBD_PACKAGE}
                              NO_SET_AND_CHECK_MACRO NO_CHECK_REQUIRED_COMPONENTS_MACRO)
# Before 1.0 a minor version may change what programs call.
write_basic_package_version_file(${CMAKE_BINARY_DIR}/tetpbd-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/tetpbd-config.cmake ${CMAKE_BINARY_DIR}/tetpbd-config-version.cmake cmake/openvdb.cmake
        DESTINATION ${TETPBD_PACKAGE} COMPONENT library)
