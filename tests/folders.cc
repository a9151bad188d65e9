// SPDX-License-Identifier: Apache-2.0
#include "tests/folders.h"

namespace silhouette {

std::string SourceFolder() { return SourceFolder(); }
std::string BuildFolder() { return BuildFolder(); }
std::string ProgramFolder() { return ProgramFolder(); }

}  // namespace silhouette
