// One camera by itself: roughly its lens, the poses of the boards it saw, and which of its images
// do not fit the others.
#pragma once

#include <string>
#include <vector>

#include "calib/intrinsics/camera_ties.h"

namespace silhouette {

struct SingleCamera {
  std::vector<double> intrinsics;
  std::vector<PosedView> views;  // without those that do not fit
  std::vector<std::string> warnings;
};

// The lens model of a solve: that of the settings, or that of CameraIntrinsics if they are fixed.
std::string LensModelOf(const LensCamera& camera, const LensSettings& settings);

// InvalidArgument: too many images do not fit. FailedPrecondition: too few images. Internal: mrcal
// failed.
absl::StatusOr<SingleCamera> SolveAlone(const LensCamera& camera,
                                        const std::vector<const BoardView*>& views,
                                        const Lattice& lattice, const LensSettings& settings);

}  // namespace silhouette
