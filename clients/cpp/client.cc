// SPDX-License-Identifier: Apache-2.0
#include "silhouette/client.h"

#include <grpcpp/grpcpp.h>

#include <chrono>
#include <optional>
#include <stdexcept>
#include <utility>

#include "clients/cpp/check_answers.h"
#include "clients/cpp/check_stream.h"
#include "clients/cpp/connection.h"
#include "clients/cpp/messages.h"
#include "clients/cpp/path_watch.h"

namespace silhouette::client {

namespace {

using Clock = std::chrono::steady_clock;

// A question about verdicts; its answer must use the requested variant.
template <typename Request, typename Response>
absl::StatusOr<Response> Ask(const Connection& connection,
                             grpc::Status (v1::CollisionService::Stub::*method)(
                                 grpc::ClientContext*, const Request&, Response*),
                             const Request& request, absl::Duration timeout) {
  absl::StatusOr<Response> response =
      connection.Call(connection.collisions(), method, request, timeout);
  if (!response.ok()) return response;
  const absl::Status of_variant =
      RequireVariant(request.variant(), response->basis(), connection.address());
  if (!of_variant.ok()) return of_variant;
  return response;
}

}  // namespace

Client::Client(std::shared_ptr<const Connection> connection, absl::Duration timeout,
               std::string variant)
    : connection_(std::move(connection)), timeout_(timeout), variant_(std::move(variant)) {}

absl::StatusOr<Client> Client::Connect(const std::string& address, absl::Duration timeout) {
  if (absl::Status status = RequireAddress(address); !status.ok()) return status;
  if (timeout <= absl::ZeroDuration()) {
    return absl::InvalidArgumentError("the time for a call must be positive");
  }
  return Client(std::make_shared<const Connection>(address), timeout, /*variant=*/"");
}

Client Client::WithTimeout(absl::Duration timeout) const {
  return Client(connection_, timeout, variant_);
}

Client Client::WithVariant(std::string variant) const {
  return Client(connection_, timeout_, std::move(variant));
}

const std::string& Client::address() const { return connection_->address(); }

absl::StatusOr<ConfigurationChecks> Client::CheckConfigurations(
    std::span<const Configuration> configurations, const Policy& policy, Evidence evidence,
    Clearance clearance) const {
  v1::CheckConfigurationsRequest request = QuestionOf(configurations, policy, evidence, clearance);
  request.set_variant(variant_);
  const Clock::time_point asked = Clock::now();
  const auto response =
      Ask(*connection_, &v1::CollisionService::Stub::CheckConfigurations, request, timeout_);
  if (!response.ok()) return response.status();
  return AnswerFrom(*response, configurations.size(), clearance, asked, address());
}

absl::StatusOr<NumberChecks> Client::CheckNumbers(std::span<const uint32_t> numbers,
                                                  const Policy& policy) const {
  if (numbers.empty()) return absl::InvalidArgumentError("no configuration is requested");
  v1::CheckConfigurationsRequest request;
  request.mutable_numbers()->Add(numbers.begin(), numbers.end());
  *request.mutable_policy() = ToMessage(policy);
  request.set_variant(variant_);
  const Clock::time_point asked = Clock::now();
  const auto response =
      Ask(*connection_, &v1::CollisionService::Stub::CheckConfigurations, request, timeout_);
  if (!response.ok()) return response.status();
  return NumbersFrom(*response, numbers.size(), asked, address());
}

absl::StatusOr<PathCheck> Client::CheckPath(std::span<const Configuration> waypoints,
                                            const Policy& policy, Clearance clearance) const {
  if (waypoints.empty()) return absl::InvalidArgumentError("a path has at least one waypoint");
  v1::CheckPathRequest request = QuestionOf(waypoints, policy, clearance);
  request.set_variant(variant_);
  const Clock::time_point asked = Clock::now();
  const auto response =
      Ask(*connection_, &v1::CollisionService::Stub::CheckPath, request, timeout_);
  if (!response.ok()) return response.status();
  return AnswerFrom(*response, clearance, asked, address());
}

absl::StatusOr<PathWatch> Client::WatchPath(std::span<const Configuration> waypoints,
                                            const Policy& policy, Clearance clearance) const {
  if (waypoints.empty()) return absl::InvalidArgumentError("a path has at least one waypoint");
  v1::CheckPathRequest request = QuestionOf(waypoints, policy, clearance);
  request.set_variant(variant_);
  return PathWatch(
      std::make_unique<PathWatch::Impl>(connection_, timeout_, std::move(request), clearance));
}

CheckStream Client::StreamChecks() const {
  return CheckStream(std::make_unique<CheckStream::Impl>(connection_, variant_));
}

absl::StatusOr<ConfigurationSpace> Client::GetConfigurationSpace(
    const Policy& policy, std::span<const uint64_t> tiles, std::optional<absl::Duration> max_time,
    std::span<const double> clearance_levels) const {
  v1::GetConfigurationSpaceRequest request;
  request.mutable_clearance_levels()->Add(clearance_levels.begin(), clearance_levels.end());
  if (max_time) *request.mutable_max_time() = ToMessage(*max_time);
  *request.mutable_policy() = ToMessage(policy);
  request.mutable_tiles()->Add(tiles.begin(), tiles.end());
  request.set_variant(variant_);
  grpc::ClientContext context;
  context.set_deadline(absl::ToChronoTime(absl::Now() + timeout_));
  const Clock::time_point asked = Clock::now();
  const auto reader = connection_->collisions().GetConfigurationSpace(&context, request);

  Basis basis;
  absl::StatusOr<ConfigurationGrid> grid = absl::InternalError("it has no grid");
  std::vector<ConfigurationSpaceTile> received;
  uint64_t left_out = 0;
  bool tells_levels = true;
  absl::Status fault;
  absl::Status of_variant;
  v1::GetConfigurationSpaceResponse part;
  for (bool first = true; fault.ok() && reader->Read(&part); first = false) {
    if (first) {
      basis = FromMessage(part.basis(), asked);
      of_variant = RequireVariant(variant_, part.basis(), address());
      left_out = part.tiles_left_out();
      if (part.has_grid()) grid = FromMessage(part.grid());
      fault = grid.status();
    }
    for (const v1::ConfigurationSpaceTile& message : part.tiles()) {
      absl::StatusOr<ConfigurationSpaceTile> tile = FromMessage(message);
      fault.Update(tile.status());
      if (!fault.ok()) break;
      tells_levels = tells_levels && (clearance_levels.empty() || !tile->above.empty());
      received.push_back(*std::move(tile));
    }
  }
  if (!fault.ok()) context.TryCancel();
  const grpc::Status finished = reader->Finish();
  if (!fault.ok()) return Malformed(address(), fault.message());
  if (!finished.ok()) return connection_->SentenceFor(finished, timeout_);
  if (!grid.ok()) return Malformed(address(), grid.status().message());
  if (!of_variant.ok()) return of_variant;
  if (!tells_levels) return NoClearances(address());
  try {
    return ConfigurationSpace(*std::move(grid), basis, std::move(received), left_out,
                              {clearance_levels.begin(), clearance_levels.end()});
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
  const Clock::time_point asked = Clock::now();
  const auto response = Ask(*connection_, &v1::CollisionService::Stub::Explain, request, timeout_);
  if (!response.ok()) return response.status();
  Explanation explanation{
      .basis = FromMessage(response->basis(), asked), .verdict = {}, .views = {}};
  explanation.verdict = FromMessage(response->verdict(), explanation.basis);
  for (const v1::ViewExplanation& view : response->views()) {
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
  request.set_variant(variant_);
  const auto response = connection_->Call(connection_->scenes(),
                                          &v1::SceneService::Stub::PublishScene, request, timeout_);
  if (!response.ok()) return response.status();
  if (!variant_.empty() && response->scene().variant() != variant_) return NoVariants(address());
  return Usable(FromMessage(response->scene()), address());
}

absl::StatusOr<Scene> Client::GetScene(uint64_t id, bool with_planes) const {
  v1::GetSceneRequest request;
  request.set_id(id);
  request.set_include_planes(with_planes);
  const auto response = connection_->Call(connection_->scenes(), &v1::SceneService::Stub::GetScene,
                                          request, timeout_);
  if (!response.ok()) return response.status();
  return Usable(FromMessage(response->scene()), address());
}

absl::StatusOr<AllowedRegion> Client::AllowRegion(const std::string& name,
                                                  std::span<const RegionPixels> views,
                                                  absl::Duration duration) const {
  v1::AllowRegionRequest request;
  request.set_name(name);
  for (const RegionPixels& view : views) *request.add_views() = ToMessage(view);
  *request.mutable_duration() = ToMessage(duration);
  const auto response = connection_->Call(connection_->scenes(),
                                          &v1::SceneService::Stub::AllowRegion, request, timeout_);
  if (!response.ok()) return response.status();
  return Usable(FromMessage(response->region()), address());
}

absl::StatusOr<bool> Client::RevokeRegion(const std::string& name) const {
  v1::RevokeRegionRequest request;
  request.set_name(name);
  const auto response = connection_->Call(connection_->scenes(),
                                          &v1::SceneService::Stub::RevokeRegion, request, timeout_);
  if (!response.ok()) return response.status();
  return response->was_in_force();
}

absl::StatusOr<std::vector<AllowedRegion>> Client::ListAllowedRegions() const {
  const auto response =
      connection_->Call(connection_->scenes(), &v1::SceneService::Stub::ListAllowedRegions,
                        v1::ListAllowedRegionsRequest(), timeout_);
  if (!response.ok()) return response.status();
  std::vector<AllowedRegion> regions;
  for (const v1::AllowedRegion& message : response->regions()) {
    absl::StatusOr<AllowedRegion> region = FromMessage(message);
    if (!region.ok()) return Malformed(address(), region.status().message());
    regions.push_back(*std::move(region));
  }
  return regions;
}

absl::StatusOr<Database> Client::GetDatabase() const {
  const auto response =
      connection_->Call(connection_->databases(), &v1::DatabaseService::Stub::GetDatabase,
                        v1::GetDatabaseRequest(), timeout_);
  if (!response.ok()) return response.status();
  return Usable(FromMessage(*response), address());
}

}  // namespace silhouette::client
