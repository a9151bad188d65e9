# SPDX-License-Identifier: Apache-2.0
# cmake -D PROGRAM=<path> -D "PROPERTIES=TIMEOUT 900" -D FILE=<path> -P ListSuites.cmake
# Writes FILE, which CTest includes: one test for each suite of a GoogleTest program. With hundreds of shared libraries
# a program takes longer to start than most tests take to run: tests of a suite share a process and what it sets up.
execute_process(COMMAND ${PROGRAM} --gtest_list_tests OUTPUT_VARIABLE list COMMAND_ERROR_IS_FATAL ANY)
string(REGEX MATCHALL "\n[A-Za-z0-9_/]+\\.[ \n]" suites "\n${list}")
set(text "")
foreach(suite IN LISTS suites)
  string(REGEX REPLACE "[. \n]" "" suite ${suite})
  string(APPEND text "add_test(${suite} [==[${PROGRAM}]==] --gtest_filter=${suite}.*)\n"
    "set_tests_properties(${suite} PROPERTIES ${PROPERTIES})\n")
endforeach()
if(NOT suites)
  message(FATAL_ERROR "${PROGRAM} lists no tests")
endif()
file(WRITE ${FILE} "${text}")
