# SPDX-License-Identifier: Apache-2.0
# What users of the client library get:
#   cmake --install build/release --component client --prefix DIR     headers, libsilhouette.a, the link libsilhouette.so
#   cmake --install build/release --component library --prefix DIR    libsilhouette.so.VERSION
# Then find_package(silhouette), or pkg-config, gives silhouette::client and what it needs.
#
# All headers are included as <silhouette/...>: db/mask/mask.h and db/mask/configuration_grid.h stand in the
# place of the headers that forward to them in the source tree.
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/silhouette)

# Both have the client and all of ours that it needs, under the name silhouette::client: silhouetteConfig.cmake
# takes one of them.
set(objects)
foreach(target IN ITEMS db_mask calib_camera calib_robot_drawing proto proto_tls clients_cpp)
  list(APPEND objects $<TARGET_OBJECTS:silhouette_${target}>)
endforeach()
add_library(silhouette_static STATIC ${objects})
add_library(silhouette_shared SHARED ${objects})
foreach(kind IN ITEMS static shared)
  target_link_libraries(silhouette_${kind} PUBLIC
    gRPC::grpc++ protobuf::libprotobuf Eigen3::Eigen absl::status absl::statusor absl::strings absl::time
    Threads::Threads)
  set_target_properties(silhouette_${kind} PROPERTIES LINKER_LANGUAGE CXX OUTPUT_NAME silhouette EXPORT_NAME client
    VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
  install(TARGETS silhouette_${kind} EXPORT silhouette_${kind}
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT client
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library NAMELINK_COMPONENT client
    INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  install(EXPORT silhouette_${kind} NAMESPACE silhouette:: FILE silhouetteTargets-${kind}.cmake
    DESTINATION ${package_dir} COMPONENT client)
endforeach()

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
