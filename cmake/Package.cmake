# SPDX-License-Identifier: Apache-2.0
# Debian packages, by CPack; tools/package makes them, with the man pages and the HTML in build/<preset>/package.
set(package ${PROJECT_SOURCE_DIR}/cmake/package)
set(made ${PROJECT_BINARY_DIR}/package)

install(DIRECTORY ${made}/man/programs/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT programs OPTIONAL)
install(DIRECTORY ${made}/man/server/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT server OPTIONAL)
install(DIRECTORY ${made}/html DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/silhouette-doc COMPONENT doc OPTIONAL)
install(FILES ${package}/silhouette-server@.service DESTINATION lib/systemd/system COMPONENT server)
install(FILES ${PROJECT_SOURCE_DIR}/docs/cell.schema.json DESTINATION ${CMAKE_INSTALL_DATADIR}/silhouette COMPONENT programs)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/docs/monitoring DESTINATION ${CMAKE_INSTALL_DATADIR}/silhouette COMPONENT server)
install(FILES ${package}/silhouette.sysusers RENAME silhouette.conf DESTINATION lib/sysusers.d COMPONENT server)

# component, package, section, what it is
function(silhouette_package component name section summary)
  string(TOUPPER ${component} key)
  set(CPACK_DEBIAN_${key}_PACKAGE_NAME ${name} PARENT_SCOPE)
  set(CPACK_DEBIAN_${key}_PACKAGE_SECTION ${section} PARENT_SCOPE)
  set(CPACK_COMPONENT_${key}_DESCRIPTION "${summary}\n\
Silhouette reports to a robot's path planner, from camera images alone,\n\
which robot configurations are free and which would collide with what\n\
stands in the work cell." PARENT_SCOPE)
  install(FILES ${package}/copyright ${made}/changelog.Debian.gz ${made}/changelog.gz
    DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${name} COMPONENT ${component} OPTIONAL)
  set(CPACK_COMPONENTS_ALL ${CPACK_COMPONENTS_ALL} ${component} PARENT_SCOPE)
endfunction()
set(CPACK_COMPONENTS_ALL "")
silhouette_package(programs silhouette science "programs to set up and ask a work cell")
silhouette_package(server silhouette-server science "server that checks configurations for collision")
set(library libsilhouette${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
silhouette_package(library ${library} libs "C++ client library")
silhouette_package(client libsilhouette-dev libdevel "C++ client library, to build with")
silhouette_package(python python3-silhouette python "Python client library")
silhouette_package(doc silhouette-doc doc "documentation")
set(CPACK_DEBIAN_DOC_PACKAGE_ARCHITECTURE all)
file(CONFIGURE OUTPUT ${made}/shlibs CONTENT "libsilhouette ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR} ${library}\n")
set(CPACK_DEBIAN_LIBRARY_PACKAGE_CONTROL_EXTRA ${made}/shlibs ${package}/triggers)
set(CPACK_DEBIAN_CLIENT_PACKAGE_DEPENDS "${library} (= ${PROJECT_VERSION}-1), libgrpc++-dev, libprotobuf-dev, protobuf-compiler-grpc, libabsl-dev, libeigen3-dev")
set(CPACK_DEBIAN_CLIENT_PACKAGE_SUGGESTS "libompl-dev")
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3 (>= 3.11), python3 (<< 3.12), python3-numpy")
set(CPACK_DEBIAN_PYTHON_PACKAGE_CONTROL_EXTRA ${package}/python/prerm)
set(CPACK_DEBIAN_SERVER_PACKAGE_DEPENDS "systemd | systemd-standalone-sysusers")
set(CPACK_DEBIAN_SERVER_PACKAGE_RECOMMENDS "silhouette")
set(CPACK_DEBIAN_SERVER_PACKAGE_CONTROL_EXTRA ${package}/postinst ${package}/prerm ${package}/postrm)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME silhouette)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE
  WORLD_READ WORLD_EXECUTE)
include(CPack)
