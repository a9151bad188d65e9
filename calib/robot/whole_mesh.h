// SPDX-License-Identifier: Apache-2.0
// WholeMesh: what assimp passes over in silence, and a link would be too small or elsewhere for.
#pragma once

#include <string>

#include "absl/status/status.h"

namespace silhouette {

// InvalidArgument, in one sentence with the mend: the end of a file is missing, as far as its
// format shows that, or a Collada mesh is moved by the bind_shape_matrix of a skin. By format: text
// STL must end with 'endsolid'; PLY must have what its header counts; in OBJ every face has three
// corners or more, all of them vertices of the file, and 99 % of the vertices are in a face (a file
// that is cut between the last of its faces passes).
absl::Status CheckWhole(const std::string& path);

}  // namespace silhouette
