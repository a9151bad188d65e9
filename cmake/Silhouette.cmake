# The vocabulary of the build: silhouette_library, silhouette_program, silhouette_test.

set(SILHOUETTE_SANITIZE "" CACHE STRING "Sanitizers to build with, as -fsanitize= takes them")

add_library(silhouette_options INTERFACE)
target_compile_options(silhouette_options INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual -Wundef -Werror)
target_include_directories(silhouette_options INTERFACE ${PROJECT_SOURCE_DIR})
target_link_libraries(silhouette_options INTERFACE Threads::Threads)
if(SILHOUETTE_SANITIZE)
  add_compile_options(-fsanitize=${SILHOUETTE_SANITIZE} -fno-omit-frame-pointer)
  add_link_options(-fsanitize=${SILHOUETTE_SANITIZE})
  # GCC takes instrumented library code for reading uninitialised memory (GCC manual, -fsanitize).
  add_compile_options(-Wno-maybe-uninitialized)
  if(SILHOUETTE_SANITIZE MATCHES "undefined")
    # Left out is what doubles the time to compile and what the address sanitizer or the processor
    # tells of all the same, when it happens: null pointers and objects that are too small.
    add_compile_options(-fno-sanitize-recover=undefined
      -fno-sanitize=null,alignment,vptr,object-size,nonnull-attribute,returns-nonnull-attribute
      -fno-sanitize=pointer-overflow)
  endif()
endif()

# silhouette_library(NAME SOURCES a.cc b.cc [PUBLIC targets] [PRIVATE targets])
# A static library silhouette_NAME, alias silhouette::NAME. Its headers are included by their path
# from the project's root. Which targets may be linked is said in docs/architecture.md and checked
# by tests/architecture_test.
function(silhouette_library name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;PUBLIC;PRIVATE")
  add_library(silhouette_${name} STATIC ${arg_SOURCES})
  add_library(silhouette::${name} ALIAS silhouette_${name})
  set_target_properties(silhouette_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  target_link_libraries(silhouette_${name}
    PUBLIC ${arg_PUBLIC} PRIVATE ${arg_PRIVATE} $<BUILD_INTERFACE:silhouette_options>)
  target_include_directories(silhouette_${name} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>)
endfunction()

# All programs.
add_custom_target(programs)

# silhouette_program(NAME SOURCES main.cc ... LIBRARIES targets)
# A program build/<preset>/bin/NAME that is installed with the project. With sanitizers it is built
# only if asked for: its commands are half of all there is to compile, and call what the tests of
# the libraries look into.
function(silhouette_program name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;LIBRARIES")
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE ${arg_LIBRARIES} silhouette_options)
  if(SILHOUETTE_SANITIZE)
    set_target_properties(${name} PROPERTIES EXCLUDE_FROM_ALL ON)
  endif()
  add_dependencies(programs ${name})
  install(TARGETS ${name} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT programs)
endfunction()

# All tests of the label `threads`: what the thread-sanitizer run builds.
add_custom_target(thread_tests)

# silhouette_test(NAME SOURCES a_test.cc ... LIBRARIES targets
#                 [LABELS labels] [TIMEOUT seconds] [DEPENDS targets])
# A GoogleTest program whose tests CTest lists one by one. The label `threads` puts it into the
# thread-sanitizer run. DEPENDS names the programs that the tests start; with sanitizers there are
# no such tests.
function(silhouette_test name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "TIMEOUT" "SOURCES;LIBRARIES;LABELS;DEPENDS")
  if(arg_DEPENDS AND SILHOUETTE_SANITIZE)
    return()
  endif()
  add_executable(${name} ${arg_SOURCES})
  set_target_properties(${name} PROPERTIES
    RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests)
  target_link_libraries(${name} PRIVATE
    ${arg_LIBRARIES} GTest::gmock GTest::gtest GTest::gtest_main silhouette_options)
  target_compile_definitions(${name} PRIVATE
    SILHOUETTE_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
    SILHOUETTE_BIN_DIR="${CMAKE_RUNTIME_OUTPUT_DIRECTORY}")
  if(arg_DEPENDS)
    add_dependencies(${name} ${arg_DEPENDS})
  endif()
  if("threads" IN_LIST arg_LABELS)
    add_dependencies(thread_tests ${name})
  endif()
  if(NOT arg_TIMEOUT)
    set(arg_TIMEOUT 120)
  endif()
  # A property without a value would take the next one's name for it.
  set(properties TIMEOUT ${arg_TIMEOUT})
  if(arg_LABELS)
    list(APPEND properties LABELS "${arg_LABELS}")
  endif()
  gtest_discover_tests(${name} DISCOVERY_TIMEOUT 60 PROPERTIES ${properties})
endfunction()
