#include "silhouette/client.h"

#include <grpcpp/grpcpp.h>

#include <bit>
#include <chrono>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "clients/cpp/messages.h"
#include "silhouette/v1/collision_service.grpc.pb.h"
#include "silhouette/v1/database_service.grpc.pb.h"
#include "silhouette/v1/scene_service.grpc.pb.h"

namespace silhouette::client {
namespace {

using Clock = std::chrono::steady_clock;

absl::Status RequireAddress(const std::string& address) {
  constexpr std::string_view kUnix = "unix:";
  if (address.starts_with(kUnix)) {
    if (address.size() > kUnix.size()) return absl::OkStatus();
  } else {
    const size_t colon = address.rfind(':');
    int port = 0;
    if (colon != std::string::npos && colon > 0 &&
        absl::SimpleAtoi(address.substr(colon + 1), &port) && port > 0 && port < 65536) {
      return absl::OkStatus();
    }
  }
  return absl::InvalidArgumentError(
      absl::StrCat("'", address, "' is no address of a server; write host:port, as ",
                   kDefaultAddress, ", or unix:path"));
}

std::shared_ptr<grpc::Channel> ChannelTo(const std::string& address) {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(-1);
  // What gRPC calls the least backoff is how long one attempt to connect may take, handshake
  // included: a busy machine needs more than an instant.
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 5000);
  // A server that was started again is found again within a second.
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 1000);
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  return grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
}

// Most of gRPC's status codes are absl's, with the same numbers.
absl::Status SentenceFor(const grpc::Status& status, const std::string& address,
                         absl::Duration timeout) {
  switch (status.error_code()) {
    case grpc::StatusCode::OK:
      return absl::OkStatus();
    case grpc::StatusCode::UNAVAILABLE:
      return absl::UnavailableError(absl::StrCat("no server answers at ", address,
                                                 "; start silhouette-server or give --server"));
    case grpc::StatusCode::DEADLINE_EXCEEDED:
      return absl::DeadlineExceededError(
          absl::StrCat("the server at ", address, " did not answer within ",
                       absl::FormatDuration(timeout), "; ask for less at once or allow more time"));
    case grpc::StatusCode::UNIMPLEMENTED:
      return absl::UnimplementedError(
          absl::StrCat("the server at ", address, " does not know this call (",
                       status.error_message(), "); use a silhouette-server of this version"));
    default:
      return absl::Status(static_cast<absl::StatusCode>(status.error_code()),
                          absl::StrCat("the server at ", address, ": ", status.error_message()));
  }
}

absl::Status Malformed(const std::string& address, absl::string_view what) {
  return absl::InternalError(absl::StrCat("the answer of the server at ", address,
                                          " cannot be used: ", what,
                                          "; use a silhouette-server of this version"));
}

// A verdict whose clearance was asked for has one, unless it is unknown.
absl::Status RequireClearance(const Verdict& verdict, const std::string& address) {
  if (verdict.state == State::kUnknown) return absl::OkStatus();
  if (!verdict.clearance) {
    return absl::UnimplementedError(
        absl::StrCat("the server at ", address,
                     " tells no clearances; use a silhouette-server of this version"));
  }
  if (!(*verdict.clearance >= 0)) return Malformed(address, "a clearance is not 0 or more");
  return absl::OkStatus();
}

// `bits` bits as words; nothing if the bytes are not just as many as they take. The bits beyond are
// taken away.
std::optional<std::vector<uint64_t>> WordsFrom(const std::string& bytes, size_t bits) {
  static_assert(std::endian::native == std::endian::little);
  if (bytes.size() != (bits + 7) / 8) return std::nullopt;
  std::vector<uint64_t> words((bits + 63) / 64, 0);
  std::memcpy(words.data(), bytes.data(), bytes.size());
  if (bits % 64 != 0) words.back() &= (uint64_t{1} << (bits % 64)) - 1;
  return words;
}

}  // namespace

// A channel and its stubs; thread-safe as they are.
class Client::Connection {
 public:
  explicit Connection(const std::string& address)
      : address_(address),
        channel_(ChannelTo(address)),
        collisions_(v1::CollisionService::NewStub(channel_)),
        scenes_(v1::SceneService::NewStub(channel_)),
        databases_(v1::DatabaseService::NewStub(channel_)) {}

  const std::string& address() const { return address_; }
  v1::CollisionService::Stub& collisions() const { return *collisions_; }
  v1::SceneService::Stub& scenes() const { return *scenes_; }
  v1::DatabaseService::Stub& databases() const { return *databases_; }

  // One unary call.
  template <typename Stub, typename Request, typename Response>
  absl::Status Call(Stub& stub,
                    grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                    const Request& request, absl::Duration timeout, Response& response) const {
    grpc::ClientContext context;
    context.set_deadline(absl::ToChronoTime(absl::Now() + timeout));
    return SentenceFor((stub.*method)(&context, request, &response), address_, timeout);
  }

 private:
  const std::string address_;
  const std::shared_ptr<grpc::Channel> channel_;
  const std::unique_ptr<v1::CollisionService::Stub> collisions_;
  const std::unique_ptr<v1::SceneService::Stub> scenes_;
  const std::unique_ptr<v1::DatabaseService::Stub> databases_;
};

Client::Client(std::shared_ptr<const Connection> connection, absl::Duration timeout)
    : connection_(std::move(connection)), timeout_(timeout) {}

absl::StatusOr<Client> Client::Connect(const std::string& address, absl::Duration timeout) {
  if (absl::Status status = RequireAddress(address); !status.ok()) return status;
  if (timeout <= absl::ZeroDuration()) {
    return absl::InvalidArgumentError("the time for a call must be positive");
  }
  return Client(std::make_shared<const Connection>(address), timeout);
}

Client Client::WithTimeout(absl::Duration timeout) const { return Client(connection_, timeout); }

const std::string& Client::address() const { return connection_->address(); }

absl::StatusOr<ConfigurationChecks> Client::CheckConfigurations(
    std::span<const Configuration> configurations, const Policy& policy, Evidence evidence,
    Clearance clearance) const {
  v1::CheckConfigurationsRequest request;
  for (const Configuration& q : configurations) *request.add_configurations() = ToMessage(q);
  *request.mutable_policy() = ToMessage(policy);
  request.set_omit_evidence(evidence == Evidence::kOmit);
  request.set_include_clearance(clearance == Clearance::kMeasure);
  v1::CheckConfigurationsResponse response;
  const Clock::time_point asked = Clock::now();
  const absl::Status status =
      connection_->Call(connection_->collisions(), &v1::CollisionService::Stub::CheckConfigurations,
                        request, timeout_, response);
  if (!status.ok()) return status;
  if (static_cast<size_t>(response.verdicts_size()) != configurations.size()) {
    return Malformed(address(), absl::StrCat(response.verdicts_size(), " verdicts for ",
                                             configurations.size(), " configurations"));
  }
  ConfigurationChecks checks{.basis = FromMessage(response.basis(), asked), .verdicts = {}};
  for (const v1::Verdict& verdict : response.verdicts()) {
    checks.verdicts.push_back(FromMessage(verdict, checks.basis));
    if (clearance == Clearance::kOmit) continue;
    const absl::Status measured = RequireClearance(checks.verdicts.back(), address());
    if (!measured.ok()) return measured;
  }
  return checks;
}

absl::StatusOr<NumberChecks> Client::CheckNumbers(std::span<const uint32_t> numbers,
                                                  const Policy& policy) const {
  if (numbers.empty()) return absl::InvalidArgumentError("no configuration is asked for");
  v1::CheckConfigurationsRequest request;
  request.mutable_numbers()->Add(numbers.begin(), numbers.end());
  *request.mutable_policy() = ToMessage(policy);
  v1::CheckConfigurationsResponse response;
  const Clock::time_point asked = Clock::now();
  const absl::Status status =
      connection_->Call(connection_->collisions(), &v1::CollisionService::Stub::CheckConfigurations,
                        request, timeout_, response);
  if (!status.ok()) return status;
  auto free = WordsFrom(response.free(), numbers.size());
  auto occupied = WordsFrom(response.occupied(), numbers.size());
  if (!free || !occupied) {
    return Malformed(address(),
                     absl::StrCat("not a verdict for each of ", numbers.size(), " numbers"));
  }
  NumberChecks checks{.basis = FromMessage(response.basis(), asked),
                      .unknown_reason = FromMessage(response.unknown_reason()),
                      .size = numbers.size(),
                      .free = *std::move(free),
                      .occupied = *std::move(occupied)};
  // What is called both, or rests on nothing, is not known.
  const bool rests = checks.basis.scene_id != 0 && response.unknown_reason() == 0;
  for (size_t i = 0; i < checks.free.size(); ++i) {
    const uint64_t known = rests ? checks.free[i] ^ checks.occupied[i] : 0;
    checks.free[i] &= known;
    checks.occupied[i] &= known;
  }
  return checks;
}

absl::StatusOr<PathCheck> Client::CheckPath(std::span<const Configuration> waypoints,
                                            const Policy& policy, Clearance clearance) const {
  if (waypoints.empty()) return absl::InvalidArgumentError("a path has at least one waypoint");
  v1::CheckPathRequest request;
  for (const Configuration& q : waypoints) *request.add_waypoints() = ToMessage(q);
  *request.mutable_policy() = ToMessage(policy);
  request.set_include_clearance(clearance == Clearance::kMeasure);
  v1::CheckPathResponse response;
  const Clock::time_point asked = Clock::now();
  const absl::Status status =
      connection_->Call(connection_->collisions(), &v1::CollisionService::Stub::CheckPath, request,
                        timeout_, response);
  if (!status.ok()) return status;
  PathCheck check{.basis = FromMessage(response.basis(), asked),
                  .verdict = {},
                  .segment = response.segment(),
                  .fraction = response.fraction(),
                  .configuration = {response.configuration().positions().begin(),
                                    response.configuration().positions().end()},
                  .checked = response.checked()};
  check.verdict = FromMessage(response.verdict(), check.basis);
  if (clearance == Clearance::kOmit) return check;
  const absl::Status measured = RequireClearance(check.verdict, address());
  if (!measured.ok()) return measured;
  if (!check.verdict.free()) return check;
  if (!response.has_narrowest()) {
    return Malformed(address(), "it does not say where the clearance is smallest");
  }
  const v1::PathPlace& place = response.narrowest();
  check.narrowest = {.segment = place.segment(),
                     .fraction = place.fraction(),
                     .configuration = {place.configuration().positions().begin(),
                                       place.configuration().positions().end()}};
  return check;
}

absl::StatusOr<ConfigurationSpace> Client::GetConfigurationSpace(
    const Policy& policy, std::span<const uint64_t> tiles,
    std::optional<absl::Duration> max_time) const {
  v1::GetConfigurationSpaceRequest request;
  if (max_time) *request.mutable_max_time() = ToMessage(*max_time);
  *request.mutable_policy() = ToMessage(policy);
  request.mutable_tiles()->Add(tiles.begin(), tiles.end());
  grpc::ClientContext context;
  context.set_deadline(absl::ToChronoTime(absl::Now() + timeout_));
  const Clock::time_point asked = Clock::now();
  const auto reader = connection_->collisions().GetConfigurationSpace(&context, request);

  Basis basis;
  absl::StatusOr<ConfigurationGrid> grid = absl::InternalError("it has no grid");
  std::vector<ConfigurationSpaceTile> received;
  uint64_t left_out = 0;
  absl::Status fault;
  v1::GetConfigurationSpaceResponse part;
  for (bool first = true; fault.ok() && reader->Read(&part); first = false) {
    if (first) {
      basis = FromMessage(part.basis(), asked);
      left_out = part.tiles_left_out();
      if (part.has_grid()) grid = FromMessage(part.grid());
      fault = grid.status();
    }
    for (const v1::ConfigurationSpaceTile& message : part.tiles()) {
      const absl::StatusOr<ConfigurationSpaceTile> tile = FromMessage(message);
      fault.Update(tile.status());
      if (!fault.ok()) break;
      received.push_back(*tile);
    }
  }
  if (!fault.ok()) context.TryCancel();
  const grpc::Status finished = reader->Finish();
  if (!fault.ok()) return Malformed(address(), fault.message());
  if (!finished.ok()) return SentenceFor(finished, address(), timeout_);
  if (!grid.ok()) return Malformed(address(), grid.status().message());
  try {
    return ConfigurationSpace(*std::move(grid), basis, std::move(received), left_out);
  } catch (const std::invalid_argument& error) {
    return Malformed(address(), error.what());
  }
}

absl::StatusOr<Explanation> Client::Explain(const Configuration& configuration,
                                            const Policy& policy) const {
  v1::ExplainRequest request;
  *request.mutable_configuration() = ToMessage(configuration);
  *request.mutable_policy() = ToMessage(policy);
  v1::ExplainResponse response;
  const Clock::time_point asked = Clock::now();
  const absl::Status status = connection_->Call(
      connection_->collisions(), &v1::CollisionService::Stub::Explain, request, timeout_, response);
  if (!status.ok()) return status;
  Explanation explanation{
      .basis = FromMessage(response.basis(), asked), .verdict = {}, .views = {}};
  explanation.verdict = FromMessage(response.verdict(), explanation.basis);
  for (const v1::ViewExplanation& view : response.views()) {
    explanation.views.push_back({.view = view.view(),
                                 .scene_png = view.scene_png(),
                                 .obstacle_png = view.obstacle_png(),
                                 .intersection_png = view.intersection_png(),
                                 .collision_png = view.collision_png()});
  }
  return explanation;
}

absl::StatusOr<Scene> Client::PublishScene(std::span<const JointPosition> joints,
                                           std::span<const ViewImage> images) const {
  v1::PublishSceneRequest request;
  for (const JointPosition& joint : joints) {
    v1::JointPosition* message = request.add_joints();
    message->set_name(joint.name);
    message->set_position(joint.position);
  }
  for (const ViewImage& image : images) *request.add_views() = ToMessage(image);
  v1::PublishSceneResponse response;
  const absl::Status status = connection_->Call(
      connection_->scenes(), &v1::SceneService::Stub::PublishScene, request, timeout_, response);
  if (!status.ok()) return status;
  absl::StatusOr<Scene> scene = FromMessage(response.scene());
  if (!scene.ok()) return Malformed(address(), scene.status().message());
  return scene;
}

absl::StatusOr<Scene> Client::GetScene(uint64_t id, bool with_planes) const {
  v1::GetSceneRequest request;
  request.set_id(id);
  request.set_include_planes(with_planes);
  v1::GetSceneResponse response;
  const absl::Status status = connection_->Call(
      connection_->scenes(), &v1::SceneService::Stub::GetScene, request, timeout_, response);
  if (!status.ok()) return status;
  absl::StatusOr<Scene> scene = FromMessage(response.scene());
  if (!scene.ok()) return Malformed(address(), scene.status().message());
  return scene;
}

absl::StatusOr<AllowedRegion> Client::AllowRegion(const std::string& name,
                                                  std::span<const RegionPixels> views,
                                                  absl::Duration duration) const {
  v1::AllowRegionRequest request;
  request.set_name(name);
  for (const RegionPixels& view : views) *request.add_views() = ToMessage(view);
  *request.mutable_duration() = ToMessage(duration);
  v1::AllowRegionResponse response;
  const absl::Status status = connection_->Call(
      connection_->scenes(), &v1::SceneService::Stub::AllowRegion, request, timeout_, response);
  if (!status.ok()) return status;
  absl::StatusOr<AllowedRegion> region = FromMessage(response.region());
  if (!region.ok()) return Malformed(address(), region.status().message());
  return region;
}

absl::StatusOr<bool> Client::RevokeRegion(const std::string& name) const {
  v1::RevokeRegionRequest request;
  request.set_name(name);
  v1::RevokeRegionResponse response;
  const absl::Status status = connection_->Call(
      connection_->scenes(), &v1::SceneService::Stub::RevokeRegion, request, timeout_, response);
  if (!status.ok()) return status;
  return response.was_in_force();
}

absl::StatusOr<std::vector<AllowedRegion>> Client::ListAllowedRegions() const {
  v1::ListAllowedRegionsResponse response;
  const absl::Status status =
      connection_->Call(connection_->scenes(), &v1::SceneService::Stub::ListAllowedRegions,
                        v1::ListAllowedRegionsRequest(), timeout_, response);
  if (!status.ok()) return status;
  std::vector<AllowedRegion> regions;
  for (const v1::AllowedRegion& message : response.regions()) {
    absl::StatusOr<AllowedRegion> region = FromMessage(message);
    if (!region.ok()) return Malformed(address(), region.status().message());
    regions.push_back(*std::move(region));
  }
  return regions;
}

absl::StatusOr<Database> Client::GetDatabase() const {
  v1::GetDatabaseResponse response;
  const absl::Status status =
      connection_->Call(connection_->databases(), &v1::DatabaseService::Stub::GetDatabase,
                        v1::GetDatabaseRequest(), timeout_, response);
  if (!status.ok()) return status;
  absl::StatusOr<Database> database = FromMessage(response);
  if (!database.ok()) return Malformed(address(), database.status().message());
  return database;
}

}  // namespace silhouette::client
