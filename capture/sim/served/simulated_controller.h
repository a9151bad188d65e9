// SPDX-License-Identifier: Apache-2.0
// SimulatedController: what a robot's controller does, for the robot of a simulated cell. It moves
// in real time and can be made to fail in the ways in which real ones do.
#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "calib/robot/robot_model.h"
#include "capture/sim/simulated_cell.h"

namespace silhouette {

enum class ControllerFault {
  kNone,
  kStaysWhereItIs,  // takes moves and does not set off
  kStopsHalfWay,    // without a word
  kDrifts,          // moves off at once, without a command
  kTooFast,         // ten times as fast as commanded
  kEmergencyStop,   // says so, and refuses to move
  kTripsOnTheWay,   // emergency stop half way
};

// Thread-safe.
class SimulatedController {
 public:
  struct State {
    std::vector<double> positions;
    bool moving = false;
    bool e_stopped = false;
  };

  // `show` receives the robot's position whenever it changes, from a thread of the controller.
  // joint_speed: radians or metres per second, the most that the robot can; 0: any.
  using Show = std::function<void(std::span<const double>)>;
  SimulatedController(RobotModel robot, double joint_speed, std::vector<double> start, Show show);

  // Moves the robot of a simulated cell.
  explicit SimulatedController(const std::shared_ptr<SimulatedCell>& cell);
  ~SimulatedController();

  const std::vector<std::string>& joints() const { return joints_; }
  State state() const;

  // Sets off for `goal`, all joints at once, instead of whatever it is doing; takes `duration`, or
  // longer if the simulation's joint_speed is above 0 and says so. InvalidArgument: not as many
  // values as joints, or beyond a limit. FailedPrecondition: emergency stop.
  absl::Status Move(std::span<const double> goal, absl::Duration duration);
  void Stop();

  void SetFault(ControllerFault fault);
  // The numbers of move and stop commands.
  int moves() const;
  int stops() const;

 private:
  struct Way {
    std::vector<double> start = {};
    std::vector<double> goal = {};
    absl::Time begin = {};
    absl::Duration duration = {};
    double last_share = 1;  // where it ends
    bool trips = false;
  };

  void Run();
  // With mutex_ held: where the robot is on its way now.
  void Step();

  const RobotModel robot_;
  const double joint_speed_;
  const Show show_;
  std::vector<std::string> joints_;

  mutable std::mutex mutex_;  // guards all below
  std::condition_variable changed_;
  std::vector<double> positions_;
  bool moving_ = false;
  Way way_;
  ControllerFault fault_ = ControllerFault::kNone;
  bool e_stopped_ = false;
  int moves_ = 0;
  int stops_ = 0;
  bool ending_ = false;

  std::thread thread_;
};

}  // namespace silhouette
