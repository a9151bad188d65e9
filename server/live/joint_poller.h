// Asks the robot for its joints, again and again.
#pragma once

#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/devices/devices.h"
#include "server/live/joint_history.h"
#include "server/live/live_record.h"
#include "server/live/live_settings.h"
#include "server/scene/clock.h"
#include "server/scene/joint_position.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

using OpenRobotFunction = std::function<absl::StatusOr<std::unique_ptr<Robot>>()>;

// Has a thread of its own. Errors of the robot end nothing: they are recorded, and it is asked
// again, after a while it is opened anew.
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
  std::vector<std::string> joints_;  // of the cell
  std::unique_ptr<Robot> robot_;     // null: to be opened
  JointHistory history_;
  std::jthread thread_;  // last: it uses the others
};

}  // namespace silhouette
