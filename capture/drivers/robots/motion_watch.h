// SPDX-License-Identifier: Apache-2.0
// MotionWatch: whether a robot carries out a move, judged only by the positions that it reports.
#pragma once

#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace silhouette {

// What one message of a robot says of it.
struct RobotFeedback {
  // In the robot's order; radians, metres. MotionWatch takes one for each joint.
  std::vector<double> positions = {};
  // Whether it moves, if it says so.
  std::optional<bool> moving = {};
  // Why it can go nowhere now, e.g. "emergency stop"; empty: it can.
  std::string fault = {};
  // Why it would not set off now, though it may be well, e.g. "the drives are off"; empty: it
  // would.
  std::string not_ready = {};
  // RobotState::not_before. Nothing: the robot reports by itself, when it arrives.
  std::optional<absl::Duration> not_before = {};
};

struct MotionLimits {
  // Speed of the fastest joint on a way, radians or metres per second: the distance by the time.
  double joint_speed = 0.5;
  // Largest deviation from the goal, and from where it stands when it should stand: radians,
  // metres.
  double tolerance = 0.002;
  // How much longer than twice its time a way may take, and how long a robot on its way may stand.
  absl::Duration patience = absl::Seconds(5);
  // Longest time without a message.
  absl::Duration silence = absl::Seconds(1);
  // By the place of each joint: whether it turns without end, so that reported
  // values may differ by full turns. Joints beyond its end are not continuous.
  std::vector<bool> continuous = {};
};

// Throws std::invalid_argument, naming it, if one is not above 0.
void CheckLimits(const MotionLimits& limits);

// The positions of the last moments: does it stand still?
class Stillness {
 public:
  // How long positions must not change before the robot counts as standing.
  static constexpr absl::Duration kMoment = absl::Milliseconds(80);

  // A change below half of the tolerance is none.
  explicit Stillness(const MotionLimits& limits)
      : change_(limits.tolerance / 2), continuous_(limits.continuous) {}

  void Add(absl::Duration when, const std::vector<double>& positions);
  // Whether they have not changed for kMoment, in three samples at least, however rarely they come;
  // false as long as that is not known.
  bool still() const;
  // Whether they have changed within the last kMoment, or the last three samples.
  bool moving() const;

 private:
  static constexpr size_t kLeast = 3;

  struct Sample {
    absl::Duration when;
    std::vector<double> positions;
  };
  double Change() const;

  double change_;
  std::vector<bool> continuous_;
  std::deque<Sample> samples_;
};

// One way of a robot, straight from the values of its start to those of its goal. Not thread-safe.
class MotionWatch {
 public:
  // `names` of the joints, for messages. `start`: as reported. `held`: the goal before, if the
  // robot has stayed there: continuous joints start in its turn. All of one size; sent at `begin`.
  MotionWatch(std::vector<std::string> names, std::vector<double> start, std::vector<double> goal,
              const MotionLimits& limits, absl::Duration begin,
              const std::optional<std::vector<double>>& held = std::nullopt);

  // How long the way should take if the joints move at joint_speed, also from what was reported.
  absl::Duration duration() const { return duration_; }

  // A message came. Aborted: the robot must be stopped, for the reason that the status says: a
  // fault, much too fast, or a joint that leaves the range between start and goal. Unavailable: it
  // must be stopped, since a position is not a number.
  absl::Status Tell(absl::Duration now, const RobotFeedback& feedback);
  // Asked now and then. DeadlineExceeded: the robot does not arrive; it must be stopped.
  absl::Status CheckTime(absl::Duration now) const;
  // Whether it is where it should be, and stands still.
  bool arrived() const { return arrived_; }

 private:
  std::string WhereItIs() const;

  const std::vector<std::string> names_;
  const std::vector<double> start_;
  const std::vector<double> goal_;
  const MotionLimits limits_;
  const absl::Duration begin_;
  absl::Duration duration_;
  Stillness stillness_;
  std::vector<double> progress_;  // where it was at last_progress_
  std::vector<double> newest_;    // of continuous joints over as many turns as they made
  absl::Duration last_progress_;
  bool arrived_ = false;
};

}  // namespace silhouette
