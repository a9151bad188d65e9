// SPDX-License-Identifier: Apache-2.0
#include <grpcpp/generic/generic_stub.h>

#include "capture/drivers/grpc/grpc_camera.h"
#include "capture/drivers/robots/simple_message.h"
#include "common/picture/mask_png.h"
#include "tests/robustness/parsers/targets.h"
#include "tests/server/service/test_server.h"

namespace silhouette {
namespace {

// A call is the place of its name, and the bytes of its request.
constexpr std::array kCalls = {"CollisionService/CheckConfigurations",
                               "CollisionService/CheckPath",
                               "CollisionService/GetConfigurationSpace",
                               "CollisionService/WatchConfigurationSpace",
                               "CollisionService/WatchPath",
                               "CollisionService/StreamChecks",
                               "CollisionService/Explain",
                               "SceneService/PublishScene",
                               "SceneService/GetScene",
                               "SceneService/ChangeVariant",
                               "SceneService/AllowRegion",
                               "SceneService/RevokeRegion",
                               "SceneService/ListAllowedRegions",
                               "DatabaseService/GetDatabase",
                               "SceneService/WatchScenes"};
constexpr size_t kPublishScene = 7;

// A server that has a scene.
TestServer& AnyServer() {
  static TestServer* const server = [] {
    ServingSettings settings;
    settings.limits.calls_per_second = 1e9;
    auto* const started = new TestServer(
        NewDatabase({.references = true, .calibration = TestCalibration()}), settings);
    started->Publish(SceneWithBlock(3));
    return started;
  }();
  return *server;
}

// Up to the first answer.
void Call(const std::string& method, std::string_view request) {
  grpc::ClientContext context;
  grpc::CompletionQueue queue;
  grpc::GenericStub stub(AnyServer().channel);
  const auto call = stub.PrepareCall(&context, method, &queue);
  void* tag = nullptr;
  bool ok = false;
  call->StartCall(nullptr);
  queue.Next(&tag, &ok);
  const grpc::Slice slice(request.data(), request.size());
  call->WriteLast(grpc::ByteBuffer(&slice, 1), {}, nullptr);
  queue.Next(&tag, &ok);
  grpc::ByteBuffer answer;
  call->Read(&answer, nullptr);
  queue.Next(&tag, &ok);
  if (ok) context.TryCancel();
  grpc::Status status;
  call->Finish(&status, nullptr);
  queue.Next(&tag, &ok);
}

void ParseRequest(std::string_view bytes) {
  if (bytes.empty()) return;
  const size_t call = static_cast<uint8_t>(bytes[0]) % kCalls.size();
  Call(std::string("/silhouette.v1.") + kCalls[call], bytes.substr(1));
}

std::string Seed(size_t call, const google::protobuf::Message& request) {
  return static_cast<char>(call) + request.SerializeAsString();
}

std::vector<std::string> RequestSeeds() {
  v1::CheckConfigurationsRequest check;
  Set(At(1, 2), check.add_configurations());
  check.add_numbers(3);
  check.mutable_policy()->set_preset("uncalibrated");
  check.mutable_policy()->set_max_occluded_views(1);
  check.set_include_clearance(true);
  v1::CheckPathRequest path;
  Set(At(0, 0), path.add_waypoints());
  Set(At(3, 1), path.add_waypoints());
  v1::ExplainRequest explain;
  Set(At(3, 1), explain.mutable_configuration());
  v1::PublishSceneRequest scene = AnyServer().Stamped(RequestOf(SceneWithBlock(2)));
  v1::PublishSceneRequest pictures = scene;
  for (int view = 0; view < 3; ++view) {
    pictures.mutable_views(view)->set_camera_image(PngOf(CameraPicture(view, Block(view, 2))));
  }
  v1::AllowRegionRequest polygon = RegionAt("part", 1, absl::Seconds(5));
  v1::Polygon& corners = *polygon.mutable_views(0)->mutable_polygon();
  for (const auto& [x, y] : {std::pair(0, 0), {4, 0}, {4, 4}}) {
    v1::Point& corner = *corners.add_corners();
    corner.set_x(x);
    corner.set_y(y);
  }
  std::vector<std::string> seeds = {Seed(0, check),
                                    Seed(1, path),
                                    Seed(6, explain),
                                    Seed(kPublishScene, scene),
                                    Seed(kPublishScene, pictures),
                                    Seed(10, RegionAt("part", 3, absl::Seconds(5))),
                                    Seed(10, polygon)};
  for (size_t call = 0; call < kCalls.size(); ++call)
    seeds.emplace_back(1, static_cast<char>(call));
  return seeds;
}

// What a scene's camera image is read by, and a mask's.
void ParseImage(std::string_view bytes) {
  static const auto database = NewDatabase({.references = true});
  const Moment now = SystemClock();
  ViewInput view;
  view.view = kViewNames[0];
  view.captured = now;
  view.image = EncodedImage{std::string(bytes)};
  SceneInput input;
  input.views.push_back(view);
  input.without_joints = "they do not matter";
  MakeScene(*database, input, {}, {}, now).IgnoreError();
  DecodeMaskPng(bytes).IgnoreError();
}

std::string JpegOf(const cv::Mat& image) {
  std::vector<uint8_t> bytes;
  cv::imencode(".jpg", image, bytes);
  return {bytes.begin(), bytes.end()};
}

std::vector<std::string> ImageSeeds() {
  const cv::Mat grey = CameraPicture(0, Block(0, 3));
  cv::Mat colour;
  cv::merge(std::vector<cv::Mat>(3, grey), colour);
  return {PngOf(grey), PngOf(colour), JpegOf(grey), JpegOf(colour)};
}

void ParseDriverImage(std::string_view bytes) {
  v1::DriverImage message;
  if (!message.ParseFromString(std::string(bytes))) return;
  ImageOf(message, absl::Now()).IgnoreError();
}

std::vector<std::string> DriverImageSeeds() {
  std::vector<std::string> seeds;
  for (const std::string& image : ImageSeeds()) {
    v1::DriverImage message;
    message.set_encoded(image);
    seeds.push_back(message.SerializeAsString());
  }
  v1::DriverImage raw;
  raw.mutable_raw()->set_width(4);
  raw.mutable_raw()->set_height(2);
  raw.mutable_raw()->set_channels(3);
  raw.mutable_raw()->set_pixels(std::string(24, 'x'));
  seeds.push_back(raw.SerializeAsString());
  return seeds;
}

// The bytes as two pieces of a stream.
void ParseSimpleMessage(std::string_view bytes) {
  using namespace simple_message;
  for (const ByteOrder order : {ByteOrder::kLittle, ByteOrder::kBig}) {
    MessageReader reader(order);
    for (const std::string_view piece :
         {bytes.substr(0, bytes.size() / 2), bytes.substr(bytes.size() / 2)}) {
      reader.Append({reinterpret_cast<const uint8_t*>(piece.data()), piece.size()});
      for (auto next = reader.Next(); next.ok() && *next; next = reader.Next()) {
        const Message& message = **next;
        AsJointTrajPt(message);
        AsJointTrajPtFull(message);
        AsJointPosition(message);
        AsJointFeedback(message);
        AsRobotStatus(message);
      }
    }
  }
}

std::vector<std::string> SimpleMessageSeeds() {
  using namespace simple_message;
  std::vector<std::string> seeds;
  for (const ByteOrder order : {ByteOrder::kLittle, ByteOrder::kBig}) {
    std::string all;
    for (const Message& message : {ToMessage(JointTrajPt{}), ToMessage(JointTrajPtFull{}),
                                   ToMessage(simple_message::JointPosition{}),
                                   ToMessage(JointFeedback{}), ToMessage(RobotStatus{})}) {
      const std::vector<uint8_t> bytes = Encode(message, order);
      all.append(bytes.begin(), bytes.end());
    }
    seeds.push_back(all);
  }
  return seeds;
}

constexpr FuzzTarget kApiTargets[] = {
    {"request", ParseRequest, RequestSeeds},
    {"image", ParseImage, ImageSeeds},
    {"driver_image", ParseDriverImage, DriverImageSeeds},
    {"simple_message", ParseSimpleMessage, SimpleMessageSeeds},
};

}  // namespace

std::span<const FuzzTarget> ApiTargets() { return kApiTargets; }

}  // namespace silhouette
