// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_problem.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

absl::Status CheckRobotPoses(const PoseProblem& problem) {
  std::set<std::string> frames;
  for (const RobotPose& pose : problem.robot_poses) {
    if (!frames.insert(pose.frame).second) {
      return InvalidArgument("frame '", pose.frame, "' has two poses of the robot; leave one");
    }
    const Eigen::Matrix3d rotation = pose.base_from_flange.linear();
    if (!pose.base_from_flange.matrix().allFinite() ||
        !(rotation * rotation.transpose()).isIdentity(1e-6)) {
      return InvalidArgument("the robot's pose of frame '", pose.frame, "' is not one");
    }
    if (pose.base_from_flange.translation().norm() > kFarthestFlange) {
      return FailedPrecondition(absl::StrFormat(
          "the robot's pose of frame '%s' is %.0f m from its base; it looks as if positions are in "
          "millimetres; give metres",
          pose.frame, pose.base_from_flange.translation().norm()));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckViews(const PoseProblem& problem) {
  std::set<std::string> views;
  for (const PoseView& view : problem.views) {
    if (!views.insert(view.name).second) {
      return InvalidArgument("view '", view.name, "' is there twice");
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckFrameIsCertain(const Board& board) {
  if (!board.IsAmbiguous()) return absl::OkStatus();
  const BoardDescription& d = board.description();
  const bool circles = d.kind == BoardKind::kCircles;
  return InvalidArgument("board '", d.name, circles ? "', a board of " : "', a chessboard of ",
                         d.columns, "x", d.rows, circles ? " circles" : " inner corners",
                         ", looks the same turned by half, so that no image shows where its origin "
                         "is; for poses take ",
                         circles ? "an asymmetric one of an odd number of rows, such as 4x11"
                                 : "one of an even and an odd number, such as 9x6",
                         ", a ChArUco board or tags");
}

namespace {

absl::Status CheckBoardsOf(const PoseProblem& problem) {
  std::map<std::pair<std::string, int>, std::string> tags;
  std::set<std::string> boards;
  for (const PoseBoard& board : problem.boards) {
    const BoardDescription& d = board.board.description();
    if (!boards.insert(d.name).second) {
      return InvalidArgument("board '", d.name, "' is there twice");
    }
    if (board.place == BoardPlace::kSurveyed &&
        (!(board.position_sigma > 0) || !(board.rotation_sigma > 0))) {
      return InvalidArgument("the survey of board '", d.name, "' must have positive sigmas");
    }
    const bool used = board.place != BoardPlace::kLoose ||
                      std::ranges::any_of(problem.sightings, [&](const TagSighting& seen) {
                        return board.board.HasTag(seen.family, seen.tag);
                      });
    if (used) RETURN_IF_ERROR(CheckFrameIsCertain(board.board));
    const int first = board.board.first_mark();
    for (int tag = first; board.board.HasTag(tag); ++tag) {
      const auto [other, added] = tags.emplace(std::pair(board.board.family(), tag), d.name);
      if (!added) {
        return InvalidArgument("tag ", tag, " (", board.board.family(), ") is on the boards '",
                               other->second, "' and '", d.name, "'");
      }
    }
  }
  return absl::OkStatus();
}

absl::Status CheckSighting(const TagSighting& seen) {
  const bool finite =
      !seen.corners.empty() && std::ranges::all_of(seen.corners, [](const Eigen::Vector2d& corner) {
        return corner.allFinite();
      });
  if (finite && seen.sigma > 0 && std::isfinite(seen.sigma)) return absl::OkStatus();
  return InvalidArgument("frame '", seen.frame, "', view '", seen.view, "', tag ", seen.tag,
                         ": corners must be finite and sigma positive");
}

absl::Status CheckSightings(const PoseProblem& problem) {
  std::set<std::string> views;
  for (const PoseView& view : problem.views) {
    views.insert(view.name);
    RETURN_IF_ERROR(CheckImageSize(problem.sightings, view.name,
                                   {view.lens.width, view.lens.height},
                                   "the image size of its camera model"));
  }
  std::set<std::tuple<std::string, std::string, std::string, int>> tags;
  for (const TagSighting& seen : problem.sightings) {
    RETURN_IF_ERROR(CheckSighting(seen));
    for (const PoseBoard& board : problem.boards) {
      const auto corners = static_cast<size_t>(board.board.corners_per_mark());
      if (!board.board.HasTag(seen.family, seen.tag) || seen.corners.size() == corners) continue;
      return InvalidArgument("frame '", seen.frame, "', view '", seen.view, "', tag ", seen.tag,
                             " has ", seen.corners.size(), " corners, not ", corners);
    }
    if (!views.contains(seen.view)) {
      return InvalidArgument("tags were seen by view '", seen.view,
                             "', of which there is no camera model");
    }
    if (!tags.insert({seen.frame, seen.view, seen.family, seen.tag}).second) {
      return InvalidArgument("frame '", seen.frame, "', view '", seen.view, "' has tag ", seen.tag,
                             " twice; a frame must be one image");
    }
  }
  return absl::OkStatus();
}

// Whether a tag's corners go round as in an image that is not mirrored.
bool GoesRoundRightly(const std::vector<Eigen::Vector2d>& corners) {
  double twice_area = 0;
  for (size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d& a = corners[i];
    const Eigen::Vector2d& b = corners[(i + 1) % 4];
    twice_area += a.x() * b.y() - b.x() * a.y();
  }
  return twice_area < 0;  // bottom left, bottom right, top right; y goes down
}

absl::Status CheckMirrored(const PoseProblem& problem) {
  std::map<std::string, std::pair<int, int>> wrong_of_all;
  for (const TagSighting& seen : problem.sightings) {
    if (seen.corners.size() != 4) continue;
    auto& [wrong, all] = wrong_of_all[seen.view];
    wrong += GoesRoundRightly(seen.corners) ? 0 : 1;
    all += 1;
  }
  for (const auto& [view, counts] : wrong_of_all) {
    if (counts.first > 0.5 * counts.second) {
      return FailedPrecondition(
          "view '", view, "': the tags' corners go round the wrong way in ", counts.first, " of ",
          counts.second,
          " sightings, so the images or the tags are mirrored, or the corners are not "
          "in the order bottom left, bottom right, top right, top left");
    }
  }
  return absl::OkStatus();
}

// Something moves between frames, so that no corner comes twice at exactly the same place.
absl::Status CheckSameImages(const PoseProblem& problem) {
  std::map<std::string, bool> on_flange;
  for (const PoseView& view : problem.views) on_flange[view.name] = view.on_flange;
  std::map<std::tuple<std::string, std::string, int, double, double>, std::string> frames;
  for (const TagSighting& seen : problem.sightings) {
    const bool moves =
        on_flange[seen.view] || std::ranges::any_of(problem.boards, [&](const PoseBoard& board) {
          return board.place == BoardPlace::kFlange && board.board.HasTag(seen.family, seen.tag);
        });
    if (!moves) continue;
    const auto [other, added] = frames.emplace(
        std::tuple(seen.view, seen.family, seen.tag, seen.corners[0].x(), seen.corners[0].y()),
        seen.frame);
    if (!added) {
      return FailedPrecondition("view '", seen.view, "' has the same image in the frames '",
                                other->second, "' and '", seen.frame,
                                "'; leave out the one that does not belong to its "
                                "pose of the robot");
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckProblem(const PoseProblem& problem) {
  if (problem.views.empty()) return InvalidArgument("there is no view");
  if (problem.sightings.empty()) return FailedPrecondition("no tag was seen");
  const RobotNoise& noise = problem.robot_noise;
  if (!(noise.position_sigma > 0) || !(noise.rotation_sigma > 0)) {
    return InvalidArgument("the robot's sigmas must be positive");
  }
  for (const auto check : {CheckViews, CheckBoardsOf, CheckRobotPoses, CheckSightings,
                           CheckSameImages, CheckMirrored}) {
    RETURN_IF_ERROR(check(problem));
  }
  return absl::OkStatus();
}

std::string FewOf(const std::vector<std::string>& names) {
  constexpr size_t kFew = 5;
  std::string few;
  for (size_t i = 0; i < names.size() && i < kFew; ++i) {
    absl::StrAppend(&few, i == 0 ? "" : ", ", names[i]);
  }
  if (names.size() > kFew) absl::StrAppend(&few, " and ", names.size() - kFew, " more");
  return few;
}

}  // namespace silhouette
