#include "calib/poses/pose_network.h"

#include <algorithm>
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
#include "calib/poses/words.h"

namespace silhouette {
namespace {

// Places in the problem by name.
struct Names {
  std::map<std::string, int> views;
  std::map<std::string, int> robot_poses;
};

// No robot reaches as far, so that its positions must be in millimetres.
constexpr double kFarthestFlange = 50;  // metres

absl::Status CheckRobotPoses(const PoseProblem& problem, Names& names) {
  for (const RobotPose& pose : problem.robot_poses) {
    const int place = static_cast<int>(names.robot_poses.size());
    if (!names.robot_poses.emplace(pose.frame, place).second) {
      return absl::InvalidArgumentError(
          absl::StrCat("frame '", pose.frame, "' has two poses of the robot; leave one"));
    }
    const Eigen::Matrix3d rotation = pose.base_from_flange.linear();
    if (!pose.base_from_flange.matrix().allFinite() ||
        !(rotation * rotation.transpose()).isIdentity(1e-6)) {
      return absl::InvalidArgumentError(
          absl::StrCat("the robot's pose of frame '", pose.frame, "' is not one"));
    }
    if (pose.base_from_flange.translation().norm() > kFarthestFlange) {
      return absl::FailedPreconditionError(absl::StrFormat(
          "the robot's pose of frame '%s' is %.0f m from its base; it looks as if positions are in "
          "millimetres; give metres",
          pose.frame, pose.base_from_flange.translation().norm()));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<Names> NamesOf(const PoseProblem& problem) {
  Names names;
  for (const PoseView& view : problem.views) {
    const int place = static_cast<int>(names.views.size());
    if (!names.views.emplace(view.name, place).second) {
      return absl::InvalidArgumentError(absl::StrCat("view '", view.name, "' is there twice"));
    }
  }
  std::map<std::pair<std::string, int>, std::string> tags;
  std::set<std::string> boards;
  for (const PoseBoard& board : problem.boards) {
    const BoardDescription& d = board.board.description();
    if (!boards.insert(d.name).second) {
      return absl::InvalidArgumentError(absl::StrCat("board '", d.name, "' is there twice"));
    }
    if (board.place == BoardPlace::kSurveyed &&
        (!(board.position_sigma > 0) || !(board.rotation_sigma > 0))) {
      return absl::InvalidArgumentError(
          absl::StrCat("the survey of board '", d.name, "' must have positive sigmas"));
    }
    for (int tag = d.first_id; tag < d.first_id + board.board.tags(); ++tag) {
      const auto [other, added] = tags.emplace(std::pair(d.family, tag), d.name);
      if (!added) {
        return absl::InvalidArgumentError(absl::StrCat("tag ", tag, " (", d.family,
                                                       ") is on the boards '", other->second,
                                                       "' and '", d.name, "'"));
      }
    }
  }
  const RobotNoise& noise = problem.robot_noise;
  if (!(noise.position_sigma > 0) || !(noise.rotation_sigma > 0)) {
    return absl::InvalidArgumentError("the robot's sigmas must be positive");
  }
  const absl::Status checked = CheckRobotPoses(problem, names);
  if (!checked.ok()) return checked;
  return names;
}

absl::Status CheckSighting(const TagSighting& seen) {
  const bool finite = std::all_of(seen.corners.begin(), seen.corners.end(),
                                  [](const Eigen::Vector2d& corner) { return corner.allFinite(); });
  if (finite && seen.sigma > 0 && std::isfinite(seen.sigma)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("frame '", seen.frame, "', view '", seen.view,
                                                 "', tag ", seen.tag,
                                                 ": corners must be finite and sigma positive"));
}

// The index of the board that has the tag; -1 if none has.
int BoardOf(const std::vector<PoseBoard>& boards, const TagSighting& seen) {
  for (size_t i = 0; i < boards.size(); ++i) {
    if (boards[i].board.description().family == seen.family && boards[i].board.HasTag(seen.tag)) {
      return static_cast<int>(i);
    }
  }
  return -1;
}

// Whether a tag's corners go round as in an image that is not mirrored.
bool GoesRoundRightly(const std::array<Eigen::Vector2d, 4>& corners) {
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
    auto& [wrong, all] = wrong_of_all[seen.view];
    wrong += GoesRoundRightly(seen.corners) ? 0 : 1;
    all += 1;
  }
  for (const auto& [view, counts] : wrong_of_all) {
    if (counts.first > 0.5 * counts.second) {
      return absl::FailedPreconditionError(
          absl::StrCat("view '", view, "': the tags' corners go round the wrong way in ",
                       counts.first, " of ", counts.second,
                       " sightings, so the images or the tags are mirrored, or the corners are not "
                       "in the order bottom left, bottom right, top right, top left"));
    }
  }
  return absl::OkStatus();
}

// Sorts sightings into looks.
class LookSorter {
 public:
  LookSorter(const PoseProblem& problem, const Names& names, PoseNetwork& network)
      : problem_(problem), names_(names), network_(network) {}

  absl::Status Add(size_t sighting) {
    const TagSighting& seen = problem_.sightings[sighting];
    if (absl::Status checked = CheckSighting(seen); !checked.ok()) return checked;
    const auto view = names_.views.find(seen.view);
    if (view == names_.views.end()) {
      return absl::InvalidArgumentError(absl::StrCat("tags were seen by view '", seen.view,
                                                     "', of which there is no camera model"));
    }
    if (!tags_.insert({seen.frame, seen.view, seen.family, seen.tag}).second) {
      return absl::InvalidArgumentError(absl::StrCat("frame '", seen.frame, "', view '", seen.view,
                                                     "' has tag ", seen.tag,
                                                     " twice; a frame must be one image"));
    }
    const int board = BoardOf(problem_.boards, seen);
    if (board < 0) {
      strangers_.insert(absl::StrCat(seen.tag, " (", seen.family, ")"));
      return absl::OkStatus();
    }
    const bool camera_moves = problem_.views[view->second].on_flange;
    const bool board_moves = problem_.boards[board].place == BoardPlace::kFlange;
    if (camera_moves && board_moves) {
      on_the_same_.insert(seen.view);
      return absl::OkStatus();
    }
    int flange = -1;
    if (camera_moves || board_moves) {
      const auto pose = names_.robot_poses.find(seen.frame);
      if (pose == names_.robot_poses.end()) {
        without_pose_.insert(seen.frame);
        return absl::OkStatus();
      }
      flange = pose->second;
      with_pose_ = true;
    }
    AddCorners(sighting, LookOf(seen.frame, view->second, board, flange), board);
    return absl::OkStatus();
  }

  absl::Status Finish() {
    const std::vector<std::string> without(without_pose_.begin(), without_pose_.end());
    if (!without.empty() && !with_pose_) {
      return absl::FailedPreconditionError(absl::StrCat(
          "no frame has a pose of the robot: ",
          problem_.robot_poses.empty()
              ? std::string("give the robot's poses, as a board or a view is on the flange")
              : absl::StrCat("sightings are of frames like '", without.front(),
                             "', poses of frames like '", problem_.robot_poses.front().frame,
                             "'; call them alike")));
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
    const TagCorners points = problem_.boards[board].board.CornersOf(seen.tag);
    for (int i = 0; i < 4; ++i) {
      look.corners.push_back({points[i], seen.corners[i], seen.sigma, sighting, i});
    }
  }

  const PoseProblem& problem_;
  const Names& names_;
  PoseNetwork& network_;
  std::set<std::tuple<std::string, std::string, std::string, int>> tags_;
  std::map<std::tuple<std::string, int, int>, size_t> looks_;
  std::map<std::pair<std::string, int>, int> board_poses_;
  std::set<std::string> strangers_;
  std::set<std::string> without_pose_;
  std::set<std::string> on_the_same_;
  bool with_pose_ = false;
};

}  // namespace

Eigen::Isometry3d PoseNetwork::LinkOf(const Look& look) const {
  if (look.flange < 0) return Eigen::Isometry3d::Identity();
  const Eigen::Isometry3d& base_from_flange = robot_poses[look.flange].base_from_flange;
  return views[look.view].on_flange ? base_from_flange.inverse() : base_from_flange;
}

absl::StatusOr<PoseNetwork> NetworkOf(const PoseProblem& problem) {
  const absl::StatusOr<Names> names = NamesOf(problem);
  if (!names.ok()) return names.status();
  if (problem.views.empty()) return absl::InvalidArgumentError("there is no view");
  if (problem.sightings.empty()) return absl::FailedPreconditionError("no tag was seen");
  PoseNetwork network;
  network.views = problem.views;
  network.boards = problem.boards;
  network.robot_poses = problem.robot_poses;
  network.camera_poses.resize(problem.views.size());
  for (const PoseView& view : problem.views) {
    try {
      network.lenses.emplace_back(view.lens, Eigen::Isometry3d::Identity());
    } catch (const std::invalid_argument& error) {
      return absl::InvalidArgumentError(absl::StrCat("view '", view.name, "': ", error.what()));
    }
  }
  LookSorter sorter(problem, *names, network);
  for (size_t i = 0; i < problem.sightings.size(); ++i) {
    if (absl::Status added = sorter.Add(i); !added.ok()) return added;
  }
  if (absl::Status finished = sorter.Finish(); !finished.ok()) return finished;
  if (absl::Status checked = CheckMirrored(problem); !checked.ok()) return checked;
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
  return MedianOf(std::move(errors));
}

}  // namespace silhouette
