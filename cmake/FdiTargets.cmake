# Our libraries, programs and tests, each one line in its own folder.

set(FDI_WARNINGS
    -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wold-style-cast
    -Wnon-virtual-dtor -Woverloaded-virtual -Wimplicit-fallthrough
    -Wdouble-promotion)
# False alarms of GCC 12 inside its own headers, gone in 13: operator+(const
# char*, std::string&&) (GCC bug 105651), vector<std::byte>::insert.
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS
                                          13)
  list(APPEND FDI_WARNINGS -Wno-restrict -Wno-stringop-overflow
       -Wno-stringop-overread)
endif()

# Clang checks the use of members that a mutex guards: base/mutex.h.
if(CMAKE_CXX_COMPILER_ID STREQUAL Clang)
  list(APPEND FDI_WARNINGS -Werror=thread-safety)
endif()

find_package(Git QUIET)
set(FDI_REVISION "unknown")
if(GIT_FOUND)
  execute_process(
    COMMAND ${GIT_EXECUTABLE} describe --always --dirty
    WORKING_DIRECTORY ${PROJECT_SOURCE_DIR}
    OUTPUT_VARIABLE FDI_REVISION_FOUND OUTPUT_STRIP_TRAILING_WHITESPACE
    ERROR_QUIET)
  if(FDI_REVISION_FOUND)
    set(FDI_REVISION ${FDI_REVISION_FOUND})
  endif()
endif()

# Settings of every target of ours: no fused multiply-add, so that the same
# sample gives the same bits on every machine.
function(fdi_settings target)
  target_compile_options(${target} PRIVATE ${FDI_WARNINGS} -ffp-contract=off)
  if(FDI_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(FDI_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=${FDI_SANITIZE}
                           -fno-omit-frame-pointer -fno-sanitize-recover=all)
    target_link_options(${target} PUBLIC -fsanitize=${FDI_SANITIZE})
  endif()
endfunction()

# A target sees its own headers and those of the targets that it links, and no
# others: the compiler enforces the layers. The headers of each folder are
# linked into a directory of their own, include/TARGET/FOLDER/.
function(fdi_headers target visibility)
  set(root ${PROJECT_BINARY_DIR}/include/${target})
  file(RELATIVE_PATH folder ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})
  file(GLOB headers CONFIGURE_DEPENDS *.h)
  file(REMOVE_RECURSE ${root})
  file(MAKE_DIRECTORY ${root}/${folder})
  foreach(header ${headers})
    cmake_path(GET header FILENAME name)
    file(CREATE_LINK ${header} ${root}/${folder}/${name} SYMBOLIC)
  endforeach()
  target_include_directories(${target} ${visibility} ${root})
endfunction()

# Headers of tests and benchmarks, which tests and benchmarks alone may see.
function(fdi_test_headers target)
  set(root ${PROJECT_BINARY_DIR}/include/of_tests)
  file(MAKE_DIRECTORY ${root})
  foreach(folder tests bench)
    file(CREATE_LINK ${PROJECT_SOURCE_DIR}/${folder} ${root}/${folder} SYMBOLIC)
  endforeach()
  target_include_directories(${target} PUBLIC ${root})
endfunction()

# With FDI_UNITY the files of a target are compiled in groups of `size`: half the
# time of a build from nothing, most of which goes into the same headers.
function(fdi_unity target size)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${FDI_UNITY}
                                             UNITY_BUILD_BATCH_SIZE ${size})
  if(FDI_UNITY AND CMAKE_CXX_COMPILER_ID STREQUAL GNU)
    # GCC takes the .cpp files of a group for headers.
    target_compile_options(${target} PRIVATE -Wno-subobject-linkage)
  endif()
endfunction()

# Tests, command lines and texts: a third to a half less time of the compiler with
# little optimisation, or none under sanitizers. Not where numerical templates
# are: the linker takes any copy.
function(fdi_quick_build target)
  if(FDI_SANITIZE)
    target_compile_options(${target} PRIVATE -O0)
  else()
    target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1>)
  endif()
endfunction()

# fdi_library(name SOURCES a.cpp ... [PUBLIC lib ...] [PRIVATE lib ...])
function(fdi_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(${name} STATIC ${ARG_SOURCES})
  target_link_libraries(${name} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
  fdi_settings(${name})
  fdi_headers(${name} PUBLIC)
  fdi_unity(${name} 16)
  if(name MATCHES
     "_(program|service|console|gateway|history|import|campaign|report|report_models|plot)$" OR
     name MATCHES "_(planner|planner_live|plant|plant_onboarding)$")
    fdi_quick_build(${name})
  endif()
endfunction()

# fdi_program(name SOURCES main.cpp ... LIBRARIES lib ...)
function(fdi_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LIBRARIES" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LIBRARIES})
  set_target_properties(${name} PROPERTIES
                        RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)
  fdi_settings(${name})
  fdi_headers(${name} PRIVATE)
  fdi_unity(${name} 16)
  fdi_quick_build(${name})
  install(TARGETS ${name} RUNTIME)
endfunction()

# fdi_component(target FDI_COMPONENT SOURCES a.cpp ... LIBRARIES lib ...)
# Adds the component's part to the target if that option is ON; left_out.cpp,
# which sees the option as 0 or 1, stands in for it.
function(fdi_component target option)
  cmake_parse_arguments(ARG "" "" "SOURCES;LIBRARIES" ${ARGN})
  set_property(SOURCE left_out.cpp APPEND PROPERTY
               COMPILE_DEFINITIONS ${option}=$<BOOL:${${option}}>)
  if(${option})
    target_sources(${target} PRIVATE ${ARG_SOURCES})
    target_link_libraries(${target} PRIVATE ${ARG_LIBRARIES})
  endif()
endfunction()

# The headers of most tests, compiled once for all of them. With GCC alone: Clang
# takes such a file only for a test that has the same definitions.
function(fdi_test_precompiled_headers)
  if(NOT FDI_UNITY OR NOT CMAKE_CXX_COMPILER_ID STREQUAL GNU)
    return()
  endif()
  set(source ${CMAKE_CURRENT_BINARY_DIR}/precompiled_headers.cpp)
  file(TOUCH ${source})
  add_library(fdi_precompiled OBJECT ${source})
  target_link_libraries(fdi_precompiled PRIVATE GTest::gmock)
  fdi_settings(fdi_precompiled)
  fdi_quick_build(fdi_precompiled)
  target_precompile_headers(fdi_precompiled PRIVATE <algorithm> <array> <chrono>
    <cmath> <filesystem> <fstream> <functional> <limits> <map> <memory> <optional>
    <random> <set> <sstream> <stdexcept> <string> <thread> <vector>
    <gmock/gmock.h>)
endfunction()

# fdi_test(name [NUMERICAL] [THREADS] [ALONE] [WHOLE] LABEL unit|system [TIMEOUT 120]
#          SOURCES a_test.cpp ... LIBRARIES lib ...)
# NUMERICAL: fully optimised, under sanitizers, too. THREADS: also run under the
# thread sanitizer (preset tsan). ALONE: not beside other tests, for it measures delays.
# WHOLE: one test of ctest, for the cases share what is slow to make.
function(fdi_test name)
  cmake_parse_arguments(ARG "NUMERICAL;THREADS;ALONE;WHOLE" "LABEL;TIMEOUT" "SOURCES;LIBRARIES" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LIBRARIES} GTest::gtest
                        GTest::gmock GTest::gtest_main)
  fdi_settings(${name})
  fdi_test_headers(${name})
  fdi_unity(${name} 8)
  if(NOT ARG_NUMERICAL)
    fdi_quick_build(${name})
    if(TARGET fdi_precompiled)
      target_precompile_headers(${name} REUSE_FROM fdi_precompiled)
    endif()
  endif()
  if(NOT TARGET ${ARG_LABEL}_tests)
    add_custom_target(${ARG_LABEL}_tests)  # unit_tests, system_tests
  endif()
  add_dependencies(${ARG_LABEL}_tests ${name})
  if(ARG_THREADS)
    if(NOT TARGET threaded_tests)
      add_custom_target(threaded_tests)
    endif()
    add_dependencies(threaded_tests ${name})
  endif()
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  set(properties LABELS ${ARG_LABEL} TIMEOUT ${ARG_TIMEOUT}
                 RUN_SERIAL ${ARG_ALONE})
  if(ARG_WHOLE)
    add_test(NAME ${name} COMMAND ${name})
    set_tests_properties(${name} PROPERTIES ${properties})
  else()
    gtest_discover_tests(${name} DISCOVERY_TIMEOUT 60 PROPERTIES ${properties})
  endif()
endfunction()
