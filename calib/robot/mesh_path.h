// SPDX-License-Identifier: Apache-2.0
// MeshPath: the file that a URDF means by the name of a mesh.
#pragma once

#include <span>
#include <string>

#include "absl/status/statusor.h"

namespace silhouette {

// `as_written`: a path, absolute or relative to the folder of `urdf`; or a URI: file://path,
// package://name/rest, model://name/rest. Backslashes are slashes, as on Windows. %20 and the like
// in a URI are characters. A package is looked for in every root of `package_paths` and then in
// every folder above `urdf`: as root/name, or as the root itself if that, or its package.xml, is
// called so. NotFound, with the mend: the package is not there, or has not this file.
// InvalidArgument: another kind of URI.
absl::StatusOr<std::string> MeshPath(const std::string& as_written, const std::string& urdf,
                                     std::span<const std::string> package_paths);

// Of a file that does not exist: the end of a sentence that names the one that is there in other
// upper and lower case; empty if there is none.
std::string InOtherCase(const std::string& path);

}  // namespace silhouette
