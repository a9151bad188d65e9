// SPDX-License-Identifier: Apache-2.0
// Weak calibration: the fundamental matrix of two views straight from tags that both saw at once.
// Nothing of cameras, boards or robot needs to be known; lenses must not bow lines.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calib/camera/epipolar_angles.h"
#include "calib/fundamental/correspondences.h"
#include "calib/fundamental/epipolar_geometry.h"

namespace silhouette {

// How much the lenses of two views bow lines, from nothing but tags that both saw. It shows whether
// a fundamental matrix can be true; for camera models it is too coarse.

// Radial, about the middle of the image, one number a view: an undistorted radius is
// r / (1 + bend * r^2), r = 1 in the image's corners (Fitzgibbon 2001).
struct LensEstimate {
  double bend_a = 0;
  double bend_b = 0;
  // By how much the lenses explain the corners better than a matrix alone: the fall of the sum of
  // squared deviations, in units of what is left per corner. Chance gives about 2.
  double gain = 0;
  // Margin in mask pixels that a matrix needs for such lenses, anywhere in the images, and the
  // distance from its lines, in pixels of the camera images.
  double margin = 0;
  double off_lines = 0;
};

// `f`: a matrix, for pixels of the camera images, that fits the corners about.
LensEstimate EstimateLenses(const Eigen::Matrix3d& f, std::span<const Correspondence> corners,
                            const ViewSizes& a, const ViewSizes& b);

struct WeakCalibration {
  // Why there is no matrix, with the mend; nothing if there is one.
  std::optional<std::string> refusal;

  Eigen::Matrix3d f = Eigen::Matrix3d::Zero();  // x_b' F x_a = 0, pixels of the camera images
  Eigen::Matrix3d f_of_masks = Eigen::Matrix3d::Zero();
  int outliers = 0;  // corners that were not believed, of all of the pair's
  // By how much the believed corners differ from the matrix, in units of what they are said to be
  // wrong by; about 1.
  double spread = 0;
  // Corners that the matrices they are judged by were not fitted to: a fifth of the frames is left
  // out at a time, or of the tags, if there are less than ten places of a board. Frames in which
  // nothing was moved stay together.
  LineDistances held_out;
  bool frames_held_out = false;
  // Mask pixels by which the matrix may be wrong, anywhere in the images: four standard deviations
  // of what the corners say.
  double predicted_margin = 0;
  LensEstimate lenses;
  // Whether the corners show that lenses bow lines.
  bool bowed = false;
  // What the server needs as calibration.margin: the greater of predicted_margin and held_out's,
  // and what lenses that bow lines take besides.
  double margin = 0;
  std::vector<std::string> warnings;  // in plain words
};

// `most_margin`: a matrix that needs more is refused, as is one that most tags of some frames
// contradict, where lenses do not explain it: a camera moved. The same seed gives the same result.
WeakCalibration CalibrateWeakly(const ViewPair& pair, const ViewSizes& a, const ViewSizes& b,
                                double most_margin, uint32_t seed);

// Corners that cannot say how two views see each other, however well a matrix fits them.

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
