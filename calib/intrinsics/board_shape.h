// Whether boards look in the images as their descriptions say: a plane seen through a lens is
// nearly a homography of itself, and of nothing else.
#pragma once

#include <vector>

#include "absl/status/status.h"
#include "calib/intrinsics/board_views.h"

namespace silhouette {

// InvalidArgument, with what seems to be the matter, if most views of a board contradict its
// description: mirrored, rows and columns exchanged, another order of tags.
absl::Status CheckBoardShapes(const std::vector<LensCamera>& cameras,
                              const std::vector<Board>& boards,
                              const std::vector<BoardView>& views);

}  // namespace silhouette
