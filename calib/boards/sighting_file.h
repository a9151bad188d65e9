// SPDX-License-Identifier: Apache-2.0
// Sightings of tags as a CSV file, one line per corner:
//
//   frame,view,family,tag,corner,x,y,sigma
//   0007,left,tagStandard41h12,12,0,311.0627,208.9413,0.013
//
// corner 0 to 3 in the order of Board::CornersOf; x, y and sigma in pixels, integers at pixel
// centres. Numbers are written so that reading gives the same ones.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace silhouette {

// TagSighting: one tag seen in one image. What all of calibration starts from.

struct TagSighting {
  std::string frame;   // images with the same frame were taken at once, of a cell that stood still
  std::string view;    // the camera
  std::string family;  // of the tag, e.g. tagStandard41h12
  int tag = 0;         // its id
  // Pixels of the camera's image, integers at pixel centres; in the order of Board::CornersOf.
  std::array<Eigen::Vector2d, 4> corners{};
  double sigma = 0;  // standard deviation of a corner per axis, pixels
};

// Throws std::invalid_argument for what could not be read again: a frame, view or family with a
// line break or without a name, a number that is not finite, a sigma that is not positive.
std::string SightingFileText(std::span<const TagSighting> sightings);

// In the order of the file. `file`: what messages call it. InvalidArgument with file and line: not
// such a table, an empty name, a negative tag, a corner that is not 0 to 3 or is there twice, a tag
// with fewer than four corners or with corners of different sigma, a number that is not finite, a
// sigma that is not positive.
absl::StatusOr<std::vector<TagSighting>> SightingsFromText(const std::string& text,
                                                           const std::string& file);

}  // namespace silhouette
