// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_network.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/poses/pose_problem.h"
#include "common/numbers/numbers.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// Places in the problem by name.
struct Names {
  std::map<std::string, int> views;
  std::map<std::string, int> robot_poses;
};

Names NamesOf(const PoseProblem& problem) {
  Names names;
  for (const PoseView& view : problem.views) {
    names.views.emplace(view.name, static_cast<int>(names.views.size()));
  }
  for (const RobotPose& pose : problem.robot_poses) {
    names.robot_poses.emplace(pose.frame, static_cast<int>(names.robot_poses.size()));
  }
  return names;
}

// The index of the board that has the tag; -1 if none has.
int BoardOf(const std::vector<PoseBoard>& boards, const TagSighting& seen) {
  for (size_t i = 0; i < boards.size(); ++i) {
    if (boards[i].board.HasTag(seen.family, seen.tag)) return static_cast<int>(i);
  }
  return -1;
}

// Sorts sightings into looks.
class LookSorter {
 public:
  LookSorter(const PoseProblem& problem, const Names& names, PoseNetwork& network)
      : problem_(problem), names_(names), network_(network) {}

  void Add(size_t sighting) {
    const TagSighting& seen = problem_.sightings[sighting];
    const int view = names_.views.at(seen.view);
    const int board = BoardOf(problem_.boards, seen);
    if (board < 0) {
      strangers_.insert(absl::StrCat(seen.tag, " (", seen.family, ")"));
      return;
    }
    const bool camera_moves = problem_.views[view].on_flange;
    const bool board_moves = problem_.boards[board].place == BoardPlace::kFlange;
    if (camera_moves && board_moves) {
      on_the_same_.insert(seen.view);
      return;
    }
    int flange = -1;
    if (camera_moves || board_moves) {
      const auto pose = names_.robot_poses.find(seen.frame);
      if (pose == names_.robot_poses.end()) {
        without_pose_.insert(seen.frame);
        return;
      }
      flange = pose->second;
      with_pose_ = true;
    }
    AddCorners(sighting, LookOf(seen.frame, view, board, flange), board);
  }

  absl::Status Finish() {
    network_.warnings = problem_.warnings;
    const std::vector<std::string> without(without_pose_.begin(), without_pose_.end());
    if (!without.empty() && !with_pose_) {
      return FailedPrecondition(
          "no frame has a pose of the robot: ",
          problem_.robot_poses.empty()
              ? std::string("give the robot's poses, as a board or a view is on the flange")
              : absl::StrCat("sightings are of frames like '", without.front(),
                             "', poses of frames like '", problem_.robot_poses.front().frame,
                             "'; call them alike"));
    }
    if (!without.empty()) {
      network_.warnings.push_back(absl::StrCat(
          without.size() == 1 ? "a frame has" : absl::StrCat(without.size(), " frames have"),
          " no pose of the robot and do not count for what is on the flange: ", FewOf(without)));
    }
    if (!strangers_.empty()) {
      network_.warnings.push_back(absl::StrCat("tags of no board were seen and left out: ",
                                               FewOf({strangers_.begin(), strangers_.end()})));
    }
    for (const std::string& view : on_the_same_) {
      network_.warnings.push_back(absl::StrCat("view '", view,
                                               "' and a board that it sees are both on the "
                                               "flange; that says nothing and is left out"));
    }
    return absl::OkStatus();
  }

 private:
  Look& LookOf(const std::string& frame, int view, int board, int flange) {
    const auto [place, added] =
        looks_.emplace(std::tuple(frame, view, board), network_.looks.size());
    if (added) {
      Look look;
      look.view = view;
      look.flange = flange;
      look.frame = frame;
      look.board_pose = PoseOf(frame, board);
      network_.looks.push_back(std::move(look));
    }
    return network_.looks[place->second];
  }

  int PoseOf(const std::string& frame, int board) {
    const PoseBoard& known = problem_.boards[board];
    const auto [place, added] = board_poses_.emplace(
        std::pair(known.place == BoardPlace::kLoose ? frame : std::string(), board),
        static_cast<int>(network_.board_poses.size()));
    if (added) {
      BoardPose pose{.board = board, .pose{}};
      if (known.place == BoardPlace::kSurveyed) pose.pose = known.base_from_board;
      network_.board_poses.push_back(pose);
    }
    return place->second;
  }

  void AddCorners(size_t sighting, Look& look, int board) {
    const TagSighting& seen = problem_.sightings[sighting];
    const MarkCorners points = problem_.boards[board].board.CornersOf(seen.tag);
    for (size_t i = 0; i < points.size(); ++i) {
      look.corners.push_back(
          {points[i], seen.corners[i], seen.sigma, sighting, static_cast<int>(i)});
    }
  }

  const PoseProblem& problem_;
  const Names& names_;
  PoseNetwork& network_;
  std::map<std::tuple<std::string, int, int>, size_t> looks_;
  std::map<std::pair<std::string, int>, int> board_poses_;
  std::set<std::string> strangers_;
  std::set<std::string> without_pose_;
  std::set<std::string> on_the_same_;
  bool with_pose_ = false;
};

// Whether what was seen at two of the robot's poses contradicts that nothing moved between them.
bool ImagesMoved(const PoseNetwork& network, const std::vector<std::vector<const Look*>>& looks,
                 size_t one, size_t other) {
  constexpr double kMoved = 2;  // pixels
  std::vector<double> moves;
  for (const Look* a : looks[one]) {
    std::map<std::pair<int, std::array<double, 3>>, Eigen::Vector2d> seen;
    const auto key = [&](const Look& look, const LookCorner& corner) {
      const Eigen::Vector3d& p = corner.point;
      return std::pair(network.board_poses[look.board_pose].board,
                       std::array<double, 3>{p.x(), p.y(), p.z()});
    };
    for (const LookCorner& corner : a->corners) seen.emplace(key(*a, corner), corner.pixel);
    for (const Look* b : looks[other]) {
      if (b->view != a->view) continue;
      for (const LookCorner& corner : b->corners) {
        const auto same = seen.find(key(*b, corner));
        if (same != seen.end()) moves.push_back((same->second - corner.pixel).norm());
      }
    }
  }
  return !moves.empty() && Median(std::move(moves)) > kMoved;
}

std::vector<int> SamePoses(const PoseNetwork& network, const RobotNoise& noise) {
  std::vector<std::vector<const Look*>> looks(network.robot_poses.size());
  for (const Look& look : network.looks) {
    if (look.flange >= 0) looks[look.flange].push_back(&look);
  }
  std::vector<int> same_as;
  for (size_t i = 0; i < network.robot_poses.size(); ++i) {
    size_t first = 0;
    while (first < i && (same_as[first] != static_cast<int>(first) ||
                         !IsSamePose(network.robot_poses[first].base_from_flange,
                                     network.robot_poses[i].base_from_flange, noise) ||
                         ImagesMoved(network, looks, first, i))) {
      ++first;
    }
    same_as.push_back(static_cast<int>(first));
  }
  return same_as;
}

}  // namespace

bool IsSamePose(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, const RobotNoise& noise) {
  const Eigen::Isometry3d off = a.inverse() * b;
  return off.translation().norm() < noise.position_sigma &&
         RotationVectorOf(off).norm() < noise.rotation_sigma;
}

Eigen::Isometry3d PoseNetwork::LinkOf(const Look& look) const {
  if (look.flange < 0) return Eigen::Isometry3d::Identity();
  const Eigen::Isometry3d& base_from_flange = robot_poses[look.flange].base_from_flange;
  return views[look.view].on_flange ? base_from_flange.inverse() : base_from_flange;
}

absl::StatusOr<PoseNetwork> NetworkOf(const PoseProblem& problem) {
  RETURN_IF_ERROR(CheckProblem(problem));
  PoseNetwork network;
  network.views = problem.views;
  network.boards = problem.boards;
  network.robot_poses = problem.robot_poses;
  network.camera_poses.resize(problem.views.size());
  for (const PoseView& view : problem.views) {
    try {
      network.lenses.emplace_back(view.lens);
    } catch (const std::invalid_argument& error) {
      return InvalidArgument("view '", view.name, "': ", error.what());
    }
  }
  const Names names = NamesOf(problem);
  LookSorter sorter(problem, names, network);
  for (size_t i = 0; i < problem.sightings.size(); ++i) sorter.Add(i);
  RETURN_IF_ERROR(sorter.Finish());
  network.same_as = SamePoses(network, problem.robot_noise);
  return network;
}

double MedianError(const CameraModel& lens, const Look& look,
                   const Eigen::Isometry3d& camera_from_board) {
  std::vector<double> errors;
  for (const LookCorner& corner : look.corners) {
    const std::optional<Eigen::Vector2d> pixel = lens.Project(camera_from_board * corner.point);
    if (!pixel) return std::numeric_limits<double>::infinity();
    errors.push_back((*pixel - corner.pixel).norm());
  }
  return MedianOrInfinity(std::move(errors));
}

}  // namespace silhouette
