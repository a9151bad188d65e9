// Corners that cannot say how two views see each other, however well a matrix fits them.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calib/camera/epipolar_angles.h"
#include "calib/fundamental/correspondences.h"

namespace silhouette {

// For each frame of the pair, the first frame whose tags stood at the same place in both images (to
// within a pixel), itself if there is none: nothing was moved between the two.
std::vector<int> FirstAtSamePlace(const ViewPair& pair);

// Whether all corners are images of points on one plane: a homography takes those of one image to
// those of the other, to within two pixels or three standard deviations.
bool OnOnePlane(std::span<const Correspondence> corners);

// Share of an image that the corners' convex hull covers.
double ShareOfImage(std::span<const Correspondence> corners, Eigen::Vector2d Correspondence::*point,
                    PixelSize image);

// Why the corners will not do, with the mend, in one sentence; nothing if they may.
std::optional<std::string> WhyDegenerate(const ViewPair& pair, PixelSize image_a,
                                         PixelSize image_b);

}  // namespace silhouette
