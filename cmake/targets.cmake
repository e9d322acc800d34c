# One way to make a library or a program, so that all have the same flags.
add_library(mapcodec_flags INTERFACE)
target_compile_options(mapcodec_flags INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor
                       $<$<BOOL:${MAPCODEC_WARNINGS_AS_ERRORS}>:-Werror>
                       # GCC 12 sees overlaps in std::string's operator+ that cannot be (GCC bug 105651).
                       $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict;-Wno-stringop-overflow>)
# The same points on every machine: no fused multiply-add, and none of GCC 12's SLP vectoriser, which drops the rounding of
# double(float(x)) on pairs.
target_compile_options(mapcodec_flags INTERFACE -ffp-contract=off -fno-tree-slp-vectorize)
if(MAPCODEC_SANITIZE)
  add_compile_options(-fsanitize=${MAPCODEC_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${MAPCODEC_SANITIZE})
  # As in Debian's PCL: with AddressSanitizer alone Eigen would align by hand, and free what PCL allocated otherwise.
  add_compile_definitions(EIGEN_MALLOC_ALREADY_ALIGNED=1)
endif()

# mapcodec_library(codec SOURCES ...) makes mapcodec_codec, exported as mapcodec::codec.
function(mapcodec_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(mapcodec_${name} STATIC ${ARG_SOURCES})
  add_library(mapcodec::${name} ALIAS mapcodec_${name})
  set_target_properties(mapcodec_${name} PROPERTIES EXPORT_NAME ${name})
  target_include_directories(mapcodec_${name} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>
                                                     $<INSTALL_INTERFACE:include>)
  target_compile_features(mapcodec_${name} PUBLIC cxx_std_20)
  target_link_libraries(mapcodec_${name} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE} $<BUILD_INTERFACE:mapcodec_flags>)
  set_property(GLOBAL APPEND PROPERTY MAPCODEC_EXPORTS mapcodec_${name})
endfunction()
