// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-sim/serve.h"

#include <optional>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "capture/sim/served/grpc_robot_server.h"
#include "capture/sim/served/simple_message_server.h"
#include "common/text/host_port.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr int kGrpcPort = 50061;

struct Address {
  std::string host = "127.0.0.1";
  std::optional<int> port;
};

absl::StatusOr<Address> AddressOf(const std::string& text) {
  Address address;
  if (text.empty()) return address;
  if (text.find(':') == std::string::npos) {
    address.host = text;
    return address;
  }
  const auto parsed = ParseHostPort(text);
  if (!parsed || parsed->port > 65533) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", text, "' is no address; give one such as 127.0.0.1:11000"));
  }
  address.host = parsed->host;
  address.port = parsed->port;
  return address;
}

absl::StatusOr<ServedRobot> ServeSimpleMessage(const Workplace& workplace, const Address& address,
                                               const std::shared_ptr<SimulatedCell>& simulation) {
  SimpleMessageSettings named;
  if (const auto* driver = std::get_if<SimpleMessageSettings>(&workplace.cell.robot.driver)) {
    named = *driver;
  }
  auto controller = std::make_unique<SimulatedController>(simulation);
  if (!named.joints.empty() && named.joints != controller->joints()) {
    return absl::InvalidArgumentError(absl::StrCat(
        workplace.cell.file, ": the simulated controller has the joints ",
        absl::StrJoin(controller->joints(), ", "), "; name them so in 'simple_message'"));
  }
  SimpleMessageServerSettings settings{.host = address.host, .byte_order = named.byte_order};
  settings.motion_port = address.port.value_or(named.motion_port);
  settings.state_port = !address.port       ? named.state_port
                        : *address.port > 0 ? *address.port + 2
                                            : 0;
  ASSIGN_OR_RETURN(auto server, SimpleMessageServer::Start(*controller, settings));
  settings.motion_port = server->motion_port();
  settings.state_port = server->state_port();
  ServedRobot robot;
  robot.told = {
      {"driver", "simple_message"},
      {"host", settings.host},
      {"motion_port", settings.motion_port},
      {"state_port", settings.state_port},
      {"byte_order", named.byte_order == simple_message::ByteOrder::kBig ? "big" : "little"},
      {"joints", controller->joints()}};
  robot.server = std::move(server);
  robot.controller = std::move(controller);
  robot.start = [&controller = *robot.controller,
                 settings]() -> absl::StatusOr<std::shared_ptr<void>> {
    ASSIGN_OR_RETURN(auto again, SimpleMessageServer::Start(controller, settings));
    return std::shared_ptr<void>(std::move(again));
  };
  return robot;
}

absl::StatusOr<ServedRobot> ServeGrpc(const Address& address,
                                      const std::shared_ptr<SimulatedCell>& simulation) {
  auto controller = std::make_unique<SimulatedController>(simulation);
  const HostPort listen{address.host, address.port.value_or(kGrpcPort)};
  ASSIGN_OR_RETURN(auto server, GrpcRobotServer::Start(*controller, listen.Text()));
  const std::string at = server->address();
  ServedRobot robot;
  robot.told = {{"driver", "grpc"}, {"address", at}, {"joints", controller->joints()}};
  robot.server = std::move(server);
  robot.controller = std::move(controller);
  robot.start = [&controller = *robot.controller, at]() -> absl::StatusOr<std::shared_ptr<void>> {
    ASSIGN_OR_RETURN(auto again, GrpcRobotServer::Start(controller, at));
    return std::shared_ptr<void>(std::move(again));
  };
  return robot;
}

}  // namespace

absl::StatusOr<ServedRobot> ServeRobot(const Workplace& workplace, const std::string& kind,
                                       const std::string& address,
                                       const std::shared_ptr<SimulatedCell>& simulation) {
  ASSIGN_OR_RETURN(const Address parsed, AddressOf(address));
  return kind == "grpc" ? ServeGrpc(parsed, simulation)
                        : ServeSimpleMessage(workplace, parsed, simulation);
}

}  // namespace silhouette
