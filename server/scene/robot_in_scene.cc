// SPDX-License-Identifier: Apache-2.0
#include "server/scene/robot_in_scene.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/text/degrees_hint.h"
#include "db/mask/configuration_grid.h"
#include "db/status/status_macros.h"

namespace silhouette {

std::vector<std::string> JointNames(const storage::v1::CellDescription& cell) {
  std::vector<std::string> names;
  for (const auto& joint : cell.grid_joints()) names.push_back(joint.name());
  for (const auto& joint : cell.fixed_joints()) names.push_back(joint.name());
  return names;
}

namespace {

using Positions = std::map<std::string, double>;

absl::StatusOr<Positions> PositionsByName(const storage::v1::CellDescription& cell,
                                          const std::vector<JointPosition>& joints) {
  const std::vector<std::string> known = JointNames(cell);
  Positions positions;
  for (size_t i = 0; i < joints.size(); ++i) {
    const std::string field = absl::StrCat("joints[", i, "]: ");
    const std::string& name = joints[i].name;
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      return absl::InvalidArgumentError(
          absl::StrCat(field, "the cell has no joint '", name, "'; its joints are ",
                       absl::StrJoin(known, ", "), "; leave out those that follow others (mimic)"));
    }
    if (!std::isfinite(joints[i].position)) {
      return absl::InvalidArgumentError(
          absl::StrCat(field, "the position of '", name, "' is not a finite number"));
    }
    if (!positions.emplace(name, joints[i].position).second) {
      return absl::InvalidArgumentError(absl::StrCat(field, "joint '", name, "' is given twice"));
    }
  }
  return positions;
}

// "(0.5, -0.2)", to a millionth.
std::string PlaceText(const Configuration& q) {
  const auto append = [](std::string* text, double value) {
    absl::StrAppend(text, std::round(value * 1e6) / 1e6 + 0.0);  // not "-0"
  };
  return absl::StrCat("(", absl::StrJoin(q, ", ", append), ")");
}

std::string UnitHint(const Configuration& q) { return DegreesHint(q, ", or publish radians"); }

// "0.5", or "0.499 to 0.502".
std::string PlacesOf(const FixedJointRange& joint) {
  if (joint.lowest == joint.highest) return absl::StrCat(joint.lowest);
  return absl::StrCat(joint.lowest, " to ", joint.highest);
}

void CheckFixedJoints(const ServedDatabase& database, const Positions& positions, double tolerance,
                      std::vector<SceneDefect>& defects) {
  for (const FixedJointRange& joint : database.fixed_joints()) {
    const auto told = positions.find(joint.name);
    if (told == positions.end()) {
      defects.push_back({Reason::kFixedJointMoved,
                         absl::StrCat("joint '", joint.name,
                                      "' has no value; publish its position: the robot images "
                                      "hold only where it stood at capture")});
    } else if (!(std::abs(told->second - joint.lowest) <= tolerance &&
                 std::abs(told->second - joint.highest) <= tolerance)) {
      defects.push_back(
          {Reason::kFixedJointMoved,
           absl::StrCat("joint '", joint.name, "' is at ", told->second, "; move it to ",
                        joint.position, ": the robot images were captured with it at ",
                        PlacesOf(joint), " (tolerance ", tolerance, ")")});
    }
  }
}

// The grid joints' values; nothing, and a defect, if one is missing.
std::optional<Configuration> GridConfiguration(const ConfigurationGrid& grid,
                                               const Positions& positions,
                                               std::vector<SceneDefect>& defects) {
  Configuration q;
  for (const GridJoint& joint : grid.joints()) {
    const auto told = positions.find(joint.name);
    if (told == positions.end()) {
      defects.push_back(
          {Reason::kRobotPositionUnknown, absl::StrCat("joint '", joint.name,
                                                       "' has no value; publish the robot's "
                                                       "joints together with the images")});
      return std::nullopt;
    }
    q.push_back(told->second);
  }
  return q;
}

std::string WhyUnusable(const ServedDatabase& database, RobotImageState state) {
  switch (state) {
    case RobotImageState::kExcluded:
      return "lies in a region the robot must never enter";
    case RobotImageState::kCorrupt:
      return "has a robot image that fails its checksum; capture it again";
    case RobotImageState::kElsewhere:
      return absl::StrCat("has a robot image that was captured with a fixed joint elsewhere, as ",
                          database.elsewhere(),
                          "; 'silhouette-db verify' lists it; capture it again");
    case RobotImageState::kSuspect:
      return "has a robot image that was captured while the cell may have changed; capture it "
             "again with 'silhouette-capture run --only suspect'";
    default:
      return "has no robot image; capture it";
  }
}

// The robot as it is drawn at `q`; none, and a defect, if it cannot be there.
std::vector<RobotCover> DrawnCoversAt(const ServedDatabase& database, const Configuration& q,
                                      std::vector<SceneDefect>& defects) {
  const RobotImageTable& images = database.robot_images();
  const RobotImageState state = images.StateBetween(q, q);
  if (state != RobotImageState::kPresent) {
    const std::string place = absl::StrCat("the robot is at ", PlaceText(q), ", ");
    defects.push_back(state == RobotImageState::kExcluded
                          ? SceneDefect{Reason::kRobotImageOfSceneMissing,
                                        absl::StrCat(place, "which ", WhyUnusable(database, state))}
                          : SceneDefect{Reason::kRobotPositionUnknown,
                                        absl::StrCat(place,
                                                     "outside the limits of its joints, or "
                                                     "outside the grid; move it back",
                                                     UnitHint(q))});
    return {};
  }
  const std::vector<Mask> touched = images.drawn()->Touched(q);
  const std::vector<Mask> covered = images.drawn()->Covered(q);
  std::vector<RobotCover> covers;
  for (size_t view = 0; view < touched.size(); ++view) {
    covers.push_back({touched[view], touched[view] & covered[view]});
  }
  return covers;
}

// The robot images at the corners around `q`; none, and a defect, if one cannot be used.
std::vector<RobotCover> CoversAt(const ServedDatabase& database, const Configuration& q,
                                 std::vector<SceneDefect>& defects) {
  const RobotImageTable& images = database.robot_images();
  if (images.drawn() != nullptr) return DrawnCoversAt(database, q, defects);
  const std::string place = PlaceText(q);
  const CellCorners corners = database.grid().CornersAround(q);
  if (corners.count() == 0) {
    defects.push_back(
        {Reason::kRobotPositionUnknown,
         absl::StrCat("the robot is at ", place, ", outside the grid; move it back", UnitHint(q))});
    return {};
  }
  const auto reason_of = [](RobotImageState state) {
    return state == RobotImageState::kElsewhere ? Reason::kFixedJointMoved
                                                : Reason::kRobotImageOfSceneMissing;
  };
  const auto add_defect = [&](ConfigurationNumber corner, RobotImageState state) {
    const std::string which =
        corners.count() == 1
            ? "which"
            : absl::StrCat("and next to it ", PlaceText(database.grid().At(corner)));
    defects.push_back({reason_of(state), absl::StrCat("the robot is at ", place, ", ", which, " ",
                                                      WhyUnusable(database, state))});
  };
  for (ConfigurationNumber corner : corners.numbers()) {
    const RobotImageState state = images.state(corner);
    // A robot that no view shows covers nothing.
    if (state == RobotImageState::kPresent || state == RobotImageState::kEmpty) continue;
    add_defect(corner, state);
    return {};
  }
  std::vector<RobotCover> covers;
  for (ConfigurationNumber corner : corners.numbers()) {
    const std::optional<std::vector<Mask>> masks = images.Images(corner);
    if (!masks) {
      add_defect(corner, RobotImageState::kCorrupt);
      return {};
    }
    for (size_t view = 0; view < masks->size(); ++view) {
      const Mask& mask = (*masks)[view];
      if (covers.size() == view) {
        covers.push_back({mask, mask});
      } else {
        covers[view] = {covers[view].anywhere | mask, covers[view].certain & mask};
      }
    }
  }
  return covers;
}

}  // namespace

absl::StatusOr<RobotInScene> FindRobot(const ServedDatabase& database,
                                       const std::vector<JointPosition>& joints,
                                       double fixed_joint_tolerance) {
  ASSIGN_OR_RETURN(const Positions positions, PositionsByName(database.cell(), joints));
  RobotInScene robot;
  const std::optional<Configuration> q =
      GridConfiguration(database.grid(), positions, robot.defects);
  if (q) robot.covers = CoversAt(database, *q, robot.defects);
  CheckFixedJoints(database, positions, fixed_joint_tolerance, robot.defects);
  return robot;
}

}  // namespace silhouette
