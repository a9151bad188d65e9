// SPDX-License-Identifier: Apache-2.0
// silhouette-sim serve: the devices of the simulated cell on the network, as those of a real cell.
#include <cstdlib>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "capture/session/travel.h"
#include "db/status/status_macros.h"
#include "tools/program/joint_values.h"
#include "tools/program/program.h"
#include "tools/silhouette-sim/commands.h"
#include "tools/silhouette-sim/serve.h"
#include "tools/silhouette-sim/workplace.h"

namespace silhouette {
namespace {

constexpr absl::Duration kTick = absl::Milliseconds(20);

struct ServeArguments {
  WorkplaceArguments workplace;
  std::string robot;
  std::string robot_address;
  std::string cameras;
  int camera_port = 0;
  bool without_robot = false;
  FaultArguments faults;
};

// Where a robot stands before a capture: the configuration nearest to the middle of the grid, in
// grid steps, that it may be in.
absl::Status PlaceRobot(const Workplace& workplace, SimulatedCell& simulation) {
  const Travel travel(workplace.cell.grid, workplace.cell.capture.forbidden_regions);
  const ConfigurationGrid& grid = travel.grid();
  const auto from_middle = [&](ConfigurationNumber number) {
    const GridIndex index = *grid.IndexOf(number);
    int sum = 0;
    for (int j = 0; j < grid.dimensions(); ++j) {
      const auto place = static_cast<size_t>(j);
      sum += std::abs(2 * index[place] - (grid.joints()[place].steps - 1));
    }
    return sum;
  };
  std::optional<ConfigurationNumber> nearest;
  int least = 0;
  for (const ConfigurationNumber number : travel.Serpentine()) {
    if (travel.Forbidden(number)) continue;
    const int distance = from_middle(number);
    if (nearest && distance >= least) continue;
    nearest = number;
    least = distance;
  }
  if (!nearest) return absl::OkStatus();
  ASSIGN_OR_RETURN(const auto positions, workplace.Positions(grid.At(*nearest)));
  simulation.SetPositions(positions);
  return absl::OkStatus();
}

absl::StatusOr<ExitCode> Serve(const ServeArguments& arguments) {
  ASSIGN_OR_RETURN(Workplace workplace, LoadWorkplace(arguments.workplace));
  if (arguments.robot.empty() && arguments.cameras.empty()) {
    return absl::InvalidArgumentError("say what to serve, with --robot, --cameras or both");
  }
  ASSIGN_OR_RETURN(auto settings, SimulationOf(workplace.cell));
  const auto simulation = std::make_shared<SimulatedCell>(workplace.robot, std::move(settings));
  // With noise of its own, as cameras that are started again have: repeated images are frozen ones.
  simulation->SetFrame(static_cast<uint64_t>(absl::ToUnixMicros(absl::Now())));
  simulation->SetRobotPresent(!arguments.without_robot);
  simulation->SetObstacles(std::move(workplace.obstacles));
  RETURN_IF_ERROR(PlaceRobot(workplace, *simulation));

  nlohmann::ordered_json served;
  std::optional<ServedRobot> robot;
  if (!arguments.robot.empty()) {
    ASSIGN_OR_RETURN(auto started,
                     ServeRobot(workplace, arguments.robot, arguments.robot_address, simulation));
    robot = std::move(started);
    served["robot"] = robot->told;
  }
  std::optional<ServedCameras> cameras;
  if (!arguments.cameras.empty()) {
    ASSIGN_OR_RETURN(auto started,
                     ServeCameras(workplace, arguments.cameras, arguments.camera_port, simulation));
    cameras = std::move(started);
    served["cameras"] = cameras->told;
  }
  ASSIGN_OR_RETURN(auto faults, FaultsOf(arguments.faults, robot ? &*robot : nullptr,
                                         cameras ? &*cameras : nullptr));
  if (arguments.workplace.json()) {
    std::cout << served.dump() << std::endl;
  } else {
    for (const auto& [device, told] : served.items()) {
      std::cout << "serving the " << device << ": " << told.dump() << std::endl;
    }
    std::cout << "ready; Ctrl-C ends it" << std::endl;
  }
  CatchStopSignals();
  while (!StopRequested()) {
    for (ServedFault& fault : faults) {
      RETURN_IF_ERROR(fault.Step(absl::Now()));
    }
    absl::SleepFor(kTick);
  }
  return kDone;
}

void AddFaultOptions(CLI::App& command, FaultArguments& faults) {
  command
      .add_option("--robot-fault", faults.robot,
                  "What goes wrong with the robot: stays, it ignores move commands;\n"
                  "half-way, it stops on its way; drifts, it moves without a command;\n"
                  "e-stop, on its way; lost, its connection")
      ->check(CLI::IsMember(kRobotFaults));
  command.add_option("--after-moves", faults.after_moves, "Begin after this many move commands")
      ->check(NumberFromZero())
      ->capture_default_str();
  command
      .add_option("--camera-fault", faults.cameras,
                  "What goes wrong with the cameras: lost, their connection; drops, they lose\n"
                  "packets and so images (gige); freezes, they send the same image again and again")
      ->check(CLI::IsMember(kCameraFaults));
  command.add_option("--after-images", faults.after_images, "Begin after this many sets of images")
      ->check(NumberFromZero())
      ->capture_default_str();
  TakeTimes(
      command.add_option("--fault-time", faults.seconds, "How long the faults last; 0: for good"),
      0, 1e6)
      ->default_str("0");
}

}  // namespace

void AddServeCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "serve",
      "Serve the devices of the simulated cell on the network, as those of a real cell, until\n"
      "Ctrl-C; prints where they are as soon as they can be reached");
  auto arguments = std::make_shared<ServeArguments>();
  AddWorkplaceOptions(*command, arguments->workplace, false);
  command
      ->add_option("--robot", arguments->robot,
                   "What the robot's controller speaks: simple_message (ROS-Industrial), or\n"
                   "grpc (RobotDriverService)")
      ->check(CLI::IsMember(kRobotKinds));
  command->add_option(
      "--robot-address", arguments->robot_address,
      "Where it listens, e.g. 127.0.0.1:11000: simple_message there for motion and two ports\n"
      "further for the state; port 0: free ones. Default: 127.0.0.1, and the ports of the cell's\n"
      "file, or 50061 for grpc");
  command
      ->add_option(
          "--cameras", arguments->cameras,
          "What the cameras are, one for each view: gige (GigE Vision, at 127.0.0.1,\n"
          "127.0.0.2 and so on, the views' names their serial numbers), rtsp (streams) or\n"
          "grpc (a CameraDriverService)")
      ->check(CLI::IsMember(kCameraKinds));
  command
      ->add_option("--camera-port", arguments->camera_port,
                   "Where rtsp and grpc listen at 127.0.0.1; 0: a free port")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command->add_flag("--without-robot", arguments->without_robot,
                    "Take the robot out of the images, as for reference images");
  AddFaultOptions(*command, arguments->faults);
  command->footer(
      "Examples:\n"
      "  silhouette-sim serve --cell cell.yaml --robot simple_message --robot-address 127.0.0.1:0\n"
      "  silhouette-sim serve --cell cell.yaml --robot simple_message --cameras gige\n"
      "  silhouette-sim serve --cell cell.yaml --robot grpc --robot-fault lost --after-moves 20 "
      "--fault-time 10");
  command->callback([arguments, &run] { run = [arguments] { return Serve(*arguments); }; });
}

}  // namespace silhouette
