# find_package(mapcodec CONFIG) for others: targets mapcodec::codec, ::decode, ::tiles, ::parallel, ::maps, ::slam_adapter and,
# where they were built, ::paper_encoder, ::service, ::client. The package can be moved as a whole.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
get_property(mapcodec_exports GLOBAL PROPERTY MAPCODEC_EXPORTS)
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/mapcodec)

install(TARGETS ${mapcodec_exports} EXPORT mapcodec-targets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(EXPORT mapcodec-targets NAMESPACE mapcodec:: DESTINATION ${package_dir})
install(DIRECTORY mapcodec maps parallel slam_adapter DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
        FILES_MATCHING PATTERN "*.hpp" PATTERN "*.proto")

configure_package_config_file(cmake/mapcodec-config.cmake.in ${CMAKE_BINARY_DIR}/mapcodec-config.cmake
                              INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${CMAKE_BINARY_DIR}/mapcodec-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/mapcodec-config.cmake ${CMAKE_BINARY_DIR}/mapcodec-config-version.cmake
        DESTINATION ${package_dir})

if(MAPCODEC_BUILD_TOOLS)
  install(TARGETS mapcodec RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
  if(MAPCODEC_MRPT)
    install(TARGETS mapcodec-mrpt RUNTIME DESTINATION ${CMAKE_INSTALL_LIBEXECDIR}/mapcodec)
  endif()
  if(MAPCODEC_SERVICE)
    install(TARGETS mapcodecd RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
  endif()
endif()
install(FILES LICENSE README.md CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR})
