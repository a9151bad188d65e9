// SPDX-License-Identifier: Apache-2.0
// How far a camera moved, measured by tags that stay where they are in the cell.
#pragma once

#include <map>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/boards/sighting_file.h"
#include "calib/fundamental/epipolar_geometry.h"

namespace silhouette {

// A tag as one view sees it: view, family, id.
using SeenTag = std::tuple<std::string, std::string, int>;

// The mean of all frames' sightings of each tag of `view`, its frame empty, its sigma that of the
// mean. InvalidArgument if a tag moved between frames, by more than a pixel and 0.05 mask pixels:
// it is none that stays, or the camera moved. A mask of 0 pixels is not known.
absl::StatusOr<std::map<SeenTag, TagSighting>> MeanSightings(
    const std::string& view, const ViewSizes& sizes, std::span<const TagSighting> sightings);

// What one view says. Pixels of the camera image.
struct ViewDrift {
  std::string view;
  std::string method;    // "tags", or "silhouettes"
  bool checked = false;  // else `message` says why not, and the mend
  std::string message;
  int corners = 0;  // that were compared
  // The image's motion: a shift of its middle, a turn about it (radians, clockwise), and how much
  // it grew.
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();
  double turn = 0;
  double scale = 0;
  double rms_left = 0;  // of one coordinate, of what that does not explain
  // The most that the image of a point in the cell may have moved.
  double moved = 0;
  double moved_mask = 0;  // in mask pixels
  // Tags that moved otherwise than most: by themselves, or because the camera was carried.
  std::vector<SeenTag> odd_tags;
  // Where corners were, and are; for pictures.
  std::vector<Eigen::Vector2d> before;
  std::vector<Eigen::Vector2d> after;
};

// `before`: how the camera saw the tags when it was calibrated; `after`: how it sees them now. Both
// may have tags of other views. Uncertain turns count with two standard deviations, and what is no
// shift, turn and growth twelve times: near things move more than tags behind them, if a camera was
// carried. Tags that disagree with most count as well: they may have been moved, or be nearer to a
// camera that was carried. With such tags the view is not checked. Nor is it, if `has_noise`, where
// every corner is the same to the last digit: `after` is of images of then.
ViewDrift DriftByTags(const std::string& view, const ViewSizes& sizes,
                      const std::map<SeenTag, TagSighting>& before,
                      const std::map<SeenTag, TagSighting>& after, bool has_noise = true);

}  // namespace silhouette
