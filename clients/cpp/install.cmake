# SPDX-License-Identifier: Apache-2.0
# What users of the client library get, as the component `client`:
#   cmake --install build/release --component client --prefix DIR
# Then find_package(silhouette), or pkg-config, gives silhouette::client and what it needs.
#
# All headers are included as <silhouette/...>: db/mask/mask.h and db/mask/configuration_grid.h stand in the
# place of the headers that forward to them in the source tree.
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/silhouette)

foreach(target IN ITEMS db_mask calib_camera calib_robot_drawing proto proto_tls clients_cpp)
  install(TARGETS silhouette_${target} EXPORT silhouette
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT client
    INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
endforeach()
set_target_properties(silhouette_clients_cpp PROPERTIES EXPORT_NAME client)

install(DIRECTORY silhouette/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/silhouette COMPONENT client
  FILES_MATCHING PATTERN "*.h"
  PATTERN mask.h EXCLUDE
  PATTERN configuration_grid.h EXCLUDE)
install(FILES ${PROJECT_SOURCE_DIR}/db/mask/mask.h ${PROJECT_SOURCE_DIR}/db/mask/configuration_grid.h
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/silhouette COMPONENT client)
install(DIRECTORY ${PROJECT_BINARY_DIR}/generated/silhouette/v1
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/silhouette COMPONENT client
  FILES_MATCHING PATTERN "*.pb.h")
install(DIRECTORY ${PROJECT_SOURCE_DIR}/proto/silhouette/v1
  DESTINATION ${CMAKE_INSTALL_DATADIR}/silhouette/proto/silhouette COMPONENT client
  FILES_MATCHING PATTERN "*.proto")

configure_file(silhouette.pc.in silhouette.pc @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/silhouette.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT client)
include(CMakePackageConfigHelpers)
configure_package_config_file(silhouetteConfig.cmake.in silhouetteConfig.cmake
  INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/silhouetteConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/silhouetteConfig.cmake
  ${CMAKE_CURRENT_BINARY_DIR}/silhouetteConfigVersion.cmake
  DESTINATION ${package_dir} COMPONENT client)
install(EXPORT silhouette NAMESPACE silhouette:: FILE silhouetteTargets.cmake
  DESTINATION ${package_dir} COMPONENT client)
