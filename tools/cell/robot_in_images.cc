// SPDX-License-Identifier: Apache-2.0
#include "tools/cell/robot_in_images.h"

#include <algorithm>
#include <optional>
#include <random>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "calib/robot/drawing/drawn_robot.h"
#include "db/status/status_macros.h"
#include "db/store/suspects.h"
#include "server/collision/policy.h"
#include "server/collision/voxel_space.h"
#include "tools/cell/expected_robot.h"

namespace silhouette {
namespace {

// What the model covers at least of the foreground that is captured: a robot that is drawn far too
// small may be within it. Shadows, cables and parts are foreground, too.
constexpr double kLeastCovered = 0.2;

// Captured configurations all over the grid, with their joint values; none that is suspect.
absl::StatusOr<std::vector<RobotImage>> SomeImages(const Snapshot& snapshot, uint64_t size) {
  constexpr uint64_t kConfigurations = 8;
  constexpr uint64_t kTries = 100;  // from each place on
  ASSIGN_OR_RETURN(const auto history, snapshot.CaptureHistory());
  const SuspectSpans suspects(history);
  std::vector<RobotImage> images;
  for (uint64_t i = 0; i < kConfigurations; ++i) {
    const uint64_t first = size / kConfigurations * i;
    for (uint64_t number = first; number < std::min(size, first + kTries); ++number) {
      auto image = snapshot.Find(number);
      if (absl::IsDataLoss(image.status())) continue;  // the server reports it
      RETURN_IF_ERROR(image.status());
      if (!*image || (*image)->excluded || (*image)->measured.empty()) continue;
      if (suspects.Contain((*image)->captured)) continue;
      images.push_back(**std::move(image));
      break;
    }
  }
  return images;
}

// Configurations by chance, the same for the same cell.
std::vector<Configuration> SomeConfigurations(const ConfigurationGrid& grid,
                                              const JointRegions& forbidden) {
  constexpr int kTries = 500;
  std::mt19937_64 random(1);
  std::vector<Configuration> some;
  for (int i = 0; i < kTries; ++i) {
    Configuration q;
    for (const GridJoint& joint : grid.joints()) {
      q.push_back(std::uniform_real_distribution<double>(joint.lower, joint.upper)(random));
    }
    if (!forbidden.Between(q, q)) some.push_back(std::move(q));
  }
  return some;
}

// Those that a joint moves: no obstacle can come to be where the others are.
std::vector<RobotPart> MovingParts(const DrawnRobot& robot) {
  std::vector<RobotPart> moving;
  for (size_t part = 0; part < robot.parts().size(); ++part) {
    for (size_t joint = 0; joint < robot.chain().joints().size(); ++joint) {
      if (robot.Lever(part, joint) == 0) continue;
      moving.push_back(robot.parts()[part]);
      break;
    }
  }
  return moving;
}

}  // namespace

absl::StatusOr<std::string> MisplacedViews(const Cell& cell, const Database& database) {
  const FirstLookSettings& look = cell.capture.first_look;
  if (cell.robot.drawn || look.least_overlap == 0) return std::string();
  ASSIGN_OR_RETURN(const auto expected,
                   ExpectedRobotOf(cell, database, database.mask_sizes(),
                                   "whether the calibration has the robot where images show it"));
  if (!expected) return std::string();
  ASSIGN_OR_RETURN(const Snapshot snapshot, database.Read());
  ASSIGN_OR_RETURN(const auto images, SomeImages(snapshot, cell.grid.size()));
  std::vector<std::vector<Mask>> expected_masks;
  for (const RobotImage& image : images) {
    expected_masks.push_back(expected->Touched(image.measured));
  }
  std::vector<std::string> names;
  std::vector<std::string> of_drawn;
  std::vector<std::string> of_captured;
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
    const auto share = [&](double of) { return absl::StrFormat("%.0f", 100 * common / of); };
    names.push_back(absl::StrCat("'", cell.views[view].name, "'"));
    of_drawn.push_back(drawn > 0 ? share(drawn) : "0");
    of_captured.push_back(captured > 0 ? share(captured) : "0");
  }
  if (names.empty()) return std::string();
  return absl::StrCat(
      names.size() == 1 ? "view " : "views ", absl::StrJoin(names, ", "),
      ": the robot in its captured images is not where calibration and URDF have it: they have ",
      absl::StrJoin(of_drawn, ", "), " % of the drawn pixels and ",
      absl::StrJoin(of_captured, ", "),
      " % of the captured ones in common; check the frame and the unit of the calibration's poses, "
      "that each camera model is of its own view, and the joint values that the robot reported; if "
      "something stands before the robot, or the URDF lacks its tool, lower 'first_look: "
      "least_overlap'");
}

std::string PartialViews(const Cell& cell, const DrawnRobot& robot, const JointRegions& forbidden) {
  constexpr double kMostCut = 0.01;
  std::vector<RobotPart> moving = MovingParts(robot);
  const std::vector<Configuration> some = SomeConfigurations(cell.grid, forbidden);
  if (moving.empty() || some.empty()) return "";
  const DrawnRobot drawn(robot.chain(), std::move(moving), robot.views());
  std::vector<int> cut(cell.views.size());
  for (const Configuration& q : some) {
    const std::vector<Mask> masks = drawn.Touched(q);
    for (size_t view = 0; view < cut.size(); ++view) {
      cut[view] += MayReachBeyond(masks[view].words(), masks[view].size()) ? 1 : 0;
    }
  }
  std::vector<std::string> names;
  std::vector<std::string> shares;
  for (size_t view = 0; view < cut.size(); ++view) {
    const double share = cut[view] / static_cast<double>(some.size());
    if (share <= kMostCut) continue;
    names.push_back(absl::StrCat("'", cell.views[view].name, "'"));
    shares.push_back(absl::StrFormat("%.0f %%", 100 * share));
  }
  if (names.empty()) return "";
  const int views = static_cast<int>(cell.views.size());
  const int whole = views - static_cast<int>(names.size());
  const int enough = std::max(1, whole - DefaultOccludedViews(whole));
  const int occluded = cell.policy.max_occluded_views.value_or(DefaultOccludedViews(views));
  if (whole > 0 && cell.policy.min_views.value_or(views - occluded) <= enough) return "";
  const bool one = names.size() == 1;
  return absl::StrCat(
      one ? "view " : "views ", absl::StrJoin(names, ", "), one ? " shows" : " show",
      " only a part of the robot at ", absl::StrJoin(shares, ", "),
      " of its joint values: what stands where ", one ? "it does" : "they do",
      " not look counts as shown by at most ", whole, " of ", views,
      " views, and all but the sound presets may miss it; turn or move the camera", one ? "" : "s",
      whole > 0 ? absl::StrCat(", or state 'policy: {min_views: ", enough, "}'") : "");
}

}  // namespace silhouette
