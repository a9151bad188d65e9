// SPDX-License-Identifier: Apache-2.0
// Where the robot was lately, and so where it was when images were taken.
#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/devices/devices.h"
#include "server/live/live_record.h"
#include "server/live/live_settings.h"
#include "server/scene/clock.h"
#include "server/scene/joint_position.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

// Times are those of a clock that never steps back (Moment::running). Thread-safe.
class JointHistory {
 public:
  struct Settings {
    // Longest time between the images and a joint sample, before and after.
    absl::Duration gap = absl::Milliseconds(100);
    // The most that a joint may move around the images.
    double max_movement = 0.01;
  };

  // `continuous`: per joint, whether full turns do not count.
  JointHistory(Settings settings, std::vector<bool> continuous);

  // The robot was asked at `asked` and had answered by `answered`: it was at `positions` at some
  // instant in between. In ascending order; positions of the wrong number or not finite are an
  // error. What is too old to be asked for is forgotten.
  absl::Status Add(absl::Duration asked, absl::Duration answered,
                   std::span<const double> positions);

  // The robot did not answer; `why` is one sentence. Until the next Add() At() does not wait.
  void Fail(const absl::Status& why);

  // A joint's values: the middle, and how far they reach to either side. Radians, metres.
  struct Range {
    double middle = 0;
    double half = 0;
  };

  // Where the robot was from `first` to `last`: by its samples from just before to just after, one
  // range per joint. Waits for the sample after `last`, at most `longest`. Aborted: it moved too
  // much. Unavailable, DeadlineExceeded, or the status given to Fail(): no sample is near enough
  // before or after.
  absl::StatusOr<std::vector<Range>> Between(absl::Duration first, absl::Duration last,
                                             absl::Duration longest) const;

 private:
  struct Sample {
    absl::Duration asked;
    absl::Duration answered;
    std::vector<double> positions;
  };

  // The samples from just before `first` to just after `last`, with the mutex held. Unavailable:
  // there is none before that is near enough; DeadlineExceeded: none after.
  absl::StatusOr<std::span<const Sample>> Around(absl::Duration first, absl::Duration last) const;
  // Aborted: they lie too far apart.
  absl::StatusOr<std::vector<Range>> RangesOf(std::span<const Sample> samples) const;

  const Settings settings_;
  const std::vector<bool> continuous_;
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  std::vector<Sample> samples_;  // oldest first
  absl::Status fault_;           // of the newest question
};

// Asks the robot for its joints, again and again.
using OpenRobotFunction = std::function<absl::StatusOr<std::unique_ptr<Robot>>()>;

// Has a thread of its own. Errors of the robot end nothing: they are recorded, and it is asked
// again; after a while it is opened again.
class JointPoller {
 public:
  // `record` must outlive it. `robot`: opened already, or null.
  JointPoller(const storage::v1::CellDescription& cell, const LiveSettings& settings, Clock clock,
              OpenRobotFunction open, std::unique_ptr<Robot> robot, LiveRecord& record);

  // Where the robot was from `first` to `last`, as JointHistory::Between.
  absl::StatusOr<std::vector<JointPosition>> Between(absl::Duration first,
                                                     absl::Duration last) const;

 private:
  void Run(const std::stop_token& stop);
  // The robot's answer, into the history.
  absl::Status Ask();

  const storage::v1::CellDescription cell_;
  const LiveSettings settings_;
  const Clock clock_;
  const OpenRobotFunction open_;
  LiveRecord& record_;
  std::vector<std::string> joints_;           // of the cell
  std::unique_ptr<Robot> robot_;              // null: to be opened
  std::optional<absl::Duration> not_before_;  // RobotState::not_before of the last sample
  JointHistory history_;
  std::jthread thread_;  // last: it uses the others
};

}  // namespace silhouette
