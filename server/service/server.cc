// SPDX-License-Identifier: Apache-2.0
#include "server/service/server.h"

#include <google/protobuf/stubs/logging.h>
#include <grpc/grpc.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/resource_quota.h>
#include <grpcpp/server_builder.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <algorithm>
#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "grpc/health/v1/health.pb.h"
#include "server/gate/caller.h"
#include "server/gate/credentials.h"
#include "server/service/calls.h"
#include "silhouette/v1/collision_service.grpc.pb.h"
#include "silhouette/v1/database_service.grpc.pb.h"
#include "silhouette/v1/scene_service.grpc.pb.h"

namespace silhouette {

namespace {

constexpr char kHandshakeTimeout[] = "grpc.server_handshake_timeout_ms";
constexpr int kMostSentBytes = 64 << 20;

// Reports to the health service, as far as it has changed: whether the database is undamaged,
// whether the calibration is known to hold, if that is checked or doubted, and the state of the
// server's own acquisition, if there is one.
class HealthReport : public Watcher {
 public:
  // Reports at once. Both must outlive the watching.
  HealthReport(Serving& serving, grpc::HealthCheckServiceInterface& health)
      : serving_(serving), health_(health) {
    Tell(0);
  }

  void Tell(uint64_t) override {
    const std::lock_guard lock(mutex_);
    Report("silhouette.v1.Database", !serving_.scenes.database()->damage().found());
    constexpr char kCalibration[] = "silhouette.v1.Calibration";
    if (serving_.settings.trust != nullptr || reported_.contains(kCalibration) ||
        !serving_.scenes.database()->calibration_doubt().empty()) {
      const Moment now = serving_.settings.clock();
      const Served served = serving_.scenes.Newest(now);
      const std::optional<std::string> doubt = CalibrationDoubt(served, now);
      LogDoubt(served.trust, doubt);
      Report(kCalibration, !doubt);
    }
    if (serving_.settings.live == nullptr) return;
    const LiveStatus status = serving_.settings.live->StatusOfDevices();
    Report("silhouette.v1.Acquisition", status.serving);
    for (const DeviceStatus& camera : status.cameras) {
      Report(absl::StrCat("silhouette.v1.Camera/", camera.name), camera.serving);
    }
  }
  void End() override {}

 private:
  // A check that held when it was read (CalibrationWatch logs that) may be too old by now, or not
  // of the database that is served: one line when that begins.
  void LogDoubt(const std::shared_ptr<const CalibrationTrust>& trust,
                const std::optional<std::string>& doubt) {
    const bool is_doubted = trust != nullptr && trust->holds && doubt;
    const std::string doubted = is_doubted ? trust->message + trust->fingerprint : "";
    if (std::exchange(doubted_, doubted) == doubted || !is_doubted) return;
    spdlog::warn("presets that rest on the calibration are unknown: {}", *doubt);
  }

  void Report(const std::string& service, bool serving) {
    const auto [reported, is_new] = reported_.emplace(service, serving);
    if (!is_new && std::exchange(reported->second, serving) == serving) return;
    health_.SetServingStatus(service, serving);
  }

  Serving& serving_;
  grpc::HealthCheckServiceInterface& health_;
  std::mutex mutex_;
  std::map<std::string, bool> reported_;
  std::string doubted_;  // which check
};

// Time-outs and bounds of connections, and of what they may send.
void SetLimits(const ServingSettings& settings, grpc::ServerBuilder& builder) {
  // Clients may ask for signs of life as often as they like, on streams that say nothing too.
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PING_STRIKES, 0);
  // The streams of a client that vanished without a word end within 20 seconds.
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, 10'000);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10'000);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  // A connection on which no HTTP/2 begins.
  builder.AddChannelArgument(kHandshakeTimeout, 5'000);
  // A connection without calls. A client that uses it again connects again by itself.
  builder.AddChannelArgument(GRPC_ARG_MAX_CONNECTION_IDLE_MS, 600'000);
  // Further calls of a connection wait at the client.
  builder.AddChannelArgument(
      GRPC_ARG_MAX_CONCURRENT_STREAMS,
      settings.limits.streams_per_client + settings.limits.waiting_per_client);
  // One limit for all calls: the greatest request that is taken. ReadRequest knows that of each.
  builder.SetMaxReceiveMessageSize(
      static_cast<int>(settings.live == nullptr ? kMostBytes<v1::PublishSceneRequest>
                                                : kMostBytes<v1::CheckConfigurationsRequest>));
  builder.SetMaxSendMessageSize(kMostSentBytes);
  builder.SetResourceQuota(grpc::ResourceQuota("requests").Resize(settings.limits.request_memory));
}

// Until GuardSocket has set its group and mode, a socket is this user's alone.
absl::StatusOr<std::unique_ptr<Listener>> OpenGuarded(const std::string& address,
                                                      const GateSettings& gate, Clients& clients) {
  if (!gate.socket_mode && gate.socket_group.empty()) return Listener::Open(address, clients);
  const mode_t before = umask(0177);
  absl::StatusOr<std::unique_ptr<Listener>> listener = Listener::Open(address, clients);
  umask(before);
  RETURN_IF_ERROR(listener.status());
  RETURN_IF_ERROR(GuardSocket(address, gate));
  return listener;
}

// What takes connections, by the user at their other end; nothing: all others.
using Acceptors =
    std::map<std::optional<uid_t>, std::shared_ptr<grpc::experimental::ExternalConnectionAcceptor>>;

// gRPC does not say who is at the other end of a Unix socket: each user that has a role gets an
// acceptor that knows.
absl::StatusOr<Acceptors> AddAcceptors(const std::string& address, const GateSettings& gate,
                                       const Denied& denied, grpc::ServerBuilder& builder) {
  Acceptors acceptors;
  const auto add = [&](std::optional<uid_t> number, const std::vector<std::string>& user) {
    const auto credentials = CredentialsFor(gate, user, denied);
    if (!credentials.ok()) return credentials.status();
    acceptors[number] = builder.experimental().AddExternalConnectionAcceptor(
        grpc::ServerBuilder::experimental_type::ExternalConnectionType::FROM_FD, *credentials);
    return absl::OkStatus();
  };
  RETURN_IF_ERROR(add(std::nullopt, {}));
  if (!address.starts_with("unix:")) return acceptors;
  std::map<uid_t, std::vector<std::string>> users;  // a number may have several names
  for (const std::string& name : gate.roles.names()) {
    ASSIGN_OR_RETURN(const uid_t number, UserNamed(name));
    users[number].push_back(name);
  }
  for (const auto& [number, names] : users) RETURN_IF_ERROR(add(number, names));
  return acceptors;
}

// Hands each connection to the acceptor of its user, and records users without a role. `serving`
// must outlive it.
Listener::Take HandTo(Acceptors acceptors, const Serving& serving) {
  const GateSettings& gate = serving.settings.gate;
  const bool of_users = !gate.tls && !gate.roles.empty();
  return [&serving, of_users, acceptors = std::move(acceptors)](int listener, int connection) {
    const std::optional<uid_t> user = UserAt(connection);
    auto acceptor = acceptors.find(user);
    if (acceptor == acceptors.end()) {
      if (of_users) {
        serving.AuditFirst(absl::StrCat("uid ", *user), "connection.denied", "without a role");
      }
      acceptor = acceptors.find(std::nullopt);
    }
    grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters parameters;
    parameters.listener_fd = listener;
    parameters.fd = connection;
    acceptor->second->HandleNewConnection(&parameters);
  };
}

// What gRPC and Protobuf know of the whole process.
void SetUpGrpc() {
  // Once more than it is shut down: shutting down gRPC itself may wait ten seconds for a thread
  // that wrote much to a connection. The end of the process ends that.
  grpc_init();
  // What it says of requests that cannot be parsed goes to their callers.
  google::protobuf::SetLogHandler(nullptr);
  grpc::EnableDefaultHealthCheckService(true);
  grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  // Else the linker leaves out what reflection describes the health service by.
  google::protobuf::LinkMessageReflection<grpc::health::v1::HealthCheckRequest>();
}

}  // namespace

Server::Server(std::shared_ptr<const ServedDatabase> database, ServingSettings settings)
    : serving_(std::move(database), std::move(settings)),
      services_{NewCollisionService(serving_), NewSceneService(serving_),
                NewDatabaseService(serving_)} {}

absl::StatusOr<std::unique_ptr<Server>> Server::Start(
    const std::string& address, std::shared_ptr<const ServedDatabase> database,
    ServingSettings settings) {
  RETURN_IF_ERROR(CheckGate(address, settings.gate));
  SetUpGrpc();
  auto server = std::unique_ptr<Server>(new Server(std::move(database), std::move(settings)));
  Serving& serving = server->serving_;
  const GateSettings& gate = serving.settings.gate;
  ASSIGN_OR_RETURN(server->listener_, OpenGuarded(address, gate, serving.clients));
  server->address_ = server->listener_->address();
  if (!serving.settings.metrics.empty()) {
    ASSIGN_OR_RETURN(server->metrics_, Metrics::Start(serving.settings.metrics, serving));
  }
  const Denied denied = [&serving](const std::string& who, const std::string& call) {
    serving.AuditFirst(who, "call.denied", call);
  };
  grpc::ServerBuilder builder;
  ASSIGN_OR_RETURN(Acceptors acceptors, AddAcceptors(address, gate, denied, builder));
  SetLimits(serving.settings, builder);
  for (const auto& service : server->services_) builder.RegisterService(service.get());
  server->server_ = builder.BuildAndStart();
  if (server->server_ == nullptr) {
    return absl::InternalError("gRPC does not start; its log says more (GRPC_VERBOSITY=ERROR)");
  }
  server->listener_->Start(HandTo(std::move(acceptors), serving));
  grpc::HealthCheckServiceInterface* health = server->server_->GetHealthCheckService();
  for (const char* name :
       {v1::CollisionService::service_full_name(), v1::SceneService::service_full_name(),
        v1::DatabaseService::service_full_name()}) {
    health->SetServingStatus(name, true);
  }
  serving.Audit("server", "server.start",
                absl::StrCat("listens on ", server->address_, ", database generation ",
                             serving.scenes.database()->generation()));
  server->health_ = std::make_shared<HealthReport>(serving, *health);
  serving.watches.Add(server->health_);
  return server;
}

const std::string& Server::metrics_address() const {
  static const std::string none;
  return metrics_ == nullptr ? none : metrics_->address();
}

Server::~Server() {
  if (server_ != nullptr) Stop(absl::ZeroDuration());
  serving_.FinishTasks();
}

void Server::ReplaceDatabase(std::shared_ptr<const ServedDatabase> database) {
  if (serving_.settings.live != nullptr) serving_.settings.live->NoteVariants(database->variants());
  const uint64_t former = serving_.scenes.database()->generation();
  serving_.Audit("server", "database.reload",
                 absl::StrCat("generation ", former, " replaced by ", database->generation()));
  serving_.scenes.ReplaceDatabase(std::move(database));
}

void Server::SetTrust(std::shared_ptr<const CalibrationTrust> trust) {
  const auto former = serving_.scenes.trust();
  if (trust != nullptr && (former == nullptr || former->holds != trust->holds ||
                           former->fingerprint != trust->fingerprint)) {
    serving_.Audit("server", "calibration.check", trust->message);
  }
  serving_.scenes.SetTrust(std::move(trust));
}

void Server::Stop(absl::Duration grace) {
  listener_.reset();
  serving_.watches.Close();
  server_->GetHealthCheckService()->SetServingStatus(false);
  // No moment of the clock is further away than that.
  const absl::Duration bounded = std::min(grace, absl::Hours(24));
  server_->Shutdown(std::chrono::system_clock::now() + absl::ToChronoNanoseconds(bounded));
  server_->Wait();
  server_.reset();
  serving_.Audit("server", "server.stop", "");
}

}  // namespace silhouette
