// SPDX-License-Identifier: Apache-2.0
// ParseUrdf: a URDF file as urdfdom reads it.
#pragma once

#include <urdf_world/types.h>

#include <string>

#include "absl/status/statusor.h"

namespace silhouette {

// Nothing of the file is left out. NotFound: there is no such file. InvalidArgument, with the place
// and the mend: it is not XML, xacro, no valid URDF, or has a joint without limits.
absl::StatusOr<urdf::ModelInterfaceSharedPtr> ParseUrdf(const std::string& path);

}  // namespace silhouette
