// SPDX-License-Identifier: Apache-2.0
// silhouette-bench-load ADDRESS CLIENTS KIND: clients that ask a server all they can until they are
// killed or their parent ends, at the least priority, as if they were on other machines. Writes a
// byte to its output for every client, when it is first answered.
#include <grpcpp/create_channel.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <csignal>
#include <functional>
#include <map>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "silhouette/v1/collision_service.grpc.pb.h"
#include "silhouette/v1/database_service.grpc.pb.h"
#include "tools/program/program.h"

namespace silhouette::benchmarks {
namespace {

constexpr int kWaypoints = 10'000;

using Stub = v1::CollisionService::Stub;

// One call. `answered`: to be called when there was an answer.
using Ask = std::function<void(Stub& stub, grpc::ClientContext& context,
                               const std::function<void()>& answered)>;

using Configurations = google::protobuf::RepeatedPtrField<v1::Configuration>;

// Random ones within the grid.
void AddConfigurations(const v1::Grid& grid, int count, Configurations* configurations) {
  std::mt19937_64 random(7);
  for (int i = 0; i < count; ++i) {
    v1::Configuration& added = *configurations->Add();
    for (const v1::GridJoint& joint : grid.joints()) {
      added.add_positions(std::uniform_real_distribution(joint.lower(), joint.upper())(random));
    }
  }
}

v1::CheckPathRequest LongPath(const v1::Grid& grid) {
  v1::CheckPathRequest request;
  AddConfigurations(grid, kWaypoints, request.mutable_waypoints());
  return request;
}

Ask AskPaths(const v1::Grid& grid) {
  return
      [request = LongPath(grid)](Stub& stub, grpc::ClientContext& context, const auto& answered) {
        v1::CheckPathResponse response;
        if (stub.CheckPath(&context, request, &response).ok()) answered();
      };
}

Ask AskChecks(const v1::Grid& grid) {
  v1::CheckConfigurationsRequest request;
  AddConfigurations(grid, 64, request.mutable_configurations());
  return [request](Stub& stub, grpc::ClientContext& context, const auto& answered) {
    v1::CheckConfigurationsResponse response;
    if (stub.CheckConfigurations(&context, request, &response).ok()) answered();
  };
}

Ask AskWhy(const v1::Grid& grid) {
  v1::CheckConfigurationsRequest one;
  AddConfigurations(grid, 1, one.mutable_configurations());
  v1::ExplainRequest request;
  *request.mutable_configuration() = one.configurations(0);
  return [request](Stub& stub, grpc::ClientContext& context, const auto& answered) {
    v1::ExplainResponse response;
    if (stub.Explain(&context, request, &response).ok()) answered();
  };
}

Ask Watch(const v1::Grid& grid) {
  return
      [request = LongPath(grid)](Stub& stub, grpc::ClientContext& context, const auto& answered) {
        const auto watch = stub.WatchPath(&context, request);
        v1::WatchPathResponse response;
        while (watch->Read(&response)) answered();
      };
}

void AskOnAndOn(const std::string& address, const Ask& ask) {
  grpc::ChannelArguments own;  // a connection
  own.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  Stub stub(grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), own));
  bool first = true;
  const auto answered = [&first] {
    if (std::exchange(first, false) && write(STDOUT_FILENO, ".", 1) != 1) _exit(1);
  };
  while (true) {
    grpc::ClientContext context;
    ask(stub, context, answered);
  }
}

const std::map<std::string, Ask (*)(const v1::Grid&)> kKinds = {
    {"paths", AskPaths}, {"checks", AskChecks}, {"explain", AskWhy}, {"watches", Watch}};

absl::StatusOr<ExitCode> Run(const std::string& address, int count, const std::string& kind) {
  grpc::ClientContext context;
  v1::GetDatabaseResponse database;
  const grpc::Status status =
      v1::DatabaseService::NewStub(grpc::CreateChannel(address, grpc::InsecureChannelCredentials()))
          ->GetDatabase(&context, {}, &database);
  if (!status.ok()) {
    return absl::UnavailableError(
        absl::StrCat("the server at ", address, " does not answer: ", status.error_message()));
  }
  setpriority(PRIO_PROCESS, 0, 19);
  const Ask ask = kKinds.at(kind)(database.grid());
  std::vector<std::jthread> clients;
  for (int i = 0; i < count; ++i) clients.emplace_back(AskOnAndOn, address, ask);
  return kDone;
}

int RunLoad(int argc, char** argv) {
  CLI::App app("Asks a server all it can, for silhouette-bench, until it is killed.",
               "silhouette-bench-load");
  std::string address;
  int clients = 1;
  std::string kind;
  app.add_option("address", address, "Address of silhouette-server: host:port, unix:path")
      ->required();
  app.add_option("clients", clients, "How many ask")->required()->check(CLI::Range(1, 1000));
  app.add_option("kind", kind, "What they ask")->required()->check(CLI::IsMember(kKinds));
  app.footer("Example:\n  silhouette-bench-load 127.0.0.1:50051 24 checks");
  return RunProgram(app, argc, argv, [&] { return Run(address, clients, kind); });
}

}  // namespace
}  // namespace silhouette::benchmarks

int main(int argc, char** argv) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  return silhouette::benchmarks::RunLoad(argc, argv);
}
