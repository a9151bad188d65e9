// SPDX-License-Identifier: Apache-2.0
#include "tests/folders.h"

namespace silhouette {

std::string SourceFolder() { return SILHOUETTE_SOURCE_DIR; }
std::string BuildFolder() { return SILHOUETTE_BUILD_DIR; }
std::string ProgramFolder() { return SILHOUETTE_BIN_DIR; }

}  // namespace silhouette
