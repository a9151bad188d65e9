// Fundamental matrices of cameras whose models are known, and what lenses take from them.
#pragma once

#include "calib/camera/camera_model.h"
#include "calib/fundamental/line_distances.h"

namespace silhouette {

// What two views' distortion does to their lines. Pixels of the camera images.
struct LensBow {
  // Greatest distance of an epipolar curve, within the image, from the chord between its ends.
  double curve = 0;
  // Greatest distance of points on the curves from the matrix's lines, and the margin in mask
  // pixels that would make up for it: what it costs to use the matrix with images as the cameras
  // take them.
  double off_lines = 0;
  double margin = 0;
};

// Over pixels all over a's image and the points up to `reach` (metres) before it that both see;
// both ways. All zero without distortion, or if the views see nothing in common.
LensBow BowBetween(const CameraModel& a, const CameraModel& b, const ViewSizes& size_a,
                   const ViewSizes& size_b, double reach);

// Where a camera without distortion, otherwise the same, would see what this one sees at `pixel`;
// nothing beyond the distortion's fold.
std::optional<Eigen::Vector2d> Undistorted(const CameraModel& camera, const Eigen::Vector2d& pixel);

// The corner with both points undistorted; nothing beyond the distortion's fold.
std::optional<Correspondence> Undistorted(const CameraModel& a, const CameraModel& b,
                                          const Correspondence& corner);

}  // namespace silhouette
