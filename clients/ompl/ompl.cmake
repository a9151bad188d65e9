# SPDX-License-Identifier: Apache-2.0
# ompl::ompl, if OMPL is found: Debian's package of it has no targets.
find_package(ompl QUIET)
find_package(Eigen3 QUIET)
if(ompl_FOUND AND TARGET Eigen3::Eigen AND NOT TARGET ompl::ompl)
  find_library(SILHOUETTE_OMPL_LIBRARY NAMES ompl HINTS ${OMPL_LIBRARY_DIRS} REQUIRED)
  mark_as_advanced(SILHOUETTE_OMPL_LIBRARY)
  add_library(ompl::ompl INTERFACE IMPORTED GLOBAL)
  target_include_directories(ompl::ompl SYSTEM INTERFACE ${OMPL_INCLUDE_DIR})
  target_link_libraries(ompl::ompl INTERFACE ${SILHOUETTE_OMPL_LIBRARY} Eigen3::Eigen)
endif()
