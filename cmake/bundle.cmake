# `cmake --install` and CPack make a folder that runs from anywhere: bin/tetpbd, lib/ with the libraries it needs except
# libc's and OpenGL's own (those belong to the machine and its driver; GLEW's X11 client libraries come along), bin/tetgen,
# share/tetpbd with the models and the licences of all that is in it. Component `program`, which alone the archive holds.
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME program)
set_target_properties(tetpbd PROPERTIES INSTALL_RPATH "$ORIGIN/../lib")
target_link_options(tetpbd PRIVATE -Wl,--disable-new-dtags)
install(TARGETS tetpbd RUNTIME DESTINATION bin)
install(DIRECTORY models/ DESTINATION share/tetpbd/models)
install(FILES LICENSE README.md CITATION.cff DESTINATION share/tetpbd)
find_program(TETGEN_PROGRAM tetgen)
if(TETGEN_PROGRAM)
  install(PROGRAMS ${TETGEN_PROGRAM} DESTINATION bin)
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
  # Their licences, and those of headers inside the program, as Debian has them (elsewhere: none).
  set(packages libeigen3-dev libglm-dev nlohmann-json3-dev libcli11-dev libfmt-dev libimgui-dev fonts-dejavu-core tetgen)
  foreach(library ${found})
    file(INSTALL DESTINATION "${CMAKE_INSTALL_PREFIX}/lib" TYPE SHARED_LIBRARY FOLLOW_SYMLINK_CHAIN FILES "${library}")
    get_filename_component(name "${library}" NAME)
    execute_process(COMMAND patchelf --force-rpath --set-rpath "$ORIGIN" "${CMAKE_INSTALL_PREFIX}/lib/${name}")
    file(REAL_PATH "${library}" file)
    string(REGEX REPLACE "^/usr" "" short "${file}")  # as packages of before the merged /usr name it
    execute_process(COMMAND dpkg-query -S "${file}" "${short}" OUTPUT_VARIABLE owner ERROR_QUIET)
    if(owner MATCHES "^([^:]+):")
      list(APPEND packages ${CMAKE_MATCH_1})
    endif()
  endforeach()
  list(REMOVE_DUPLICATES packages)
  foreach(package ${packages})
    if(EXISTS /usr/share/doc/${package}/copyright)
      file(INSTALL DESTINATION "${CMAKE_INSTALL_PREFIX}/share/tetpbd/licences" RENAME ${package} FOLLOW_SYMLINK_CHAIN
           FILES /usr/share/doc/${package}/copyright)
    endif()
  endforeach()
  execute_process(COMMAND dpkg-query -W -f "\${Version}" tetgen OUTPUT_VARIABLE version ERROR_QUIET)
  if(version)
    file(WRITE "${CMAKE_INSTALL_PREFIX}/share/tetpbd/licences/tetgen-source"
         "bin/tetgen is Debian's, but for where it looks for libraries. Its source: https://snapshot.debian.org/package/tetgen/${version}/\n")
  endif()
]])
set(CPACK_GENERATOR TGZ)
set(CPACK_INSTALL_CMAKE_PROJECTS "${CMAKE_BINARY_DIR};tetpbd;program;/")
set(CPACK_PACKAGE_FILE_NAME "tetpbd-${PROJECT_VERSION}-linux-${CMAKE_SYSTEM_PROCESSOR}")
set(CPACK_PACKAGE_VENDOR "the tetpbd developers")
include(CPack)
