# Install what `cargo build --release` made:
#
#   cmake -DPREFIX=/usr/local [-DLIBDIR=lib] [-DBUILD_DIR=target/release] -P cmake/install.cmake
#
# DESTDIR in the environment is put in front of the prefix.

cmake_minimum_required(VERSION 3.16)
get_filename_component(root "${CMAKE_CURRENT_LIST_DIR}/.." ABSOLUTE)

if(NOT PREFIX)
  message(FATAL_ERROR "PREFIX is not set: cmake -DPREFIX=... -P cmake/install.cmake")
endif()
if(NOT LIBDIR)
  set(LIBDIR lib)
endif()
if(NOT BUILD_DIR)
  set(BUILD_DIR "${root}/target/release")
endif()
get_filename_component(PREFIX "${PREFIX}" ABSOLUTE)
get_filename_component(BUILD_DIR "${BUILD_DIR}" ABSOLUTE)

file(STRINGS "${root}/Cargo.toml" line REGEX "^version *=" LIMIT_COUNT 1)
if(NOT line MATCHES "\"(([0-9]+)\\.([0-9]+)\\.[0-9]+)\"")
  message(FATAL_ERROR "no version in Cargo.toml")
endif()
set(VERSION "${CMAKE_MATCH_1}")
# The ABI number, also in build.rs.
if(CMAKE_MATCH_2 EQUAL 0)
  set(ABI "0.${CMAKE_MATCH_3}")
  set(compatibility SameMinorVersion)
else()
  set(ABI "${CMAKE_MATCH_2}")
  set(compatibility SameMajorVersion)
endif()

set(static_libs ldl amd suitesparseconfig pthread dl m)
set(STATIC_LIBS_CMAKE "${static_libs}")
list(TRANSFORM static_libs PREPEND "-l" OUTPUT_VARIABLE STATIC_LIBS_PC)
list(JOIN STATIC_LIBS_PC " " STATIC_LIBS_PC)

set(shared "${BUILD_DIR}/libswitchback.so")
set(static "${BUILD_DIR}/libswitchback.a")
if(NOT EXISTS "${shared}" AND NOT EXISTS "${static}")
  message(FATAL_ERROR "no library in ${BUILD_DIR}: run cargo build --release first")
endif()

set(dest "$ENV{DESTDIR}${PREFIX}")
set(libdir "${dest}/${LIBDIR}")
file(MAKE_DIRECTORY "${libdir}/cmake/switchback" "${libdir}/pkgconfig" "${dest}/include" "${dest}/share/doc/switchback")

function(put from to)
  file(MAKE_DIRECTORY "${to}")
  file(COPY "${from}" DESTINATION "${to}")
  get_filename_component(name "${from}" NAME)
  message(STATUS "${to}/${name}")
endfunction()

foreach(header switchback.h switchback.hpp switchback_expr.hpp)
  if(EXISTS "${root}/include/${header}")
    put("${root}/include/${header}" "${dest}/include")
  endif()
endforeach()
put("${root}/LICENSE" "${dest}/share/doc/switchback")

if(EXISTS "${shared}")
  set(full "libswitchback.so.${VERSION}")
  file(REMOVE "${libdir}/${full}")
  execute_process(COMMAND "${CMAKE_COMMAND}" -E copy "${shared}" "${libdir}/${full}" RESULT_VARIABLE failed)
  if(failed)
    message(FATAL_ERROR "cannot write ${libdir}/${full}")
  endif()
  foreach(link "libswitchback.so.${ABI}" libswitchback.so)
    file(REMOVE "${libdir}/${link}")
    file(CREATE_LINK "${full}" "${libdir}/${link}" SYMBOLIC)
  endforeach()
  message(STATUS "${libdir}/${full}")
endif()
if(EXISTS "${static}")
  put("${static}" "${libdir}")
endif()

# From lib/cmake/switchback and lib/pkgconfig back to the prefix.
file(RELATIVE_PATH TO_PREFIX "/${LIBDIR}/cmake/switchback" "/")
file(RELATIVE_PATH PC_TO_PREFIX "/${LIBDIR}/pkgconfig" "/")
string(REGEX REPLACE "/$" "" TO_PREFIX "${TO_PREFIX}")
string(REGEX REPLACE "/$" "" PC_TO_PREFIX "${PC_TO_PREFIX}")
include(CMakePackageConfigHelpers)
set(package "${libdir}/cmake/switchback")
configure_file("${CMAKE_CURRENT_LIST_DIR}/switchbackConfig.cmake.in" "${package}/switchbackConfig.cmake" @ONLY)
write_basic_package_version_file("${package}/switchbackConfigVersion.cmake"
  VERSION "${VERSION}" COMPATIBILITY ${compatibility} ARCH_INDEPENDENT)
configure_file("${CMAKE_CURRENT_LIST_DIR}/switchback.pc.in" "${libdir}/pkgconfig/switchback.pc" @ONLY)
message(STATUS "${package}/switchbackConfig.cmake")
message(STATUS "${libdir}/pkgconfig/switchback.pc")
