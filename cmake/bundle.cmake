# `cmake --install` and CPack make a folder that runs from anywhere: bin/tetpbd, lib/ with the libraries it needs except
# libc's and OpenGL's own (those belong to the machine and its driver; GLEW's X11 client libraries come along), bin/tetgen, share/tetpbd/models.
set_target_properties(tetpbd PROPERTIES INSTALL_RPATH "$ORIGIN/../lib")
target_link_options(tetpbd PRIVATE -Wl,--disable-new-dtags)
install(TARGETS tetpbd RUNTIME DESTINATION bin)
install(DIRECTORY models/ DESTINATION share/tetpbd/models)
install(FILES LICENSE README.md DESTINATION share/tetpbd)
find_program(TETGEN_PROGRAM tetgen)
if(TETGEN_PROGRAM)
  install(PROGRAMS ${TETGEN_PROGRAM} DESTINATION bin)
  install(FILES /usr/share/doc/tetgen/copyright DESTINATION share/tetpbd RENAME tetgen-copyright OPTIONAL)
else()
  message(WARNING "no program tetgen: the bundle will fill no surfaces")
endif()
install(CODE [[
  file(GLOB programs "${CMAKE_INSTALL_PREFIX}/bin/tet*")
  file(GET_RUNTIME_DEPENDENCIES EXECUTABLES ${programs}
    RESOLVED_DEPENDENCIES_VAR found UNRESOLVED_DEPENDENCIES_VAR missing
    PRE_EXCLUDE_REGEXES "^ld-linux.*" "^lib(c|m|dl|rt|pthread|resolv)\\.so.*"
                        "^lib(GL|EGL|OpenGL|GLX|GLdispatch)\\.so.*")
  if(missing)
    message(FATAL_ERROR "not found for the bundle: ${missing}")
  endif()
  execute_process(COMMAND patchelf --force-rpath --set-rpath "$ORIGIN/../lib" "${CMAKE_INSTALL_PREFIX}/bin/tetgen")
  foreach(library ${found})
    file(INSTALL DESTINATION "${CMAKE_INSTALL_PREFIX}/lib" TYPE SHARED_LIBRARY FOLLOW_SYMLINK_CHAIN FILES "${library}")
    get_filename_component(name "${library}" NAME)
    execute_process(COMMAND patchelf --force-rpath --set-rpath "$ORIGIN" "${CMAKE_INSTALL_PREFIX}/lib/${name}")
  endforeach()
]])
set(CPACK_GENERATOR TGZ)
set(CPACK_PACKAGE_FILE_NAME "tetpbd-${PROJECT_VERSION}-linux-x86_64")
include(CPack)
