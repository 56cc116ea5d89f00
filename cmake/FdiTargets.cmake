# Our libraries, programs and tests, each one line in its own folder.

set(FDI_WARNINGS
    -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wold-style-cast
    -Wnon-virtual-dtor -Woverloaded-virtual -Wimplicit-fallthrough
    -Wdouble-promotion)

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
  target_include_directories(${target} PUBLIC ${PROJECT_SOURCE_DIR})
  if(FDI_WERROR)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(FDI_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=${FDI_SANITIZE}
                           -fno-omit-frame-pointer -fno-sanitize-recover=all)
    target_link_options(${target} PUBLIC -fsanitize=${FDI_SANITIZE})
  endif()
  if(FDI_TIDY)
    set_target_properties(${target} PROPERTIES CXX_CLANG_TIDY clang-tidy)
  endif()
endfunction()

# Tests and command lines under sanitizers: twice as fast to build without
# optimisation. Not where numerical templates are: the linker takes any copy.
function(fdi_quick_build target)
  if(FDI_SANITIZE AND NOT FDI_FUZZ)
    target_compile_options(${target} PRIVATE -O0)
  endif()
endfunction()

# fdi_library(name SOURCES a.cpp ... [PUBLIC lib ...] [PRIVATE lib ...])
function(fdi_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(${name} STATIC ${ARG_SOURCES})
  target_link_libraries(${name} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
  fdi_settings(${name})
  if(name MATCHES "_(app|cli|console)$")
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
  fdi_quick_build(${name})
  install(TARGETS ${name} RUNTIME)
endfunction()

# fdi_test(name [NUMERICAL] LABEL unit|system SOURCES a_test.cpp ... LIBRARIES lib ...)
function(fdi_test name)
  cmake_parse_arguments(ARG "NUMERICAL" "LABEL" "SOURCES;LIBRARIES" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LIBRARIES} GTest::gtest
                        GTest::gmock GTest::gtest_main)
  fdi_settings(${name})
  if(NOT ARG_NUMERICAL)
    fdi_quick_build(${name})
  endif()
  if(NOT TARGET ${ARG_LABEL}_tests)
    add_custom_target(${ARG_LABEL}_tests)  # unit_tests, system_tests
  endif()
  add_dependencies(${ARG_LABEL}_tests ${name})
  gtest_discover_tests(${name} DISCOVERY_TIMEOUT 60
                       PROPERTIES LABELS ${ARG_LABEL} TIMEOUT 120)
endfunction()
