// SPDX-License-Identifier: Apache-2.0
// What makes a link of a mesh file too small or elsewhere, and assimp does not report.
#pragma once

#include <string>

#include "absl/status/status.h"

namespace silhouette {

// InvalidArgument, in one sentence with the mend: the end of a file is missing, as far as its
// format shows that, or a Collada mesh is moved by the bind_shape_matrix of a skin. By format: text
// STL must end with 'endsolid'; binary STL and PLY must have what their headers count; in OBJ all
// corners of faces are vertices of the file, there are faces, the last has three corners or more,
// and the last of the vertices are in one, but for 1 % or three (a file that is cut between the
// last of its faces, or within its last number, passes).
absl::Status CheckWhole(const std::string& path);

}  // namespace silhouette
