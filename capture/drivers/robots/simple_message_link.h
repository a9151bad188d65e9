// SPDX-License-Identifier: Apache-2.0
// SimpleMessageLink: a controller that speaks ROS-Industrial's simple_message over TCP, one
// connection for its state and one for motion.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/drivers/robots/feedback_robot.h"
#include "capture/drivers/robots/robot_driver_settings.h"
#include "capture/drivers/robots/simple_message.h"
#include "capture/drivers/robots/tcp_socket.h"

namespace silhouette {

// The state comes as JOINT_POSITION or JOINT_FEEDBACK (of the first group), and STATUS. Motion is
// commanded with JOINT_TRAJ_PT or JOINT_TRAJ_PT_FULL. The motion connection is made when it is
// needed first, and again after it was lost or an answer did not come, for a robot that must be
// stopped; that of the state is made again every now and then, also if no state comes.
class SimpleMessageLink : public ControllerLink {
 public:
  // Connects to the state's port. Unavailable, InvalidArgument: ConnectTcp's. Throws
  // std::invalid_argument if the joints are none or more than the protocol has.
  static absl::StatusOr<std::unique_ptr<SimpleMessageLink>> Connect(
      const SimpleMessageSettings& settings);
  ~SimpleMessageLink() override;

  const std::vector<std::string>& joints() const override { return settings_.joints; }
  void Start(Observer observer) override;
  // Aborted: the controller refuses. Unavailable, DeadlineExceeded: it cannot be told; a stop was
  // tried twice then.
  absl::Status Move(std::span<const double> goal, absl::Duration duration) override;
  absl::Status Stop() override;

 private:
  SimpleMessageLink(SimpleMessageSettings settings, FileDescriptor state, FileDescriptor wake);

  bool full() const { return settings_.point == SimpleMessageSettings::PointMessage::kFull; }
  // A point in the message that the controller takes, so long after the trajectory's begin.
  simple_message::Message PointOf(int32_t sequence, const simple_message::JointValues& positions,
                                  absl::Duration time) const;

  // Sends a request and waits for its answer. `what` it asks for, for messages.
  absl::Status Request(const simple_message::Message& request, const std::string& what);

  // The thread that reads from both connections.
  void Read();
  void Wake();
  void ReadState();
  void ReadMotion();
  void ConnectAgain();
  void LoseState(const absl::Status& why);
  void Take(const simple_message::Message& message);
  void Tell();

  const SimpleMessageSettings settings_;
  Observer observer_;
  const FileDescriptor wake_;

  // Of the reading thread.
  FileDescriptor state_;
  simple_message::MessageReader state_reader_;
  absl::Duration next_try_;  // running clock, as heard_
  absl::Duration heard_;     // when the last of the state came
  std::optional<simple_message::RobotStatus> status_;

  std::mutex mutex_;  // guards all below
  std::condition_variable answered_;
  bool ending_ = false;
  std::vector<double> positions_;  // the newest; empty: none yet
  FileDescriptor motion_;
  simple_message::MessageReader motion_reader_;
  uint64_t connection_ = 0;  // number of the motion connection
  uint64_t sent_ = 0;        // requests on it
  uint64_t answers_ = 0;
  std::map<uint64_t, bool> results_;  // of requests that somebody waits for

  std::thread thread_;
};

}  // namespace silhouette
