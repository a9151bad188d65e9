// SPDX-License-Identifier: Apache-2.0
// Corners of tags that two views saw at once.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "calib/boards/sighting_file.h"

namespace silhouette {

// One corner of a tag, in both images of one frame. Pixels, integers at pixel centres.
struct Correspondence {
  Eigen::Vector2d a = Eigen::Vector2d::Zero();
  Eigen::Vector2d b = Eigen::Vector2d::Zero();
  double sigma_a = 0;  // standard deviation per axis, pixels
  double sigma_b = 0;
  int frame = 0;  // place in ViewPair::frames
  int tag = 0;    // counts the tags of the pair, over all frames
};

struct ViewPair {
  std::string view_a;
  std::string view_b;
  std::vector<std::string> frames;  // those in which both views saw the same tag
  std::vector<Correspondence> corners;
};

// What the sightings say of a pair of views. A sighting whose sigma is not positive counts as one
// of 0.1 px. Throws std::invalid_argument if a tag comes twice in a frame of a view: a mirror, or
// two copies of one board.
ViewPair CornersOfPair(std::span<const TagSighting> sightings, const std::string& view_a,
                       const std::string& view_b);

// Those of the corners for which `which` is true.
std::vector<Correspondence> Chosen(std::span<const Correspondence> corners,
                                   const std::vector<bool>& which);

// The views in the order in which they first come.
std::vector<std::string> ViewsOf(std::span<const TagSighting> sightings);

}  // namespace silhouette
