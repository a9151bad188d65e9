// SPDX-License-Identifier: Apache-2.0
// The fundamental matrices of all pairs of a cell's views, from camera models where these are
// known, else from tags that two views saw at once.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calib/boards/sighting_file.h"
#include "calib/camera/camera_model.h"
#include "calib/fundamental/epipolar_geometry.h"
#include "calib/fundamental/weak_calibration.h"

namespace silhouette {

struct PairedView {
  std::string name;
  ViewSizes sizes;
  std::optional<CameraModel> camera;
};

// One pair of views; places in the list of views.
struct PairResult {
  int a = 0;
  int b = 0;
  int frames = 0;   // in which both saw a tag
  int corners = 0;  // of tags that both saw at once
  // From tags alone; nothing where cameras are known.
  std::optional<WeakCalibration> weak;
  // Where cameras are known: the matrix of undistorted pixels, what distortion does to it, and how
  // far the corners, undistorted, are from its lines.
  std::optional<LensBow> bow;
  std::optional<LineDistances> distances;

  // Nothing is known of the pair: no matrix, no lines.
  bool unseen = false;
  // Why its matrix must not be used for masks, with the mend.
  std::optional<std::string> refusal;
  Eigen::Matrix3d f = Eigen::Matrix3d::Zero();           // pixels of the camera images
  Eigen::Matrix3d f_of_masks = Eigen::Matrix3d::Zero();  // pixels of the masks
  double margin = 0;                                     // mask pixels that it needs
};

struct PairSettings {
  double most_margin = 0.25;
  uint32_t seed = 1;
  bool undistorted_images = false;  // the masks are made of images without distortion
};

// All pairs. Throws std::invalid_argument as CornersOfPair and FundamentalBetween do.
std::vector<PairResult> FindPairs(const std::vector<PairedView>& views,
                                  std::span<const TagSighting> sightings,
                                  const PairSettings& settings);

}  // namespace silhouette
