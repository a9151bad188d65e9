// SPDX-License-Identifier: Apache-2.0
// Where a test finds the sources and what was built. One small object knows the paths, so that what
// the compiler cache holds of the tests serves every clone.
#pragma once

#include <string>

namespace silhouette {

// The project's root.
std::string SourceFolder();
// The root of the build, build/<preset>.
std::string BuildFolder();
// The programs that were built.
std::string ProgramFolder();

}  // namespace silhouette
