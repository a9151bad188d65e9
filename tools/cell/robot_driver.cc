// SPDX-License-Identifier: Apache-2.0
// The key `driver` in the section `robot` of cell.yaml: who moves the robot.
#include <set>
#include <string>
#include <vector>

#include "tools/cell/sections.h"

namespace silhouette {
namespace {

// What a driver is called in the file.
constexpr char kSim[] = "sim";
constexpr char kSimpleMessage[] = "simple_message";
constexpr char kGrpc[] = "grpc";
constexpr char kManual[] = "manual";

int Port(const YamlNode& node) {
  const int port = node.As<int>();
  if (port < 1 || port > 65535) node.Fail("a port of 1 to 65535 is expected");
  return port;
}

std::vector<std::string> Joints(const YamlNode& node) {
  std::vector<std::string> joints = node.Values<std::string>();
  if (joints.empty() || joints.size() > simple_message::kMostJoints) {
    node.Fail("the names of 1 to " + std::to_string(simple_message::kMostJoints) +
              " joints are expected");
  }
  if (std::set<std::string>(joints.begin(), joints.end()).size() != joints.size()) {
    node.Fail("a joint is named twice");
  }
  return joints;
}

SimpleMessageSettings ReadSimpleMessage(const YamlNode& node) {
  YamlMap map(node);
  SimpleMessageSettings settings;
  settings.host = map.Get<std::string>("host");
  map.Read("motion_port", settings.motion_port, Port);
  map.Read("state_port", settings.state_port, Port);
  if (map.Required("byte_order").AsWordOf({"big", "little"}) == 0) {
    settings.byte_order = simple_message::ByteOrder::kBig;
  }
  settings.joints = Joints(map.Required("joints"));
  map.Read("trajectory", settings.trajectory, [](const YamlNode& trajectory) {
    return trajectory.AsWordOf({"download", "streaming"}) == 0
               ? SimpleMessageSettings::Trajectory::kDownload
               : SimpleMessageSettings::Trajectory::kStreaming;
  });
  map.Read("message", settings.point, [](const YamlNode& message) {
    return message.AsWordOf({"full", "simple"}) == 0 ? SimpleMessageSettings::PointMessage::kFull
                                                     : SimpleMessageSettings::PointMessage::kSimple;
  });
  if (const auto velocity = map.Optional("velocity")) {
    settings.velocity = velocity->As<double>();
    if (!(settings.velocity > 0 && settings.velocity <= 1)) {
      velocity->Fail("a share above 0 and up to 1 is expected");
    }
  }
  map.Read("timeout", settings.timeout, &YamlNode::AsPositiveTime);
  map.Finish();
  return settings;
}

GrpcRobotSettings RobotDriverReadGrpc(const YamlNode& node, const std::filesystem::path& folder) {
  YamlMap map(node);
  GrpcRobotSettings settings;
  settings.address = map.Get<std::string>("address");
  map.Read("timeout", settings.timeout, &YamlNode::AsPositiveTime);
  if (const auto tls = map.Optional("tls")) settings.tls = ReadClientTls(*tls, folder);
  map.Finish();
  return settings;
}

ManualRobotSettings ReadManual(const YamlNode& node, const std::filesystem::path& folder) {
  YamlMap map(node);
  ManualRobotSettings settings;
  const auto joints = map.Optional("joints");
  if (joints) settings.typed = joints->AsWordOf({"typed", "confirmed"}) == 0;
  const auto read = map.Optional("read");
  map.Finish();
  if (!read) return settings;
  if (joints) joints->Fail("it goes with no 'read', by which the joints are read");
  YamlMap reader(*read);
  const auto simple_message = reader.Optional(kSimpleMessage);
  const auto grpc = reader.Optional(kGrpc);
  reader.Finish();
  if (simple_message.has_value() == grpc.has_value()) {
    read->Fail("'simple_message: {...}' or 'grpc: {...}' is expected");
  }
  if (simple_message) settings.read = ReadSimpleMessage(*simple_message);
  if (grpc) settings.read = RobotDriverReadGrpc(*grpc, folder);
  return settings;
}

}  // namespace

ClientTlsFiles ReadClientTls(const YamlNode& node, const std::filesystem::path& folder) {
  YamlMap map(node);
  ClientTlsFiles files{.ca = ResolvePath(folder, map.Get<std::string>("ca")),
                       .certificate = ResolvePath(folder, map.Get<std::string>("certificate")),
                       .key = ResolvePath(folder, map.Get<std::string>("key"))};
  map.Finish();
  return files;
}

RobotDriver ReadRobotDriver(const YamlNode& node, const std::filesystem::path& folder) {
  const std::string known = "known are 'sim', 'manual', 'simple_message: {...}' and 'grpc: {...}'";
  if (!node.IsMap()) {
    const std::string name = node.As<std::string>();
    if (name == kSim) return SimulatedRobotDriver{};
    if (name == kManual) return ManualRobotSettings{};
    if (name == kGrpc) node.Fail("say 'grpc: {address: HOST:PORT}'");
    if (name == kSimpleMessage)
      node.Fail("say at least 'simple_message: {host, byte_order, joints}'");
    node.Fail("the driver '" + name + "' is not known; " + known);
  }
  YamlMap map(node);
  const std::vector<std::string> keys = map.Keys();
  if (keys.size() != 1) node.Fail("one driver is expected; " + known);
  if (keys[0] == kSimpleMessage) return ReadSimpleMessage(map.Required(kSimpleMessage));
  if (keys[0] == kGrpc) return RobotDriverReadGrpc(map.Required(kGrpc), folder);
  if (keys[0] == kManual) return ReadManual(map.Required(kManual), folder);
  node.Fail("the driver '" + keys[0] + "' is not known; " + known);
}

}  // namespace silhouette
