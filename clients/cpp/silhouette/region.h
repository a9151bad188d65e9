// SPDX-License-Identifier: Apache-2.0
// Allowed regions: parts of the images in which obstacles are expected for a while.
#pragma once

#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "absl/time/time.h"
#include "silhouette/mask.h"

namespace silhouette::client {

// At least three corners (x, y) in pixels of the mask, integers at pixel centres: the pixels whose
// centres lie in it.
struct Polygon {
  std::vector<std::pair<double, double>> corners;
};

// Where a region lies in one view.
struct RegionPixels {
  std::string view;
  std::variant<Mask, Polygon> pixels;
};

// A region in force.
struct AllowedRegion {
  std::string name;
  // As masks, in the order of the database's views, without views that it does not touch.
  std::vector<std::pair<std::string, Mask>> views;
  absl::Duration remaining;  // until it ends, when the answer was made
  absl::Time end_time;       // about, by the server's clock
};

}  // namespace silhouette::client
