// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_network.h"

#include <Eigen/Dense>
#include <algorithm>
#include <limits>
#include <map>
#include <opencv2/calib3d.hpp>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "calib/poses/pose_problem.h"
#include "common/numbers/numbers.h"

namespace silhouette {
namespace {

// A look is explained if its corners' median error is below this; else single tags are tried.
constexpr double kExplained = 2;  // pixels
// As many looks propose a pose; all judge it.
constexpr size_t kProposals = 40;

using Poses = std::vector<Eigen::Isometry3d>;

// camera_from_board by IPPE from some corners, the likelier first.
Poses PosesBy(const CameraModel& lens, const std::vector<LookCorner>& corners) {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> rays;  // at z = 1
  for (const LookCorner& corner : corners) {
    const std::optional<Eigen::Vector3d> ray = lens.Ray(corner.pixel);
    if (!ray || !(ray->z() > 0)) continue;
    points.emplace_back(corner.point.x(), corner.point.y(), corner.point.z());
    rays.emplace_back(ray->x() / ray->z(), ray->y() / ray->z());
  }
  if (points.size() < 4) return {};
  std::vector<cv::Vec3d> rotations;
  std::vector<cv::Vec3d> translations;
  try {
    cv::solvePnPGeneric(points, rays, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rotations,
                        translations, false, cv::SOLVEPNP_IPPE);
  } catch (const cv::Exception&) {
    return {};
  }
  Poses poses;
  for (size_t i = 0; i < rotations.size(); ++i) {
    const cv::Vec3d& r = rotations[i];
    const cv::Vec3d& t = translations[i];
    const Eigen::Isometry3d pose = PoseOf({r[0], r[1], r[2]}, {t[0], t[1], t[2]});
    if (pose.matrix().allFinite() && t[2] > 0) poses.push_back(pose);
  }
  return poses;
}

// The two that explain the whole look best.
void KeepBest(const CameraModel& lens, const Look& look, Poses& poses) {
  std::ranges::stable_sort(
      poses, {}, [&](const Eigen::Isometry3d& pose) { return MedianError(lens, look, pose); });
  if (poses.size() > 2) poses.resize(2);
}

void FindCandidatesOf(const CameraModel& lens, Look& look) {
  Poses poses = PosesBy(lens, look.corners);
  const bool explained = !poses.empty() && MedianError(lens, look, poses.front()) < kExplained;
  if (!explained && look.corners.size() > 4) {
    // Four corners each, mostly of one tag.
    for (size_t i = 0; i + 4 <= look.corners.size(); i += 4) {
      const auto tag = look.corners.begin() + static_cast<std::ptrdiff_t>(i);
      for (const Eigen::Isometry3d& pose : PosesBy(lens, {tag, tag + 4})) poses.push_back(pose);
    }
  }
  KeepBest(lens, look, poses);
  look.candidates = std::move(poses);
}

class Seeder {
 public:
  explicit Seeder(PoseNetwork& network) : network_(network) {
    for (size_t i = 0; i < network.looks.size(); ++i) {
      if (network.looks[i].candidates.empty()) continue;
      looks_of_view_[network.looks[i].view].push_back(&network.looks[i]);
      looks_of_board_[network.looks[i].board_pose].push_back(&network.looks[i]);
    }
  }

  void Run() {
    SeedByHandEye();
    while (Spread() || SeedByHandEye()) {
    }
  }

  std::vector<std::string> Reasons() const {
    std::vector<std::string> reasons;
    for (size_t view = 0; view < network_.views.size(); ++view) {
      if (!network_.camera_poses[view]) reasons.push_back(ReasonOf(static_cast<int>(view)));
    }
    return reasons;
  }

 private:
  using Looks = std::vector<const Look*>;

  // From all pairs of a view and a board of which neither has a pose, the one that fits best.
  bool SeedByHandEye() {
    std::optional<HandEye> best;
    int best_view = 0;
    int best_board = 0;
    for (const auto& [view, looks] : looks_of_view_) {
      if (network_.camera_poses[view]) continue;
      std::map<int, std::vector<LinkedLook>> by_board;
      std::set<std::pair<int, int>> known;  // once at each pose of the robot
      for (const Look* look : looks) {
        if (look->flange < 0 || network_.board_poses[look->board_pose].pose) continue;
        if (PlaceOf(look->board_pose) == BoardPlace::kLoose) continue;
        if (!known.emplace(look->board_pose, network_.same_as[look->flange]).second) continue;
        by_board[look->board_pose].push_back({look, network_.LinkOf(*look)});
      }
      for (const auto& [board, linked] : by_board) {
        const absl::StatusOr<HandEye> solution = SolveHandEye(network_.lenses[view], linked);
        if (!solution.ok()) {
          failures_[view] = absl::StrCat("view '", network_.views[view].name, "' sees the board '",
                                         NameOf(board), "' ", solution.status().message());
        } else if (!best || solution->median_px < best->median_px) {
          best = *solution;
          best_view = view;
          best_board = board;
        }
      }
    }
    if (!best) return false;
    network_.camera_poses[best_view] = best->camera_pose;
    network_.board_poses[best_board].pose = best->board_pose;
    return true;
  }

  // From known boards to views and back. Returns whether a pose was found.
  bool Spread() {
    bool found = false;
    for (const auto& [board, looks] : looks_of_board_) {
      std::optional<Eigen::Isometry3d>& pose = network_.board_poses[board].pose;
      if (pose) continue;
      Looks known;
      for (const Look* look : looks) {
        if (network_.camera_poses[look->view]) known.push_back(look);
      }
      pose = Best(
          known,
          [&](const Look& look, const Eigen::Isometry3d& seen) {
            return network_.LinkOf(look).inverse() * network_.camera_poses[look.view]->inverse() *
                   seen;
          },
          [&](const Look& look, const Eigen::Isometry3d& found_pose) {
            return *network_.camera_poses[look.view] * network_.LinkOf(look) * found_pose;
          });
      found = found || pose.has_value();
    }
    // The view of which most is known; what it brings helps the next.
    int most = -1;
    Looks of_most;
    for (const auto& [view, looks] : looks_of_view_) {
      if (network_.camera_poses[view]) continue;
      Looks known;
      for (const Look* look : looks) {
        if (network_.board_poses[look->board_pose].pose) known.push_back(look);
      }
      if (known.size() > of_most.size()) {
        most = view;
        of_most = known;
      }
    }
    if (most < 0) return found;
    network_.camera_poses[most] = Best(
        of_most,
        [&](const Look& look, const Eigen::Isometry3d& seen) {
          return seen *
                 (network_.LinkOf(look) * *network_.board_poses[look.board_pose].pose).inverse();
        },
        [&](const Look& look, const Eigen::Isometry3d& found_pose) {
          return found_pose * network_.LinkOf(look) * *network_.board_poses[look.board_pose].pose;
        });
    return found || network_.camera_poses[most].has_value();
  }

  // Of the poses that the looks' candidates propose, the one with the least median error in all.
  template <typename Propose, typename Predict>
  std::optional<Eigen::Isometry3d> Best(const Looks& looks, const Propose& propose,
                                        const Predict& predict) const {
    std::optional<Eigen::Isometry3d> best;
    double least = std::numeric_limits<double>::infinity();
    const size_t step = std::max<size_t>(1, looks.size() / kProposals);
    for (size_t i = 0; i < looks.size(); i += step) {
      for (const Eigen::Isometry3d& seen : looks[i]->candidates) {
        const Eigen::Isometry3d pose = propose(*looks[i], seen);
        std::vector<double> errors;
        for (const Look* look : looks) {
          errors.push_back(MedianError(network_.lenses[look->view], *look, predict(*look, pose)));
        }
        const double error = MedianOrInfinity(std::move(errors));
        if (!best || error < least) {
          best = pose;
          least = error;
        }
      }
    }
    return best;
  }

  BoardPlace PlaceOf(int board_pose) const {
    return network_.boards[network_.board_poses[board_pose].board].place;
  }
  const std::string& NameOf(int board_pose) const {
    return network_.boards[network_.board_poses[board_pose].board].board.description().name;
  }

  std::string ReasonOf(int view) const {
    const std::string& name = network_.views[view].name;
    if (!looks_of_view_.contains(view)) {
      return absl::StrCat(
          "view '", name,
          "' has no usable sighting of a board; if it is not to be solved, leave its "
          "camera model out");
    }
    const auto failure = failures_.find(view);
    if (failure != failures_.end()) return failure->second;
    return absl::StrCat("view '", name,
                        "' is not connected to the robot's base: it sees no surveyed board, no "
                        "board on the flange, and no board at the same time as a view that is");
  }

  PoseNetwork& network_;
  std::map<int, Looks> looks_of_view_;
  std::map<int, Looks> looks_of_board_;
  std::map<int, std::string> failures_;
};

}  // namespace

void FindCandidates(PoseNetwork& network) {
  for (Look& look : network.looks) FindCandidatesOf(network.lenses[look.view], look);
}

std::vector<std::string> SeedPoses(PoseNetwork& network) {
  Seeder seeder(network);
  seeder.Run();
  return seeder.Reasons();
}

}  // namespace silhouette
