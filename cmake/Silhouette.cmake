# SPDX-License-Identifier: Apache-2.0
# The vocabulary of the build: silhouette_folders, silhouette_library, silhouette_program,
# silhouette_tests. A folder is a target and holds all of its sources; the target of db/mask is
# silhouette::db_mask.

set(SILHOUETTE_SANITIZE "" CACHE STRING "Sanitizers to build with, as -fsanitize= takes them")

add_library(silhouette_options INTERFACE)
target_compile_options(silhouette_options INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual -Wundef)
if(CMAKE_UNITY_BUILD)
  # GCC takes a source that a unity source includes for a header, and an anonymous namespace in a
  # header for a mistake.
  target_compile_options(silhouette_options INTERFACE -Wno-subobject-linkage)
endif()
target_include_directories(silhouette_options INTERFACE ${PROJECT_SOURCE_DIR})
target_link_libraries(silhouette_options INTERFACE Threads::Threads)

# What was compiled before, in this or another clone, is not compiled again: no object names the clone's place.
target_compile_options(silhouette_options INTERFACE -ffile-prefix-map=${PROJECT_SOURCE_DIR}/=)
find_program(CCACHE ccache)
if(CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(CMAKE_CXX_COMPILER_LAUNCHER
    ${CMAKE_COMMAND} -E env CCACHE_BASEDIR=${PROJECT_SOURCE_DIR} CCACHE_NOHASHDIR=1 ${CCACHE})
endif()
# gold links in a fifth of the default linker's time. (lld 14 is faster still, but with it some exceptions of GCC 12's
# unity builds abort the program while they unwind.)
find_program(GOLD ld.gold)
if(GOLD)
  add_link_options(-fuse-ld=gold)
endif()

if(SILHOUETTE_SANITIZE)
  add_compile_options(-fsanitize=${SILHOUETTE_SANITIZE} -fno-omit-frame-pointer)
  add_link_options(-fsanitize=${SILHOUETTE_SANITIZE})
  # GCC takes instrumented library code for reading uninitialised memory (GCC manual, -fsanitize).
  add_compile_options(-Wno-maybe-uninitialized)
  if(SILHOUETTE_SANITIZE MATCHES "undefined")
    # Left out is what doubles the time to compile and what the address sanitizer or the processor
    # reports all the same, when it happens: null pointers and objects that are too small.
    add_compile_options(-fno-sanitize-recover=undefined
      -fno-sanitize=null,alignment,vptr,object-size,nonnull-attribute,returns-nonnull-attribute
      -fno-sanitize=pointer-overflow)
  endif()
endif()

# silhouette_folders(FOLDER ...)
# Adds the folders, and all below them, that have a CMakeLists.txt.
function(silhouette_folders)
  foreach(folder IN LISTS ARGN)
    file(GLOB_RECURSE lists RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} CONFIGURE_DEPENDS
      ${folder}/CMakeLists.txt)
    list(FILTER lists EXCLUDE REGEX "/example/")
    if(SILHOUETTE_SANITIZE)
      list(FILTER lists EXCLUDE REGEX "experiments")
    endif()
    list(SORT lists)
    foreach(list IN LISTS lists)
      cmake_path(GET list PARENT_PATH place)
      add_subdirectory(${place})
    endforeach()
  endforeach()
endfunction()

# The target's name, folder and sources, in the caller's variables `name`, `folder` and `sources`.
macro(silhouette_folder)
  file(RELATIVE_PATH folder ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})
  string(REGEX REPLACE "[/-]" "_" name ${folder})
  file(GLOB sources CONFIGURE_DEPENDS *.cc)
endmacro()

# Notes what a folder links, for docs/architecture.md and the test of the arrows.
function(silhouette_note_links folder)
  list(JOIN ARGN " " links)
  set_property(GLOBAL APPEND PROPERTY SILHOUETTE_LINKS "${folder}: ${links}")
endfunction()

# Makes the templates of pages in this folder (*.html, *.css, *.js) constants of the header
# <folder>/templates.h: page.html is silhouette::templates::page_html.
function(silhouette_embed_templates target)
  silhouette_folder()
  file(GLOB files CONFIGURE_DEPENDS *.html *.css *.js)
  if(NOT files)
    return()
  endif()
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${files})
  set(header "#pragma once\n\nnamespace silhouette::templates {\n\n")
  foreach(file IN LISTS files)
    file(READ ${file} text)
    cmake_path(GET file FILENAME file)
    string(MAKE_C_IDENTIFIER ${file} constant)
    string(APPEND header "inline constexpr char ${constant}[] = R\"template(${text})template\";\n\n")
  endforeach()
  string(APPEND header "}  // namespace silhouette::templates\n")
  file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/generated/${folder}/templates.h
    CONTENT "${header}" @ONLY)
  target_include_directories(${target} PRIVATE ${PROJECT_BINARY_DIR}/generated)
endfunction()

# silhouette_library([SOURCES more.cc ...] [PUBLIC targets] [PRIVATE targets])
# A static library of all sources in this folder. Its headers are included by their path from the
# project's root. A folder without sources is a library of headers alone. With sanitizers it is built
# only if a test needs it.
function(silhouette_library)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" "" "SOURCES;PUBLIC;PRIVATE")
  silhouette_folder()
  silhouette_note_links(${folder} ${arg_PUBLIC} ${arg_PRIVATE})
  if(NOT sources)
    add_library(silhouette_${name} INTERFACE)
    add_library(silhouette::${name} ALIAS silhouette_${name})
    target_link_libraries(silhouette_${name} INTERFACE ${arg_PUBLIC})
    return()
  endif()
  add_library(silhouette_${name} STATIC ${sources} ${arg_SOURCES})
  add_library(silhouette::${name} ALIAS silhouette_${name})
  set_target_properties(silhouette_${name} PROPERTIES
    POSITION_INDEPENDENT_CODE ON UNITY_BUILD_BATCH_SIZE 0)
  if(SILHOUETTE_SANITIZE)
    set_target_properties(silhouette_${name} PROPERTIES EXCLUDE_FROM_ALL ON)
  endif()
  target_link_libraries(silhouette_${name}
    PUBLIC ${arg_PUBLIC} PRIVATE ${arg_PRIVATE} $<BUILD_INTERFACE:silhouette_options>)
  target_include_directories(silhouette_${name} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>)
  silhouette_embed_templates(silhouette_${name})
endfunction()

# All programs.
add_custom_target(programs)

# silhouette_program(LIBRARIES targets)
# A program build/<preset>/bin/<folder's name> that is installed with the project. With sanitizers it is built
# only if asked for: the libraries that it calls have tests of their own.
function(silhouette_program)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" "" "LIBRARIES")
  silhouette_folder()
  cmake_path(GET folder FILENAME program)
  silhouette_note_links(${folder} ${arg_LIBRARIES})
  add_executable(${program} ${sources})
  set_target_properties(${program} PROPERTIES UNITY_BUILD_BATCH_SIZE 0)
  target_link_libraries(${program} PRIVATE ${arg_LIBRARIES} silhouette_options)
  # A program parses, calls and prints: this takes two thirds of the time to compile.
  target_compile_options(${program} PRIVATE -Og)
  silhouette_embed_templates(${program})
  if(SILHOUETTE_SANITIZE)
    set_target_properties(${program} PROPERTIES EXCLUDE_FROM_ALL ON)
  endif()
  add_dependencies(programs ${program})
  # Whoever asks a server need not install one.
  set(component programs)
  if(program STREQUAL "silhouette-server")
    set(component server)
  endif()
  install(TARGETS ${program} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT ${component})
  install(FILES ${PROJECT_SOURCE_DIR}/cmake/package/completion.bash RENAME ${program}
    DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT ${component})
  install(FILES ${PROJECT_SOURCE_DIR}/cmake/package/completion.zsh RENAME _${program}
    DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions COMPONENT ${component})
endfunction()

# silhouette_tests([LIBRARIES targets] [THREADS a_test.cc ...] [SOURCES more.cc ...] [LABELS label]
#                  [DEPENDS programs])
# One GoogleTest program of all sources in this folder, whose suites CTest lists one by one. THREADS
# names the sources that run in several threads: the thread sanitizer's build has only these.
# DEPENDS names the programs that the tests start; with sanitizers there are no such tests.
function(silhouette_tests)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" "LABELS" "LIBRARIES;THREADS;SOURCES;DEPENDS")
  silhouette_folder()
  list(APPEND sources ${arg_SOURCES})
  if(SILHOUETTE_SANITIZE STREQUAL "thread")
    set(sources ${arg_THREADS})
  endif()
  if(NOT sources OR (arg_DEPENDS AND SILHOUETTE_SANITIZE))
    return()
  endif()
  string(REPLACE "tests_" "" name ${name})
  set(test ${name}_test)
  add_executable(${test} ${sources})
  set_target_properties(${test} PROPERTIES
    RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests UNITY_BUILD_BATCH_SIZE 0)
  target_link_libraries(${test} PRIVATE
    ${arg_LIBRARIES} silhouette_test_folders GTest::gmock GTest::gtest GTest::gtest_main silhouette_options)
  # Half the time to compile; the product's sources keep the optimisation that is tested.
  target_compile_options(${test} PRIVATE -Og)
  if(arg_DEPENDS)
    add_dependencies(${test} ${arg_DEPENDS})
  endif()
  # A property without a value would take the next one's name for it.
  set(properties TIMEOUT 900)
  if(arg_LABELS)
    list(APPEND properties LABELS ${arg_LABELS})
  endif()
  list(JOIN properties " " properties)
  set(suites ${CMAKE_CURRENT_BINARY_DIR}/suites.cmake)
  if(NOT EXISTS ${suites})
    file(WRITE ${suites} "add_test(${test}_is_not_built ${test}_is_not_built)\n")
  endif()
  add_custom_command(TARGET ${test} POST_BUILD VERBATIM BYPRODUCTS ${suites} COMMAND ${CMAKE_COMMAND}
    -D PROGRAM=$<TARGET_FILE:${test}> -D PROPERTIES=${properties} -D FILE=${suites}
    -P ${PROJECT_SOURCE_DIR}/cmake/ListSuites.cmake)
  set_property(DIRECTORY APPEND PROPERTY TEST_INCLUDE_FILES ${suites})
endfunction()

# Writes the link graph as architecture.txt: a line a folder, in the order of the rooms, as
# "server/live: silhouette::server_scene ... spdlog::spdlog". tools/architecture makes the table in
# docs/architecture.md of it, tests/tools/architecture checks it.
function(silhouette_write_architecture)
  get_property(links GLOBAL PROPERTY SILHOUETTE_LINKS)
  list(JOIN links "\n" text)
  file(WRITE ${PROJECT_BINARY_DIR}/architecture.txt "${text}\n")
endfunction()
