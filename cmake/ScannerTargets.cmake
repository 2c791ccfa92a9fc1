# The two helpers that every stage's CMakeLists.txt uses.

set(SCANNER_WARNINGS -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wold-style-cast
    -Woverloaded-virtual -Wnon-virtual-dtor)
if(SCANNER_WERROR)
  list(APPEND SCANNER_WARNINGS -Werror)
endif()

# scanner_library(STAGE SOURCES file... [DEPS stage...] [LINK library...] [PRIVATE library...])
# One shared library `scanner_STAGE`; everything it calls must be linked (-z defs), so a stage that
# reaches for a layer above it fails to link.
function(scanner_library STAGE)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPS;LINK;PRIVATE" ${ARGN})
  set(target scanner_${STAGE})
  add_library(${target} SHARED ${ARG_SOURCES})
  target_compile_options(${target} PRIVATE ${SCANNER_WARNINGS})
  target_include_directories(${target} PUBLIC ${PROJECT_SOURCE_DIR}/include
                                       PRIVATE ${PROJECT_SOURCE_DIR}/src)
  target_link_options(${target} PRIVATE -Wl,-z,defs)
  set(dep_targets)
  foreach(dep IN LISTS ARG_DEPS)
    list(APPEND dep_targets scanner_${dep})
  endforeach()
  target_link_libraries(${target} PUBLIC ${dep_targets} ${ARG_LINK} PRIVATE ${ARG_PRIVATE})
  install(TARGETS ${target} LIBRARY DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION})
endfunction()

# scanner_test(STAGE SOURCES file... [LINK library...] [SUFFIX name])
# One gtest binary `test_STAGE` (`test_STAGE_SUFFIX` where a second one is needed); every TEST is a ctest of its own. Suites whose name starts with
# RealData carry the label real_data and find the recordings through SCANNER_DATA.
function(scanner_test STAGE)
  if(NOT BUILD_TESTING)
    return()
  endif()
  cmake_parse_arguments(ARG "" "SUFFIX" "SOURCES;LINK" ${ARGN})
  set(target test_${STAGE})
  if(ARG_SUFFIX)
    string(APPEND target _${ARG_SUFFIX})
  endif()
  add_executable(${target} ${ARG_SOURCES})
  target_compile_options(${target} PRIVATE ${SCANNER_WARNINGS})
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR}/src ${PROJECT_SOURCE_DIR}/test)
  target_compile_definitions(${target} PRIVATE SCANNER_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  target_link_libraries(${target} PRIVATE scanner_${STAGE} ${ARG_LINK} GTest::gtest GTest::gtest_main)
  gtest_discover_tests(${target} TEST_FILTER "-RealData*" DISCOVERY_TIMEOUT 60
                       PROPERTIES LABELS ${STAGE} TIMEOUT 300)
  gtest_discover_tests(${target} TEST_FILTER "RealData*" TEST_LIST ${target}_real
                       DISCOVERY_TIMEOUT 60
                       PROPERTIES LABELS real_data TIMEOUT 900
                       SKIP_REGULAR_EXPRESSION "SKIPPED")
endfunction()

# scanner_executable(NAME SOURCES file... LINK library...)
function(scanner_executable NAME)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${NAME} ${ARG_SOURCES})
  target_compile_options(${NAME} PRIVATE ${SCANNER_WARNINGS})
  target_include_directories(${NAME} PRIVATE ${PROJECT_SOURCE_DIR}/src)
  target_link_libraries(${NAME} PRIVATE ${ARG_LINK})
  install(TARGETS ${NAME} RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
endfunction()

# Files that Highway compiles once per instruction set: plain C++, SSE4, AVX2 and AVX-512, chosen when
# the program runs. SSSE3 gains nothing beside SSE4.
function(scanner_simd_sources)
  set_property(SOURCE ${ARGN} APPEND PROPERTY COMPILE_DEFINITIONS
               "HWY_DISABLED_TARGETS=HWY_SSSE3")
endfunction()
