// silhouette-sim serve: the devices of the simulated cell on the network, as those of a real cell.
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>
#include <variant>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "capture/sim/program/commands.h"
#include "capture/sim/program/serve_cameras.h"
#include "capture/sim/program/workplace.h"
#include "capture/sim/served/grpc_robot_server.h"
#include "capture/sim/served/simple_message_server.h"
#include "capture/sim/served/simulated_controller.h"
#include "capture/travel.h"
#include "tools/program/joint_values.h"
#include "tools/program/program.h"

namespace silhouette {
namespace {

constexpr char kProgram[] = "silhouette-sim serve";
constexpr char kSimpleMessage[] = "simple_message";
constexpr char kGrpc[] = "grpc";
constexpr int kGrpcPort = 50061;

struct Arguments {
  WorkplaceArguments workplace;
  std::string robot;
  std::string robot_address;
  std::string cameras;
  int camera_port = 0;
  bool without_robot = false;
};

// "host:port", or "host".
struct Address {
  std::string host = "127.0.0.1";
  std::optional<int> port;
};

absl::StatusOr<Address> AddressOf(const std::string& text) {
  Address address;
  if (text.empty()) return address;
  const size_t colon = text.rfind(':');
  address.host = text.substr(0, colon);
  if (colon == std::string::npos) return address;
  int port = 0;
  if (!absl::SimpleAtoi(text.substr(colon + 1), &port) || port < 0 || port > 65533) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", text, "' is no address; give one such as 127.0.0.1:11000"));
  }
  address.port = port;
  return address;
}

// The robot of a cell as a controller on the network.
struct ServedRobot {
  std::unique_ptr<SimulatedController> controller;
  // One of them; ends before the controller.
  std::unique_ptr<SimpleMessageServer> simple_message;
  std::unique_ptr<GrpcRobotServer> grpc;
  nlohmann::ordered_json told;
};

// The ports of a port: that of motion, and the one two further for the state.
absl::StatusOr<ServedRobot> ServeSimpleMessage(const Workplace& workplace, const Address& address,
                                               const std::shared_ptr<SimulatedCell>& simulation) {
  SimpleMessageSettings named;
  if (const auto* driver = std::get_if<SimpleMessageSettings>(&workplace.cell.robot.driver)) {
    named = *driver;
  }
  ServedRobot robot;
  robot.controller = std::make_unique<SimulatedController>(simulation);
  if (!named.joints.empty() && named.joints != robot.controller->joints()) {
    return absl::InvalidArgumentError(absl::StrCat(
        workplace.cell.file, ": the simulated controller has the joints ",
        absl::StrJoin(robot.controller->joints(), ", "), "; name them so in 'simple_message'"));
  }
  SimpleMessageServerSettings settings{.host = address.host, .byte_order = named.byte_order};
  settings.motion_port = address.port.value_or(named.motion_port);
  settings.state_port = !address.port       ? named.state_port
                        : *address.port > 0 ? *address.port + 2
                                            : 0;
  auto server = SimpleMessageServer::Start(*robot.controller, settings);
  if (!server.ok()) return server.status();
  robot.simple_message = *std::move(server);
  robot.told = {
      {"driver", kSimpleMessage},
      {"host", settings.host},
      {"motion_port", robot.simple_message->motion_port()},
      {"state_port", robot.simple_message->state_port()},
      {"byte_order", named.byte_order == simple_message::ByteOrder::kBig ? "big" : "little"},
      {"joints", robot.controller->joints()}};
  return robot;
}

absl::StatusOr<ServedRobot> ServeGrpc(const Address& address,
                                      const std::shared_ptr<SimulatedCell>& simulation) {
  ServedRobot robot;
  robot.controller = std::make_unique<SimulatedController>(simulation);
  auto server = GrpcRobotServer::Start(
      *robot.controller, absl::StrCat(address.host, ":", address.port.value_or(kGrpcPort)));
  if (!server.ok()) return server.status();
  robot.grpc = *std::move(server);
  robot.told = {{"driver", kGrpc},
                {"address", robot.grpc->address()},
                {"joints", robot.controller->joints()}};
  return robot;
}

// Where a robot stands before a capture: the first configuration that it may be in.
absl::Status PlaceRobot(const Workplace& workplace, SimulatedCell& simulation) {
  const Travel travel(workplace.cell.grid, workplace.cell.capture.forbidden_regions);
  for (const ConfigurationNumber number : travel.Serpentine()) {
    if (travel.Forbidden(number)) continue;
    const auto positions = workplace.Positions(travel.grid().At(number));
    if (positions.ok()) simulation.SetPositions(*positions);
    return positions.status();
  }
  return absl::OkStatus();
}

absl::Status Serve(const Arguments& arguments) {
  absl::StatusOr<Workplace> workplace = LoadWorkplace(arguments.workplace);
  if (!workplace.ok()) return workplace.status();
  if (workplace->cell.simulation.empty()) {
    return absl::InvalidArgumentError(workplace->cell.file + ": the key 'simulation' is missing");
  }
  if (arguments.robot.empty() && arguments.cameras.empty()) {
    return absl::InvalidArgumentError("say what to serve, with --robot, --cameras or both");
  }
  const auto address = AddressOf(arguments.robot_address);
  if (!address.ok()) return address.status();
  auto settings = LoadSimulation(workplace->cell.simulation);
  if (!settings.ok()) return settings.status();
  const auto simulation = std::make_shared<SimulatedCell>(workplace->robot, *std::move(settings));
  simulation->SetRobotPresent(!arguments.without_robot);
  simulation->SetObstacles(std::move(workplace->obstacles));
  if (absl::Status status = PlaceRobot(*workplace, *simulation); !status.ok()) return status;

  nlohmann::ordered_json served;
  std::optional<ServedRobot> robot;
  if (!arguments.robot.empty()) {
    auto started = arguments.robot == kGrpc ? ServeGrpc(*address, simulation)
                                            : ServeSimpleMessage(*workplace, *address, simulation);
    if (!started.ok()) return started.status();
    robot = *std::move(started);
    served["robot"] = robot->told;
  }
  std::optional<ServedCameras> cameras;
  if (!arguments.cameras.empty()) {
    auto started = ServeCameras(*workplace, arguments.cameras, arguments.camera_port, simulation);
    if (!started.ok()) return started.status();
    cameras = *std::move(started);
    served["cameras"] = cameras->told;
  }
  if (arguments.workplace.json()) {
    std::cout << served.dump() << std::endl;
  } else {
    for (const auto& [device, told] : served.items()) {
      std::cout << "serving the " << device << ": " << told.dump() << std::endl;
    }
    std::cout << "ready; Ctrl-C ends it" << std::endl;
  }
  CatchStopSignals();
  while (!StopRequested()) absl::SleepFor(absl::Milliseconds(50));
  return absl::OkStatus();
}

}  // namespace

void AddServeCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "serve",
      "Serve the devices of the simulated cell on the network, as those of a real cell, until\n"
      "Ctrl-C; prints where they are as soon as they can be reached");
  auto arguments = std::make_shared<Arguments>();
  AddWorkplaceOptions(*command, arguments->workplace, false);
  command
      ->add_option("--robot", arguments->robot,
                   "What the robot's controller speaks: simple_message (ROS-Industrial), or\n"
                   "grpc (RobotDriverService)")
      ->check(CLI::IsMember({kSimpleMessage, kGrpc}));
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
  command->footer(
      "Examples:\n"
      "  silhouette-sim serve --cell cell.yaml --robot simple_message --robot-address 127.0.0.1:0\n"
      "  silhouette-sim serve --cell cell.yaml --robot simple_message --cameras gige");
  command->callback([arguments, &run] {
    run = [arguments]() -> int {
      const absl::Status status = Serve(*arguments);
      return status.ok() ? kDone : Report(kProgram, status);
    };
  });
}

}  // namespace silhouette
