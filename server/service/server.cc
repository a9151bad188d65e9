// SPDX-License-Identifier: Apache-2.0
#include "server/service/server.h"

#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/server_builder.h>
#include <netdb.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "server/gate/credentials.h"
#include "silhouette/v1/collision_service.grpc.pb.h"
#include "silhouette/v1/database_service.grpc.pb.h"
#include "silhouette/v1/scene_service.grpc.pb.h"

namespace silhouette {

namespace {

class Socket {
 public:
  explicit Socket(int family) : descriptor_(socket(family, SOCK_STREAM | SOCK_CLOEXEC, 0)) {}
  ~Socket() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  int descriptor() const { return descriptor_; }

 private:
  int descriptor_;
};

absl::Status CannotListen(const std::string& address, const std::string& why) {
  return absl::FailedPreconditionError(absl::StrCat("cannot listen on ", address, ": ", why));
}

absl::Status CheckUnixPath(const std::string& address, const std::string& path) {
  sockaddr_un name{};
  name.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof(name.sun_path)) {
    return absl::InvalidArgumentError(absl::StrCat("listen address '", address,
                                                   "': the path of a socket has 1 to ",
                                                   sizeof(name.sun_path) - 1, " characters"));
  }
  std::copy(path.begin(), path.end(), name.sun_path);
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) {
    const std::string::size_type slash = path.rfind('/');
    const std::string folder = slash == std::string::npos ? "." : path.substr(0, slash + 1);
    if (access(folder.c_str(), W_OK) == 0) return absl::OkStatus();
    return CannotListen(address, absl::StrCat("the folder '", folder, "': ", strerror(errno)));
  }
  if (!S_ISSOCK(status.st_mode)) {
    return CannotListen(address, "there is a file of this name that is no socket");
  }
  const Socket probe(AF_UNIX);
  if (connect(probe.descriptor(), reinterpret_cast<const sockaddr*>(&name), sizeof(name)) == 0) {
    return CannotListen(address, "another server listens there; stop it or choose another path");
  }
  return absl::OkStatus();  // left behind by a server that is gone
}

// errno of listening on one of a host's addresses; 0 if it works.
int ProblemOf(const addrinfo& info) {
  const Socket probe(info.ai_family);
  if (probe.descriptor() < 0) return errno;
  const int yes = 1;
  setsockopt(probe.descriptor(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  return bind(probe.descriptor(), info.ai_addr, info.ai_addrlen) == 0 ? 0 : errno;
}

absl::Status CheckHostAndPort(const std::string& address, std::string host,
                              const std::string& port) {
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  addrinfo* found = nullptr;
  if (const int error = getaddrinfo(host.c_str(), port.c_str(), &hints, &found); error != 0) {
    return CannotListen(address, absl::StrCat("host '", host, "': ", gai_strerror(error)));
  }
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> infos(found, freeaddrinfo);
  int problem = 0;
  bool works = false;
  for (const addrinfo* info = found; info != nullptr; info = info->ai_next) {
    const int error = ProblemOf(*info);
    works = works || error == 0;
    if (problem != EADDRINUSE && error != 0) problem = error;
  }
  if (problem == EADDRINUSE) {
    return CannotListen(address, absl::StrCat("port ", port,
                                              " is in use; stop the program that uses it, or "
                                              "choose another port (0: any free one)"));
  }
  return works ? absl::OkStatus() : CannotListen(address, strerror(problem));
}

}  // namespace

absl::Status CheckListenAddress(const std::string& address) {
  if (address.starts_with("unix:")) return CheckUnixPath(address, address.substr(5));
  const std::string::size_type colon = address.rfind(':');
  int port = 0;
  if (colon == std::string::npos || colon == 0 ||
      !absl::SimpleAtoi(address.substr(colon + 1), &port) || port < 0 || port > 65535) {
    return absl::InvalidArgumentError(absl::StrCat("listen address '", address,
                                                   "' is not like 127.0.0.1:50051, [::1]:50051 or "
                                                   "unix:/run/silhouette.sock"));
  }
  return CheckHostAndPort(address, address.substr(0, colon), address.substr(colon + 1));
}

namespace {

// Reports to the health service, as far as it has changed: whether the database is undamaged,
// whether the calibration is known to hold, if that is checked from the start, and the state of the
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
    if (serving_.settings.trust != nullptr) {
      const Moment now = serving_.settings.clock();
      Report("silhouette.v1.Calibration",
             CalibrationReason(serving_.scenes.Newest(now), now) == Reason::kNone);
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
  void Report(const std::string& service, bool serving) {
    const auto [reported, is_new] = reported_.emplace(service, serving);
    if (!is_new && std::exchange(reported->second, serving) == serving) return;
    health_.SetServingStatus(service, serving);
  }

  Serving& serving_;
  grpc::HealthCheckServiceInterface& health_;
  std::mutex mutex_;
  std::map<std::string, bool> reported_;
};

}  // namespace

namespace {

// Until GuardSocket has set its group and mode, a socket is this user's alone.
std::unique_ptr<grpc::Server> StartGuarded(grpc::ServerBuilder& builder, const GateSettings& gate) {
  if (!gate.socket_mode && gate.socket_group.empty()) return builder.BuildAndStart();
  const mode_t before = umask(0177);
  std::unique_ptr<grpc::Server> started = builder.BuildAndStart();
  umask(before);
  return started;
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
  RETURN_IF_ERROR(CheckListenAddress(address));
  grpc::EnableDefaultHealthCheckService(true);
  grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  auto server = std::unique_ptr<Server>(new Server(std::move(database), std::move(settings)));
  if (!server->serving_.settings.metrics.empty()) {
    ASSIGN_OR_RETURN(auto metrics,
                     Metrics::Start(server->serving_.settings.metrics, server->serving_));
    server->metrics_ = std::move(metrics);
  }
  Serving& serving = server->serving_;
  const GateSettings& gate = serving.settings.gate;
  ASSIGN_OR_RETURN(
      const auto credentials,
      CredentialsFor(gate, [&serving](const std::string& who, const std::string& call) {
        serving.AuditFirst(who, "call.denied", call);
      }));
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort(address, credentials, &port);
  // Two servers on one port would take turns.
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  // Clients may ask for signs of life as often as they like, on streams that say nothing too.
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PING_STRIKES, 0);
  // The streams of a client that vanished without a word end within 20 seconds.
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, 10'000);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10'000);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  builder.SetMaxReceiveMessageSize(kMaxRequestBytes);
  builder.SetMaxSendMessageSize(kMaxRequestBytes);
  for (const auto& service : server->services_) builder.RegisterService(service.get());
  server->server_ = StartGuarded(builder, gate);
  if (server->server_ == nullptr || port == 0) {
    return absl::FailedPreconditionError(
        absl::StrCat("cannot listen on ", address, "; choose another address"));
  }
  RETURN_IF_ERROR(GuardSocket(address, gate));
  const bool unix_socket = address.starts_with("unix:");
  server->address_ =
      unix_socket ? address : absl::StrCat(address.substr(0, address.rfind(':') + 1), port);
  grpc::HealthCheckServiceInterface* health = server->server_->GetHealthCheckService();
  for (const char* name :
       {v1::CollisionService::service_full_name(), v1::SceneService::service_full_name(),
        v1::DatabaseService::service_full_name()}) {
    health->SetServingStatus(name, true);
  }
  serving.Audit("server", "server.start",
                absl::StrCat("listens on ", server->address_, ", database generation ",
                             serving.scenes.database()->generation()));
  server->health_ = std::make_shared<HealthReport>(server->serving_, *health);
  server->serving_.watches.Add(server->health_);
  return server;
}

const std::string& Server::metrics_address() const {
  static const std::string none;
  return metrics_ == nullptr ? none : metrics_->address();
}

Server::~Server() {
  if (server_ != nullptr) Stop(absl::ZeroDuration());
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
