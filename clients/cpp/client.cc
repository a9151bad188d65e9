// SPDX-License-Identifier: Apache-2.0
#include "silhouette/client.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <mutex>
#include <optional>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "clients/cpp/check_answers.h"
#include "clients/cpp/connection.h"
#include "clients/cpp/server_clock.h"
#include "proto/tls/channel_credentials.h"
#include "silhouette/messages.h"

namespace silhouette::client {

namespace {

RunningClock::time_point MadeAt(const std::shared_ptr<const Connection>& connection,
                                const v1::Basis& basis, RunningClock::time_point asked,
                                absl::Duration timeout, const v1::Separation& separation = {}) {
  Cancellation never_cancelled;
  ServerClock clock(connection, timeout, never_cancelled);
  return MadeAt(basis, asked, clock, separation);
}

// Of an answer; empty if it cannot have one.
template <typename Response>
const v1::Separation& SeparationOf(const Response& /*answer*/) {
  return v1::Separation::default_instance();
}
const v1::Separation& SeparationOf(const v1::CheckPathResponse& answer) {
  return answer.separation();
}

// An answer, and when it was made at the earliest.
template <typename Response>
struct Answered {
  Response message;
  RunningClock::time_point made;
};

// A question about verdicts; its answer must be about this cell and the requested variant.
template <typename Request, typename Response>
absl::StatusOr<Answered<Response>> Ask(const std::shared_ptr<const Connection>& connection,
                                       grpc::Status (v1::CollisionService::Stub::*method)(
                                           grpc::ClientContext*, const Request&, Response*),
                                       const Request& request, absl::Duration timeout) {
  const RunningClock::time_point asked = RunningClock::now();
  absl::StatusOr<Response> response = connection->Call(method, request, timeout);
  if (!response.ok()) return response.status();
  const absl::Status usable = RequireBasis(request.variant(), response->basis(), *connection);
  if (!usable.ok()) return usable;
  const RunningClock::time_point made =
      MadeAt(connection, response->basis(), asked, timeout, SeparationOf(*response));
  return Answered<Response>{.message = *std::move(response), .made = made};
}

// Whether the server is of the connection's cell (RequireSameCell). Asked before something is
// changed: what is meant for one cell must leave another as it is.
absl::Status AskCell(const Connection& connection, absl::Duration timeout) {
  const auto response = connection.Call(&v1::CollisionService::Stub::CheckConfigurations,
                                        v1::CheckConfigurationsRequest(), timeout);
  if (!response.ok()) return response.status();
  return connection.RequireSameCell(response->basis());
}

void RequireMasks(const v1::Scene& scene) {
  for (const v1::SceneView& view : scene.views()) {
    const bool all = view.has_obstacle();  // it comes with scene, unknown and error
    if (all || view.has_scene()) FromMessage(view.scene());
    if (all) FromMessage(view.obstacle());
    if (all || view.has_unknown()) FromMessage(view.unknown());
    if (all || view.has_error()) FromMessage(view.error());
    if (view.has_ignored()) FromMessage(view.ignored());
    if (view.has_strong()) FromMessage(view.strong());
  }
}
void RequireMasks(const v1::AllowedRegion& region) {
  for (const v1::RegionPixels& view : region.views()) FromMessage(view.mask());
}
void RequireMasks(const v1::ExplainResponse& explanation) {
  for (const v1::ViewExplanation& view : explanation.views()) {
    if (view.has_robot()) FromMessage(view.robot());
  }
}

using SpacePart = v1::GetConfigurationSpaceResponse;

// What the parts of a configuration space bring.
struct FetchedSpace {
  std::optional<ConfigurationGrid> grid = std::nullopt;  // nothing: no part came
  Basis basis = {};
  std::optional<Reason> unknown = std::nullopt;
  std::vector<ConfigurationSpaceTile> tiles = {};
  uint64_t tiles_left_out = 0;
};

// Takes what only the first part has. `made`: as Basis::asked.
absl::Status TakeBeginning(const SpacePart& first, RunningClock::time_point made,
                           const std::string& address, FetchedSpace& space) {
  absl::StatusOr<ConfigurationGrid> grid = absl::InternalError("it has no grid");
  if (first.has_grid()) grid = FromMessage(first.grid());
  if (!grid.ok()) return Malformed(address, grid.status().message());
  space.grid = *std::move(grid);
  space.basis = FromMessage(first.basis(), made);
  space.tiles_left_out = first.tiles_left_out();
  // By its beginning: a large space takes long to come.
  const bool expired = DropIfExpired(space.basis);
  if (expired && space.basis.scene_id != 0) space.unknown = Reason::kAnswerLate;
  if (first.unknown_reason() != 0) space.unknown = FromMessage(first.unknown_reason());
  return absl::OkStatus();
}

absl::Status TakeTiles(const SpacePart& part, const std::string& address, FetchedSpace& space) {
  for (const v1::ConfigurationSpaceTile& message : part.tiles()) {
    absl::StatusOr<ConfigurationSpaceTile> tile = FromMessage(message);
    if (!tile.ok()) return Malformed(address, tile.status().message());
    space.tiles.push_back(*std::move(tile));
  }
  return absl::OkStatus();
}

// The message; Malformed if one of its masks cannot be.
template <typename Message>
absl::StatusOr<Message> WithMasks(const Message& message, const std::string& address) {
  try {
    RequireMasks(message);
    return message;
  } catch (const std::invalid_argument& error) {
    return Malformed(address, absl::StrCat("a mask cannot be: ", error.what()));
  }
}

}  // namespace

// Stamps images that are published. Thread-safe.
class PublishingClock {
 public:
  PublishingClock(std::shared_ptr<const Connection> connection, absl::Duration timeout)
      : clock_(std::move(connection), timeout, never_cancelled_) {}

  // These images were taken at `taken` or later.
  absl::Status Stamp(RunningClock::time_point taken, std::span<v1::ViewImage* const> images) {
    const std::lock_guard lock(mutex_);
    const absl::StatusOr<absl::Duration> clock = clock_.ClockAt(taken);
    if (!clock.ok()) return clock.status();
    const absl::Time time = absl::Now() - absl::FromChrono(RunningClock::now() - taken);
    for (v1::ViewImage* image : images) {
      *image->mutable_server_clock() = ToMessage(*clock);
      *image->mutable_capture_time() = ToMessage(time);  // for people
    }
    return absl::OkStatus();
  }

  // The server's clock is another now.
  void Forget() {
    const std::lock_guard lock(mutex_);
    clock_.Forget();
  }

 private:
  std::mutex mutex_;
  Cancellation never_cancelled_;
  ServerClock clock_;
};

Client::Client(std::shared_ptr<const Connection> connection,
               std::shared_ptr<PublishingClock> publishing_clock, absl::Duration timeout,
               std::string variant)
    : connection_(std::move(connection)),
      publishing_clock_(std::move(publishing_clock)),
      timeout_(timeout),
      variant_(std::move(variant)) {}

absl::StatusOr<Client> Client::Connect(const std::string& address, absl::Duration timeout,
                                       const ClientTls& tls) {
  if (absl::Status status = RequireAddress(address); !status.ok()) return status;
  if (absl::Status usable = RequireCallable(timeout); !usable.ok()) return usable;
  const auto credentials = ChannelCredentialsFor(
      address, {.ca = tls.ca, .certificate = tls.certificate, .key = tls.key});
  if (!credentials.ok()) return credentials.status();
  auto connection = std::make_shared<const Connection>(address, *credentials, !tls.ca.empty());
  auto clock = std::make_shared<PublishingClock>(connection, timeout);
  return Client(std::move(connection), std::move(clock), timeout, /*variant=*/"");
}

Client Client::WithTimeout(absl::Duration timeout) const {
  return Client(connection_, publishing_clock_, timeout, variant_);
}

Client Client::WithVariant(std::string variant) const {
  return Client(connection_, publishing_clock_, timeout_, std::move(variant));
}

const std::string& Client::address() const { return connection_->address(); }

absl::StatusOr<ConfigurationChecks> Client::CheckConfigurations(
    std::span<const Configuration> configurations, const Policy& policy, Evidence evidence,
    Clearance clearance) const {
  v1::CheckConfigurationsRequest request = QuestionOf(configurations, policy, evidence, clearance);
  request.set_variant(variant_);
  const auto response =
      Ask(connection_, &v1::CollisionService::Stub::CheckConfigurations, request, timeout_);
  if (!response.ok()) return response.status();
  return UnlessExpired(
      AnswerFrom(response->message, configurations.size(), clearance, response->made, address()));
}

absl::StatusOr<NumberChecks> Client::CheckNumbers(std::span<const uint32_t> numbers,
                                                  const Policy& policy) const {
  if (numbers.empty()) return absl::InvalidArgumentError("no configuration is requested");
  v1::CheckConfigurationsRequest request;
  request.mutable_numbers()->Add(numbers.begin(), numbers.end());
  *request.mutable_policy() = ToMessage(policy);
  request.set_variant(variant_);
  const auto response =
      Ask(connection_, &v1::CollisionService::Stub::CheckConfigurations, request, timeout_);
  if (!response.ok()) return response.status();
  return UnlessExpired(NumbersFrom(response->message, numbers.size(), response->made, address()));
}

absl::StatusOr<PathCheck> Client::CheckPath(
    std::span<const Configuration> waypoints, const Policy& policy, Clearance clearance,
    std::optional<double> resolution, const std::optional<SeparationPolicy>& separation) const {
  if (waypoints.empty()) return absl::InvalidArgumentError("a path has at least one waypoint");
  v1::CheckPathRequest request = QuestionOf(waypoints, policy, clearance, resolution, separation);
  request.set_variant(variant_);
  const auto response = Ask(connection_, &v1::CollisionService::Stub::CheckPath, request, timeout_);
  if (!response.ok()) return response.status();
  if (separation && !response->message.has_separation()) return NoSeparation(address());
  return UnlessExpired(AnswerFrom(response->message, clearance, response->made, address()));
}

absl::StatusOr<ConfigurationSpace> Client::GetConfigurationSpace(
    const Policy& policy, std::span<const uint64_t> tiles, std::optional<absl::Duration> max_time,
    std::span<const double> clearance_levels) const {
  if (absl::Status usable = RequireCallable(timeout_); !usable.ok()) return usable;
  v1::GetConfigurationSpaceRequest request;
  request.mutable_clearance_levels()->Add(clearance_levels.begin(), clearance_levels.end());
  if (max_time) *request.mutable_max_time() = ToMessage(*max_time);
  *request.mutable_policy() = ToMessage(policy);
  request.mutable_tiles()->Add(tiles.begin(), tiles.end());
  request.set_variant(variant_);
  grpc::ClientContext context;
  context.set_deadline(absl::ToChronoTime(absl::Now() + timeout_));
  const RunningClock::time_point asked = RunningClock::now();
  const auto reader = connection_->collisions().GetConfigurationSpace(&context, request);

  FetchedSpace space;
  const auto take = [&](const SpacePart& part) -> absl::Status {
    if (!space.grid) {
      absl::Status usable = RequireBasis(variant_, part.basis(), *connection_);
      if (!usable.ok()) return usable;
      const auto made = MadeAt(connection_, part.basis(), asked, timeout_);
      usable = TakeBeginning(part, made, address(), space);
      if (!usable.ok()) return usable;
    }
    return TakeTiles(part, address(), space);
  };
  const absl::Status ended = connection_->ReadAll<SpacePart>(*reader, context, timeout_, take);
  if (!ended.ok()) return ended;
  if (!space.grid) return Malformed(address(), "it has no grid");
  const bool lacks_levels = std::ranges::any_of(
      space.tiles, [](const ConfigurationSpaceTile& tile) { return tile.above.empty(); });
  if (!clearance_levels.empty() && lacks_levels) return NoClearances(address());
  try {
    return ConfigurationSpace(*std::move(space.grid), std::move(space.basis),
                              std::move(space.tiles), space.tiles_left_out,
                              {clearance_levels.begin(), clearance_levels.end()}, space.unknown);
  } catch (const std::invalid_argument& error) {
    return Malformed(address(), error.what());
  }
}

absl::StatusOr<Explanation> Client::Explain(const Configuration& configuration,
                                            const Policy& policy) const {
  v1::ExplainRequest request;
  *request.mutable_configuration() = ToMessage(configuration);
  *request.mutable_policy() = ToMessage(policy);
  request.set_variant(variant_);
  const auto response = Ask(connection_, &v1::CollisionService::Stub::Explain, request, timeout_);
  if (!response.ok()) return response.status();
  const absl::Status usable = WithMasks(response->message, address()).status();
  if (!usable.ok()) return usable;
  Explanation explanation{
      .basis = FromMessage(response->message.basis(), response->made), .verdict = {}, .views = {}};
  explanation.verdict = FromMessage(response->message.verdict(), explanation.basis);
  DropIfExpired(explanation);
  for (const v1::ViewExplanation& view : response->message.views()) {
    explanation.views.push_back({.view = view.view(),
                                 .scene_png = view.scene_png(),
                                 .obstacle_png = view.obstacle_png(),
                                 .intersection_png = view.intersection_png(),
                                 .collision_png = view.collision_png()});
    if (view.has_robot()) explanation.views.back().robot = FromMessage(view.robot());
  }
  return explanation;
}

absl::StatusOr<v1::Scene> Client::PublishScene(
    v1::PublishSceneRequest scene, std::optional<RunningClock::time_point> taken) const {
  if (taken > RunningClock::now()) {
    return absl::InvalidArgumentError(
        "taken lies in the future: state an instant of RunningClock::now() not later than the "
        "capture, not one of another clock");
  }
  if (!variant_.empty() && scene.variant().empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("this client checks '", variant_,
                     "': name the variant that the images show, or 'default'"));
  }
  std::vector<v1::ViewImage*> unstamped;
  for (v1::ViewImage& image : *scene.mutable_views()) {
    if (!image.has_capture_time() && !image.has_server_clock()) unstamped.push_back(&image);
  }
  if (!unstamped.empty() && !taken) {
    return absl::InvalidArgumentError(
        absl::StrCat("the image of view '", unstamped.front()->view(),
                     "' has no time: state taken, an instant of RunningClock::now() not later than "
                     "the capture, such as that before the cameras are triggered"));
  }
  const auto publish = [&]() -> absl::StatusOr<v1::PublishSceneResponse> {
    if (!unstamped.empty()) {
      const absl::Status stamped = publishing_clock_->Stamp(*taken, unstamped);
      if (!stamped.ok()) return stamped;
    }
    if (absl::Status same = AskCell(*connection_, timeout_); !same.ok()) return same;
    return connection_->Call(&v1::SceneService::Stub::PublishScene, scene, timeout_);
  };
  absl::StatusOr<v1::PublishSceneResponse> response = publish();
  if (absl::IsOutOfRange(response.status()) && !unstamped.empty()) {
    publishing_clock_->Forget();
    response = publish();
  }
  if (!response.ok()) return response.status();
  if (!scene.variant().empty() && response->scene().variant() != scene.variant()) {
    return NoVariants(address());
  }
  return WithMasks(response->scene(), address());
}

absl::StatusOr<v1::Scene> Client::GetScene(uint64_t id, bool with_planes) const {
  v1::GetSceneRequest request;
  request.set_id(id);
  request.set_include_planes(with_planes);
  const auto response = connection_->Call(&v1::SceneService::Stub::GetScene, request, timeout_);
  if (!response.ok()) return response.status();
  return WithMasks(response->scene(), address());
}

absl::StatusOr<v1::Acquisition> Client::GetAcquisition() const {
  const auto response = connection_->Call(&v1::SceneService::Stub::GetAcquisition,
                                          v1::GetAcquisitionRequest(), timeout_);
  if (!response.ok()) return response.status();
  return response->acquisition();
}

absl::StatusOr<v1::ChangeVariantResponse> Client::BeginVariantChange() const {
  if (absl::Status same = AskCell(*connection_, timeout_); !same.ok()) return same;
  v1::ChangeVariantRequest request;
  request.set_changing(true);
  return connection_->Call(&v1::SceneService::Stub::ChangeVariant, request, timeout_);
}

absl::StatusOr<v1::ChangeVariantResponse> Client::ChangeVariant(const std::string& variant) const {
  if (absl::Status same = AskCell(*connection_, timeout_); !same.ok()) return same;
  v1::ChangeVariantRequest request;
  request.set_variant(variant);
  return connection_->Call(&v1::SceneService::Stub::ChangeVariant, request, timeout_);
}

absl::StatusOr<v1::AllowedRegion> Client::AllowRegion(const v1::AllowRegionRequest& region) const {
  if (absl::Status same = AskCell(*connection_, timeout_); !same.ok()) return same;
  const auto response = connection_->Call(&v1::SceneService::Stub::AllowRegion, region, timeout_);
  if (!response.ok()) return response.status();
  return WithMasks(response->region(), address());
}

absl::StatusOr<bool> Client::RevokeRegion(const std::string& name) const {
  v1::RevokeRegionRequest request;
  request.set_name(name);
  const auto response = connection_->Call(&v1::SceneService::Stub::RevokeRegion, request, timeout_);
  if (!response.ok()) return response.status();
  return response->was_in_force();
}

absl::StatusOr<v1::ListAllowedRegionsResponse> Client::ListAllowedRegions() const {
  auto response = connection_->Call(&v1::SceneService::Stub::ListAllowedRegions,
                                    v1::ListAllowedRegionsRequest(), timeout_);
  if (!response.ok()) return response;
  for (const v1::AllowedRegion& region : response->regions()) {
    const absl::Status usable = WithMasks(region, address()).status();
    if (!usable.ok()) return usable;
  }
  return response;
}

absl::StatusOr<v1::GetDatabaseResponse> Client::GetDatabase() const {
  auto response = connection_->Call(&v1::DatabaseService::Stub::GetDatabase,
                                    v1::GetDatabaseRequest(), timeout_);
  if (!response.ok()) return response;
  if (absl::Status same = connection_->RequireSameCell(*response); !same.ok()) return same;
  const absl::Status grid = FromMessage(response->grid()).status();
  if (!grid.ok()) return Malformed(address(), grid.message());
  return response;
}

}  // namespace silhouette::client
