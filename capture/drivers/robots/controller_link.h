// ControllerLink: the connection to a robot's controller, as FeedbackRobot uses it.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "capture/drivers/robots/motion_watch.h"

namespace silhouette {

class ControllerLink {
 public:
  struct Observer {
    // The robot told how it is.
    std::function<void(const RobotFeedback&)> feedback;
    // The connection failed, or the robot refused a move after it had been sent.
    std::function<void(const absl::Status&)> failed;
  };

  virtual ~ControllerLink() = default;

  // In the robot's order.
  virtual const std::vector<std::string>& joints() const = 0;

  // From then on the observer is told, from threads of the link, until the link is destroyed.
  // Called once, before everything below.
  virtual void Start(Observer observer) = 0;

  // Sends the robot off. Returns when it has been told, at the latest when it has arrived; whether
  // it arrives is told by its feedback alone.
  virtual absl::Status Move(std::span<const double> goal, absl::Duration duration) = 0;

  // Tells the robot to stop, at once. May be called at any time from any thread but the link's own.
  virtual absl::Status Stop() = 0;
};

}  // namespace silhouette
