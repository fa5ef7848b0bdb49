# `cmake --install` makes a folder that runs from anywhere: bin/tetpbd, bin/tetgen, lib/tetpbd with the libraries they need,
# share/tetpbd with the models, the pages and the licences of all that is in it. Component `program`.
# `cmake --build --preset release --target package` packs it, with a start script, into tetpbd-VERSION-linux-PROCESSOR.tar.gz
# and writes the checksum beside it. Components `program` and `bundle`.
#
# libc and OpenGL's own libraries belong to the machine and its driver. A driver loads libraries too (C++, X11, compression), as
# new as the driver is: those stay out of the program's path, each in a folder of lib/tetpbd/system, from which the start script
# takes what the machine lacks.
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME program)
set_target_properties(tetpbd PROPERTIES INSTALL_RPATH "$ORIGIN/../lib/tetpbd")
target_link_options(tetpbd PRIVATE -Wl,--disable-new-dtags)
install(TARGETS tetpbd RUNTIME DESTINATION bin)
install(DIRECTORY models/ DESTINATION share/tetpbd/models)
install(FILES LICENSE README.md CHANGELOG.md CITATION.cff DESTINATION share/tetpbd)
install(DIRECTORY docs/ DESTINATION share/tetpbd/docs
        FILES_MATCHING PATTERN "*.md" PATTERN "*.png" PATTERN "*.gif" PATTERN "*.svg" PATTERN "*.jpg"
        PATTERN "*.webp" PATTERN "*.html")
install(PROGRAMS cmake/start.sh DESTINATION . RENAME tetpbd COMPONENT bundle EXCLUDE_FROM_ALL)
find_program(TETGEN_PROGRAM tetgen)
if(TETGEN_PROGRAM)
  install(PROGRAMS ${TETGEN_PROGRAM} DESTINATION bin)
else()
  message(WARNING "no program tetgen: the bundle will fill no surfaces")
endif()
install(CODE [[
  find_program(PATCHELF patchelf)
  if(NOT PATCHELF)
    message(FATAL_ERROR "patchelf not found: install the package patchelf")
  endif()
  set(prefix "$ENV{DESTDIR}${CMAKE_INSTALL_PREFIX}")
  function(set_library_path path file)
    execute_process(COMMAND ${PATCHELF} --force-rpath --set-rpath "${path}" "${file}" COMMAND_ERROR_IS_FATAL ANY)
  endfunction()
  file(GLOB programs "${prefix}/bin/tetpbd" "${prefix}/bin/tetgen")
  file(GET_RUNTIME_DEPENDENCIES EXECUTABLES ${programs}
    RESOLVED_DEPENDENCIES_VAR found UNRESOLVED_DEPENDENCIES_VAR missing
    PRE_EXCLUDE_REGEXES "^ld-linux.*" "^lib(c|m|dl|rt|pthread|resolv)\\.so.*"
                        "^lib(GL|EGL|OpenGL|GLX|GLdispatch)\\.so.*")
  if(missing)
    message(FATAL_ERROR "not found for the bundle: ${missing}")
  endif()
  # libGL has all that libOpenGL has, which many machines lack.
  execute_process(COMMAND ${PATCHELF} --replace-needed libOpenGL.so.0 libGL.so.1 "${prefix}/bin/tetpbd" COMMAND_ERROR_IS_FATAL ANY)
  if(EXISTS "${prefix}/bin/tetgen")
    set_library_path("$ORIGIN/../lib/tetpbd" "${prefix}/bin/tetgen")
  endif()
  # Their licences, and those of headers inside the program, as Debian has them (elsewhere: none).
  set(packages libeigen3-dev libglm-dev nlohmann-json3-dev libcli11-dev libfmt-dev libimgui-dev fonts-dejavu-core tetgen)
  foreach(library ${found})
    get_filename_component(name "${library}" NAME)
    set(folder lib/tetpbd)
    if(name MATCHES "^lib(stdc\\+\\+|gcc_s|X11|xcb|Xau|Xdmcp|bsd|md|z|zstd|lzma|lz4|bz2)\\.so")
      set(folder lib/tetpbd/system/${name})
    endif()
    # Under the name that others ask for, without links: the archive may be unpacked anywhere.
    file(REAL_PATH "${library}" file)
    file(INSTALL DESTINATION "${CMAKE_INSTALL_PREFIX}/${folder}" FILES "${file}" RENAME "${name}")
    if(folder STREQUAL lib/tetpbd)
      set_library_path("$ORIGIN" "${prefix}/${folder}/${name}")
    endif()
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
    file(WRITE "${prefix}/share/tetpbd/licences/tetgen-source"
         "bin/tetgen is Debian's, but for where it looks for libraries. Its source: https://snapshot.debian.org/package/tetgen/${version}/\n")
  endif()
]])
set(CPACK_GENERATOR TGZ)
set(CPACK_PACKAGE_CHECKSUM SHA256)
set(CPACK_PACKAGE_FILE_NAME "tetpbd-${PROJECT_VERSION}-linux-${CMAKE_SYSTEM_PROCESSOR}")
set(CPACK_PACKAGE_VENDOR "the tetpbd developers")
set(CPACK_INSTALL_CMAKE_PROJECTS "${CMAKE_BINARY_DIR};tetpbd;program;/" "${CMAKE_BINARY_DIR};tetpbd;bundle;/")
include(CPack)
