// SPDX-License-Identifier: Apache-2.0
// FeedbackRobot: a robot behind a ControllerLink. Nothing is assumed of where it is: it has arrived
// when its feedback says so, and it is stopped when its feedback is doubtful - on its way and where
// it stands.
#pragma once

#include <condition_variable>
#include <functional>
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
#include "capture/devices/devices.h"
#include "capture/drivers/robots/motion_watch.h"

namespace silhouette {

// ControllerLink: the connection to a robot's controller, as FeedbackRobot uses it.

class ControllerLink {
 public:
  struct Observer {
    // The robot reported its state.
    std::function<void(const RobotFeedback&)> feedback;
    // The connection failed, or the robot refused a move after it had been sent.
    std::function<void(const absl::Status&)> failed;
  };

  virtual ~ControllerLink() = default;

  // In the robot's order.
  virtual const std::vector<std::string>& joints() const = 0;

  // From then on threads of the link call the observer, until the link is destroyed.
  // Called once, before everything below.
  virtual void Start(Observer observer) = 0;

  // Sends a move command. Returns once the robot has it, at the latest on arrival. Only the
  // feedback reports arrival.
  virtual absl::Status Move(std::span<const double> goal, absl::Duration duration) = 0;

  // Tells the robot to stop, at once. May be called at any time from any thread but the link's own.
  virtual absl::Status Stop() = 0;
};

// Thread-safe; one MoveTo at a time.
//
// Where a move has ended the robot must stay: if it leaves that place by more than the tolerance
// before the next one, or reports a fault, it receives a stop command; then every call but
// Stop() fails with the reason. A position that is not a number stops it, too, and counts as a
// lost connection. Before the first move, and after a Stop(), it may be moved by
// anybody.
class FeedbackRobot : public Robot {
 public:
  // Throws std::invalid_argument for limits that are none.
  FeedbackRobot(std::unique_ptr<ControllerLink> link, const MotionLimits& limits);
  ~FeedbackRobot() override;

  const std::vector<std::string>& joints() const override { return names_; }

  // Beside the errors of Robot::MoveTo. Aborted: it was stopped on its way, by Stop() or since its
  // feedback was doubtful, or it is not ready, e.g. in emergency stop. Internal: as State().
  absl::Status MoveTo(std::span<const double> positions) override;

  // The newest feedback; waits for the first. Unavailable: there is none that is new enough, or a
  // position is not a number, or since the last call the connection was lost, even for a moment, or
  // feedback was silent for too long; one call of State() or MoveTo() reports such a loss.
  // Internal: the robot does not report one position for each of its joints.
  absl::StatusOr<RobotState> State() override;

  absl::Status Stop() override;

 private:
  void OnFeedback(const RobotFeedback& feedback);
  void OnFailure(const absl::Status& why);
  // Stops a robot that gives reason to while no call waits for it.
  void StopWhenAlarmed();

  // With mutex_ held.
  absl::StatusOr<RobotFeedback> Newest(std::unique_lock<std::mutex>& lock);
  absl::Status Silence(absl::Duration now);
  // Unavailable: as CheckNumbers(). Any other error: the robot may be used no more.
  absl::Status CheckHold(const RobotFeedback& feedback) const;
  // `was_seen`: the positions of the message before were numbers.
  void GuardHold(const RobotFeedback& feedback, bool was_seen);
  // Internal: not one position for each joint.
  absl::Status CheckCount(const RobotFeedback& feedback) const;
  // Unavailable: one is not a number.
  absl::Status CheckNumbers(std::span<const double> positions) const;
  absl::Status WaitForArrival(std::unique_lock<std::mutex>& lock);

  const MotionLimits limits_;
  const std::vector<std::string> names_;

  std::mutex mutex_;  // guards all below but link_
  std::condition_variable changed_;
  std::optional<RobotFeedback> newest_;
  absl::Status newest_count_;    // of newest_: CheckCount
  absl::Status newest_numbers_;  // of newest_: CheckNumbers
  absl::Duration newest_time_;   // running clock
  absl::Status untold_loss_;     // a past one that no call has reported yet
  bool loss_told_ = false;       // of the one that goes on
  Stillness stillness_;
  absl::Status link_failure_;        // the last one; OK again with the next feedback
  std::optional<MotionWatch> move_;  // under way
  absl::Status move_failure_;
  bool stop_asked_ = false;
  // Where it must stay; of continuous joints in the turn of the last goal.
  std::optional<std::vector<double>> hold_;
  absl::Status alarm_;     // why it may be used no more
  bool alarmed_ = false;   // the guard has to stop it
  bool stopping_ = false;  // the guard does
  bool ending_ = false;

  std::thread guard_;
  // Destroyed first: until then it calls OnFeedback() and OnFailure().
  std::unique_ptr<ControllerLink> link_;
};

}  // namespace silhouette
