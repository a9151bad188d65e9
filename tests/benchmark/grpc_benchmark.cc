// Calls to a server in this process, over TCP and over a unix socket, and as their baseline a call
// that does nothing.
#include <benchmark/benchmark.h>
#include <google/protobuf/empty.pb.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/impl/codegen/client_unary_call.h>
#include <grpcpp/impl/codegen/rpc_method.h>

#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "server/service/server.h"
#include "silhouette/v1/collision_service.grpc.pb.h"
#include "silhouette/v1/scene_service.grpc.pb.h"
#include "tests/benchmark/large_cells.h"
#include "tests/benchmark/synthetic_database.h"
#include "tests/benchmark/timing.h"

namespace silhouette::benchmarks {
namespace {

constexpr int kCalls = 2'000;

void Require(bool ok, const std::string& what) {
  if (!ok) throw std::runtime_error(what);
}

const SyntheticCell& ServedCell() {
  static const SyntheticCell cell({.steps = StepsOfSize3k()});
  return cell;
}

std::shared_ptr<const ServedDatabase> LoadServedCell() {
  const std::string path = TemporaryFolder() + "/served.lmdb";
  WriteDatabase(ServedCell(), path);
  BuildIndex(path);
  return LoadDatabase(path);
}

// A server with a scene that does not grow old, and a channel to it.
class RunningServer {
 public:
  explicit RunningServer(const std::string& address) {
    static const std::shared_ptr<const ServedDatabase> database = LoadServedCell();
    ServingSettings settings;
    settings.scene.max_age = absl::Hours(24);
    auto started = Server::Start(address, database, settings);
    Require(started.ok(), std::string(started.status().message()));
    server_ = *std::move(started);
    channel_ = grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials());
    Publish(MakeScene(ServedCell(), SceneKind::kPerson, 1));
  }

  const std::shared_ptr<grpc::Channel>& channel() const { return channel_; }

 private:
  void Publish(const BenchmarkScene& scene) {
    v1::PublishSceneRequest request;
    for (size_t joint = 0; joint < scene.robot.size(); ++joint) {
      v1::JointPosition& added = *request.add_joints();
      added.set_name(ServedCell().grid().joints()[joint].name);
      added.set_position(scene.robot[joint]);
    }
    for (int view = 0; view < kViews; ++view) {
      v1::ViewImage& added = *request.add_views();
      added.set_view("view_" + std::to_string(view + 1));
      const ObstacleImage& image = *scene.images[static_cast<size_t>(view)];
      const Mask foreground = image.obstacle() | image.unknown();
      added.mutable_scene_mask()->set_width(foreground.width());
      added.mutable_scene_mask()->set_height(foreground.height());
      added.mutable_scene_mask()->set_bits(foreground.ToBytes());
    }
    grpc::ClientContext context;
    v1::PublishSceneResponse response;
    const grpc::Status status =
        v1::SceneService::NewStub(channel_)->PublishScene(&context, request, &response);
    Require(status.ok(), status.error_message());
  }

  std::unique_ptr<Server> server_;
  std::shared_ptr<grpc::Channel> channel_;
};

enum class Transport { kTcp, kUnix };

const RunningServer& ServerOver(Transport transport) {
  static std::map<Transport, RunningServer> servers;
  const std::string address =
      transport == Transport::kTcp ? "127.0.0.1:0" : "unix:" + TemporaryFolder() + "/socket";
  return servers.try_emplace(transport, address).first->second;
}

// `count` random configurations of the grid.
v1::CheckConfigurationsRequest RequestOf(int count) {
  v1::CheckConfigurationsRequest request;
  request.set_omit_evidence(true);
  for (const ConfigurationNumber number : RandomNumbers(ServedCell().grid(), count)) {
    v1::Configuration& added = *request.add_configurations();
    for (const double position : ServedCell().grid().At(number)) added.add_positions(position);
  }
  return request;
}

// A health check: an empty message there, two bytes back.
void EmptyCall(benchmark::State& state, Transport transport) {
  const std::shared_ptr<grpc::Channel>& channel = ServerOver(transport).channel();
  const grpc::internal::RpcMethod method("/grpc.health.v1.Health/Check",
                                         grpc::internal::RpcMethod::NORMAL_RPC, channel);
  const google::protobuf::Empty nothing;
  google::protobuf::Empty response;
  bool ok = true;
  MeasureCalls(state, kCalls, [&](int) {
    grpc::ClientContext context;
    ok = ok && grpc::internal::BlockingUnaryCall<google::protobuf::MessageLite,
                                                 google::protobuf::MessageLite>(
                   channel.get(), method, &context, nothing, &response)
                   .ok();
  });
  if (!ok) state.SkipWithError("the call failed");
}

// CheckConfigurations with one configuration.
void Unary(benchmark::State& state, Transport transport) {
  const auto stub = v1::CollisionService::NewStub(ServerOver(transport).channel());
  const v1::CheckConfigurationsRequest request = RequestOf(1);
  v1::CheckConfigurationsResponse response;
  bool decided = true;
  MeasureCalls(state, kCalls, [&](int) {
    grpc::ClientContext context;
    decided = stub->CheckConfigurations(&context, request, &response).ok() &&
              response.verdicts(0).state() != v1::Verdict::STATE_UNKNOWN && decided;
  });
  if (!decided) state.SkipWithError("a check failed");
}

// CheckConfigurations with many by their numbers, answered from the map.
void PackedBatch(benchmark::State& state, Transport transport) {
  constexpr int kConfigurations = 1'000'000;
  const auto stub = v1::CollisionService::NewStub(ServerOver(transport).channel());
  v1::CheckConfigurationsRequest request;
  for (const ConfigurationNumber number : RandomNumbers(ServedCell().grid(), kConfigurations)) {
    request.add_numbers(static_cast<uint32_t>(number));
  }
  v1::CheckConfigurationsResponse response;
  for (auto _ : state) {
    grpc::ClientContext context;
    if (!stub->CheckConfigurations(&context, request, &response).ok() ||
        response.unknown_reason() != v1::Verdict::REASON_UNSPECIFIED || response.free().empty()) {
      state.SkipWithError("a check failed");
      break;
    }
  }
  state.counters["per_second"] =
      benchmark::Counter(kConfigurations, benchmark::Counter::kIsIterationInvariantRate);
}

// CheckConfigurations with many, by their joint values.
void Batch(benchmark::State& state, Transport transport) {
  constexpr int kConfigurations = 10'000;
  const auto stub = v1::CollisionService::NewStub(ServerOver(transport).channel());
  const v1::CheckConfigurationsRequest request = RequestOf(kConfigurations);
  v1::CheckConfigurationsResponse response;
  for (auto _ : state) {
    grpc::ClientContext context;
    if (!stub->CheckConfigurations(&context, request, &response).ok()) {
      state.SkipWithError("a check failed");
      break;
    }
  }
  state.counters["per_second"] =
      benchmark::Counter(kConfigurations, benchmark::Counter::kIsIterationInvariantRate);
}

const bool kRegistered = [] {
  for (const auto& [transport, name] :
       {std::pair(Transport::kTcp, "/tcp"), std::pair(Transport::kUnix, "/unix")}) {
    const auto add = [&, over = transport, suffix = std::string(name)](
                         const std::string& what, void (*measure)(benchmark::State&, Transport)) {
      return benchmark::RegisterBenchmark((what + suffix).c_str(), measure, over)
          ->Unit(benchmark::kMillisecond);
    };
    add("grpc_empty_call", EmptyCall)->UseManualTime();
    add("grpc_unary", Unary)->UseManualTime();
    add("grpc_batch", PackedBatch)->UseRealTime();
    add("grpc_batch_joint_values", Batch)->UseRealTime();
  }
  return true;
}();

}  // namespace
}  // namespace silhouette::benchmarks
