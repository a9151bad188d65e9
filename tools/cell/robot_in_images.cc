// SPDX-License-Identifier: Apache-2.0
#include "tools/cell/robot_in_images.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "absl/strings/str_format.h"
#include "calib/robot/drawing/drawn_robot.h"
#include "db/status/status_macros.h"
#include "tools/cell/expected_robot.h"

namespace silhouette {
namespace {

// What the model covers at least of the foreground that is captured: a robot that is drawn far too
// small may be within it. Shadows, cables and parts are foreground, too.
constexpr double kLeastCovered = 0.2;

// Captured configurations all over the grid, with their joint values.
absl::StatusOr<std::vector<RobotImage>> SomeImages(const Snapshot& snapshot, uint64_t size) {
  constexpr uint64_t kConfigurations = 8;
  constexpr uint64_t kTries = 100;  // from each place on
  std::vector<RobotImage> images;
  for (uint64_t i = 0; i < kConfigurations; ++i) {
    const uint64_t first = size / kConfigurations * i;
    for (uint64_t number = first; number < std::min(size, first + kTries); ++number) {
      auto image = snapshot.Find(number);
      if (absl::IsDataLoss(image.status())) continue;  // the server reports it
      RETURN_IF_ERROR(image.status());
      if (!*image || (*image)->excluded || (*image)->measured.empty()) continue;
      images.push_back(**std::move(image));
      break;
    }
  }
  return images;
}

}  // namespace

absl::StatusOr<std::vector<std::string>> MisplacedViews(const Cell& cell,
                                                        const Database& database) {
  std::vector<std::string> sentences;
  const FirstLookSettings& look = cell.capture.first_look;
  if (cell.robot.drawn || look.least_overlap == 0) return sentences;
  ASSIGN_OR_RETURN(const auto expected,
                   ExpectedRobotOf(cell, database, database.mask_sizes(),
                                   "whether the calibration has the robot where images show it"));
  if (!expected) return sentences;
  ASSIGN_OR_RETURN(const Snapshot snapshot, database.Read());
  ASSIGN_OR_RETURN(const auto images, SomeImages(snapshot, cell.grid.size()));
  std::vector<std::vector<Mask>> expected_masks;
  for (const RobotImage& image : images) {
    expected_masks.push_back(expected->Touched(image.measured));
  }
  for (size_t view = 0; view < cell.views.size(); ++view) {
    double drawn = 0;
    double captured = 0;
    double common = 0;
    for (size_t i = 0; i < images.size(); ++i) {
      const Mask& touched = expected_masks[i][view];
      const Mask& foreground = images[i].masks[view];
      drawn += static_cast<double>(touched.Count());
      captured += static_cast<double>(foreground.Count());
      common += static_cast<double>((touched & foreground).Count());
    }
    const double least = look.least_area * static_cast<double>(images.size()) *
                         static_cast<double>(cell.views[view].mask_size.pixels());
    if (std::max(drawn, captured) <= least) continue;
    if (common >= look.least_overlap * drawn && common >= kLeastCovered * captured) continue;
    sentences.push_back(absl::StrFormat(
        "view '%s': the robot in its captured images is not where calibration and URDF have it: "
        "they have %.0f %% of the drawn pixels and %.0f %% of the captured ones in common; check "
        "the frame and the unit of the calibration's poses, that each camera model is of its own "
        "view, and the joint values that the robot reported; if something stands before the robot, "
        "or the URDF lacks its tool, lower 'first_look: least_overlap'",
        cell.views[view].name, drawn > 0 ? 100 * common / drawn : 0,
        captured > 0 ? 100 * common / captured : 0));
  }
  return sentences;
}

}  // namespace silhouette
