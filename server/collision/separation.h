// SPDX-License-Identifier: Apache-2.0
// Speed and separation: how far a robot must stay from people to be able to stop before it touches
// them (ISO/TS 15066:2016, 5.5.4; ISO 13855:2010, 6.2), and how fast it may move so.
//
// What the robot itself moves until it stands is on its path: no place on it may be nearer than
// people come meanwhile.
//
// An aid for planning and for studying a cell, no certified safety function.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calib/robot/drawing/drawn_robot.h"
#include "db/mask/configuration_grid.h"
#include "server/collision/placed_hull.h"
#include "server/collision/space_distances.h"
#include "server/collision/stop.h"

namespace silhouette {

// A speed at which the robot may be driven. Plain values.
struct SpeedLevel {
  std::string name;
  // Fastest point of the robot, m/s.
  double speed = 0;
  // From the command to stop until it stands: s, and metres that its fastest point moves.
  double stopping_time = 0;
  double stopping_distance = 0;

  bool operator==(const SpeedLevel&) const = default;
};

struct SeparationSettings {
  // Of people who walk towards the robot, m/s.
  double human_speed = 1.6;
  // The same for arms and hands: where less than kNear is to be kept, m/s.
  double near_human_speed = 2.0;
  // From a reply until the robot begins to stop, s. What passes before, from the image to the
  // reply, is measured.
  double reaction_time = 0.1;
  // C, metres: how far a part of the body may reach in before it is seen.
  double intrusion = 0;
  // Z, metres: errors of where people and robot are. Those of voxels, masks and calibration are
  // counted already.
  double uncertainty = 0;
  // From slow to fast, at least one.
  std::vector<SpeedLevel> levels;

  bool operator==(const SeparationSettings&) const = default;
};

// Up to here people reach rather than walk, metres (ISO 13855).
inline constexpr double kNear = 0.5;

// Throws std::invalid_argument, with what is wrong, if a number is negative or not finite, there is
// no level, or levels have no name, one name twice, no speed, or are not from slow to fast.
void RequireValid(const SeparationSettings& settings);

// Both in metres. `image_to_reply`: the oldest that what the robot goes by may be when the next
// reply comes, s.

// The protective separation distance of a level from the way that the robot takes until it stands:
// how far people come meanwhile, C and Z.
double ProtectiveDistance(const SeparationSettings& settings, const SpeedLevel& level,
                          double image_to_reply);
// That way: how far the fastest point of the robot moves until it stands. Where its direction is
// not known, it adds to the distance (S_r and S_s of the standard).
double WayToStop(const SeparationSettings& settings, const SpeedLevel& level,
                 double image_to_reply);

// The least distance along a path.
struct PathDistance {
  // Metres, at least, from the robot anywhere on the path to what may hold somebody; at most
  // SpaceDistances::range().
  double distance = 0;
  // The place on the path with the least.
  int segment = 0;
  double fraction = 0;
  // The same at its beginning.
  double at_start = 0;
  // Whether it is that of all of the path.
  bool whole = false;
};

// The levels that keep their distance, slow ones first.
struct KeptLevels {
  size_t count = 0;
  // As far as the fastest of them looks at it, or else the slowest level.
  PathDistance path;
};

// A level is kept if its distance is, and those of all slower ones. `distances`: what they are to
// keep. `along(level)`: of the path as far as this level looks at it; nothing is given if it gives
// nothing.
std::optional<KeptLevels> LevelsKept(
    std::span<const double> distances,
    const std::function<std::optional<PathDistance>(size_t level)>& along);

// How far the robot's parts are from what may hold somebody. Parts that are too large make
// distances too small. Only parts that move are counted: on a path those that it moves, at a single
// configuration those that a joint can move. Refers to both, which must outlive it. To be used by
// one thread.
class SeparationMeter {
 public:
  SeparationMeter(const DrawnRobot& robot, const SpaceDistances& space);

  // Along straight lines between waypoints, of which there is at least one, until the robot's
  // fastest point has moved `horizon` metres on them, and up to kStep on; nothing: all. From one
  // place that is looked at to the next no point of the robot moves farther than kStep. In between,
  // half of the sum of both distances less this step is taken for the distance, if that is less
  // than both. Nothing if `stop`, which is asked at every place, says so, or a value is not finite.
  static constexpr double kStep = 0.02;
  std::optional<PathDistance> Along(std::span<const Configuration> waypoints,
                                    std::optional<double> horizon, const Stop& stop = nullptr);

 private:
  // Counts the parts that the path moves.
  void FindMoving(std::span<const Configuration> waypoints);
  // At a configuration, metres, or `at_most` if it is that far or farther.
  double At(std::span<const double> q, double at_most);

  const DrawnRobot& robot_;
  const SpaceDistances& space_;

  std::vector<PlacedHull> bodies_;  // by part
  size_t nearest_ = 0;              // the part that was nearest at the last place
  std::vector<Eigen::Isometry3d> poses_;
  std::vector<Eigen::Isometry3d> before_;  // poses at the last place
  std::vector<bool> moves_;                // by part
};

}  // namespace silhouette
