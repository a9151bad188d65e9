// SPDX-License-Identifier: Apache-2.0
// Calls to a server in this process, over TCP and over a unix socket, and as their baseline a call
// that does nothing.
#include <benchmark/benchmark.h>
#include <google/protobuf/empty.pb.h>
#include <grpcpp/impl/codegen/client_unary_call.h>
#include <grpcpp/impl/codegen/rpc_method.h>

#include <chrono>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "silhouette/client.h"
#include "silhouette/v1/collision_service.grpc.pb.h"
#include "tests/benchmark/large_cells.h"
#include "tests/benchmark/running_server.h"
#include "tests/benchmark/synthetic_database.h"
#include "tests/benchmark/timing.h"
#include "tests/test_folder.h"

namespace silhouette::benchmarks {
namespace {

constexpr int kCalls = 2'000;

const SyntheticCell& ServedCell() {
  static const SyntheticCell cell({.steps = StepsOfSize3k()});
  return cell;
}

std::shared_ptr<const ServedDatabase> LoadServedCell() {
  const std::string path = TestFolder() / "served.lmdb";
  WriteDatabase(ServedCell(), path);
  BuildIndex(path);
  return LoadDatabase(path);
}

enum class Transport { kTcp, kUnix };

const RunningServer& ServerOver(Transport transport) {
  static const std::shared_ptr<const ServedDatabase> database = LoadServedCell();
  static std::map<Transport, RunningServer> servers;
  const std::string address =
      transport == Transport::kTcp ? "127.0.0.1:0" : "unix:" + TestFolder().string() + "/socket";
  return servers.try_emplace(transport, address, ServedCell(), database).first->second;
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

// CheckConfigurations with `count` configurations.
void AskBatch(benchmark::State& state, Transport transport, int count,
              const v1::CheckConfigurationsRequest& request) {
  const auto stub = v1::CollisionService::NewStub(ServerOver(transport).channel());
  v1::CheckConfigurationsResponse response;
  for (auto _ : state) {
    grpc::ClientContext context;
    if (!stub->CheckConfigurations(&context, request, &response).ok() ||
        response.unknown_reason() != v1::Verdict::REASON_UNSPECIFIED ||
        (response.free().empty() && response.verdicts().empty())) {
      state.SkipWithError("a check failed");
      break;
    }
  }
  ReportBatch(state, count);
}

// Many by their numbers, answered from the map.
void PackedBatch(benchmark::State& state, Transport transport) {
  constexpr int kConfigurations = 1'000'000;
  v1::CheckConfigurationsRequest request;
  for (const ConfigurationNumber number : RandomNumbers(ServedCell().grid(), kConfigurations)) {
    request.add_numbers(static_cast<uint32_t>(number));
  }
  AskBatch(state, transport, kConfigurations, request);
}

// Many by their joint values.
void GrpcBatch(benchmark::State& state, Transport transport) {
  constexpr int kConfigurations = 10'000;
  AskBatch(state, transport, kConfigurations, RequestOf(kConfigurations));
}

// StreamChecks with one configuration a question, as the client library has it: 64 under way.
void Stream(benchmark::State& state, Transport transport) {
  constexpr uint64_t kQuestions = 10'000;
  constexpr uint64_t kUnderWay = 64;
  const Client client = Client::Connect(ServerOver(transport).address()).value();
  std::vector<Configuration> configurations;
  for (const ConfigurationNumber number : RandomNumbers(ServedCell().grid(), kQuestions)) {
    configurations.push_back(ServedCell().grid().At(number));
  }
  client::CheckStream stream = client.StreamChecks();
  bool decided = true;
  double seconds = 0;
  for (auto _ : state) {
    const auto begin = std::chrono::steady_clock::now();
    uint64_t sent = 0;
    for (uint64_t received = 0; received < kQuestions && decided; ++received) {
      for (; sent < kQuestions && sent < received + kUnderWay; ++sent) {
        decided = stream.Send(sent, {configurations[sent]}).ok() && decided;
      }
      const auto answer = stream.Receive();
      decided = decided && answer.ok() && answer->checks.ok() &&
                answer->checks->verdicts[0].state != client::State::kUnknown;
    }
    seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }
  if (!decided) state.SkipWithError("a check failed");
  state.counters["per_question_ns"] =
      seconds * 1e9 / static_cast<double>(kQuestions) / static_cast<double>(state.iterations());
}

const bool kGrpcRegistered = [] {
  for (const auto& [transport, name] :
       {std::pair(Transport::kTcp, "/tcp"), std::pair(Transport::kUnix, "/unix")}) {
    const auto add = [&, over = transport, suffix = std::string(name)](
                         const std::string& what, void (*measure)(benchmark::State&, Transport)) {
      return benchmark::RegisterBenchmark((what + suffix).c_str(), measure, over)
          ->Unit(benchmark::kMillisecond);
    };
    add("grpc_empty_call", EmptyCall)->UseManualTime();
    add("grpc_unary", Unary)->UseManualTime();
    add("grpc_stream", Stream)->UseRealTime();
    add("grpc_batch", PackedBatch)->UseRealTime();
    add("grpc_batch_joint_values", GrpcBatch)->UseRealTime();
  }
  return true;
}();

}  // namespace
}  // namespace silhouette::benchmarks
