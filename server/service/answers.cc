// SPDX-License-Identifier: Apache-2.0
#include "server/service/answers.h"
#include "server/service/calls.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "common/picture/picture.h"
#include "db/status/status_macros.h"
#include "server/collision/collision_images.h"
#include "server/collision/obstacle_image.h"
#include "server/service/defects.h"
#include "server/service/messages.h"
#include "server/service/separation.h"
#include "server/service/space_writer.h"

namespace silhouette {

namespace {

// Up to this many configurations are checked in gRPC's own threads, which scenes come through, too.
// Slow: robot images are drawn, or searched along lines.
constexpr int kFewChecks = 64;
constexpr int kFewSlowChecks = 4;

absl::Status AtMost(int limit, int count, const std::string& field) {
  if (count <= limit) return absl::OkStatus();
  return FieldError(field,
                    absl::StrCat("there are ", count, "; ask for at most ", limit, " at once"));
}

absl::StatusOr<std::vector<Configuration>> ConfigurationsFrom(
    const google::protobuf::RepeatedPtrField<v1::Configuration>& messages,
    const ConfigurationGrid& grid, const std::string& field, int limit) {
  RETURN_IF_ERROR(AtMost(limit, messages.size(), field));
  std::vector<Configuration> configurations;
  for (int i = 0; i < messages.size(); ++i) {
    ASSIGN_OR_RETURN(Configuration q,
                     ConfigurationFrom(messages[i], grid, absl::StrCat(field, "[", i, "]")));
    configurations.push_back(std::move(q));
  }
  return configurations;
}

// What is found out about one configuration.
struct Finding {
  Verdict verdict;
  std::optional<double> clearance;
};

// A fault of ours while one configuration is checked makes that one unknown. `meter`: null if no
// clearance is asked for.
Finding CheckOne(const Checker& checker, const Configuration& q, std::span<ViewEvidence> evidence,
                 const ClearanceMeter* meter = nullptr) {
  try {
    Finding finding{.verdict = checker.Check(q, evidence), .clearance = std::nullopt};
    if (meter != nullptr) finding.clearance = meter->Measure(q, finding.verdict, evidence);
    return finding;
  } catch (const std::exception& error) {
    spdlog::error("internal error: {}", error.what());
    std::fill(evidence.begin(), evidence.end(), ViewEvidence{});
    return {.verdict = Verdict::Unknown(Reason::kInternal), .clearance = std::nullopt};
  }
}

uint64_t CountBits(std::span<const uint64_t> bits) {
  uint64_t count = 0;
  for (const uint64_t word : bits) count += static_cast<uint64_t>(std::popcount(word));
  return count;
}

// `blocked`: why all are unknown; kNone: for reasons that are not reported.
void CountVerdicts(std::span<const uint64_t> free, std::span<const uint64_t> occupied,
                   uint64_t configurations, Reason blocked, VerdictCounts& counts) {
  const uint64_t known[] = {CountBits(free), CountBits(occupied)};
  counts.Add(State::kFree, Reason::kNone, known[0]);
  counts.Add(State::kOccupied, Reason::kNone, known[1]);
  counts.Add(State::kUnknown, blocked, configurations - known[0] - known[1]);
}

// As every client does to read the server's clock.
bool AsksNothing(const v1::CheckConfigurationsRequest& request) {
  return request.numbers().empty() && request.configurations().empty();
}

// What an answer would rest on; nothing is prepared for one.
absl::Status AnswerNothing(Serving& serving, const v1::CheckConfigurationsRequest& request,
                           v1::CheckConfigurationsResponse* response) {
  ASSIGN_OR_RETURN(const Served served,
                   WithVariant(serving.scenes.Newest(serving.settings.clock()), request.variant()));
  ASSIGN_OR_RETURN(const Policy policy, PolicyFor(serving, request.policy(), *served.database));
  Conclude(serving, served, policy, response->mutable_basis());
  return absl::OkStatus();
}

// An answer by numbers.
absl::Status AnswerNumbers(Serving& serving, const v1::CheckConfigurationsRequest& request,
                           const Stop& cancelled, v1::CheckConfigurationsResponse* response) {
  if (!request.configurations().empty()) {
    return FieldError("numbers", "ask for numbers or for configurations, not for both at once");
  }
  if (request.include_clearance()) {
    return FieldError("include_clearance", "clearances are for configurations, not for numbers");
  }
  RETURN_IF_ERROR(AtMost(kMaxNumbers, request.numbers_size(), "numbers"));
  ASSIGN_OR_RETURN(const Served served,
                   WithVariant(serving.scenes.Newest(serving.settings.clock()), request.variant()));
  ASSIGN_OR_RETURN(const Policy policy, PolicyFor(serving, request.policy(), *served.database));
  const auto count = static_cast<size_t>(request.numbers_size());
  std::vector<uint64_t> free((count + 63) / 64, 0);
  std::vector<uint64_t> occupied(free.size(), 0);
  if (served.scene != nullptr) {
    const std::span<const uint32_t> numbers(request.numbers().data(), count);
    const auto space = serving.spaces.Get(served, policy);
    if (!space->States(numbers, free, occupied, cancelled)) return absl::CancelledError();
  }
  const Reason blocked = Conclude(serving, served, policy, response->mutable_basis());
  if (blocked != Reason::kNone) {
    std::ranges::fill(free, 0);
    std::ranges::fill(occupied, 0);
  }
  const bool nodes = served.database->robot_images().has_nodes();
  CountVerdicts(free, occupied, count,
                nodes && blocked == Reason::kNone ? Reason::kDependsOnWrist : blocked,
                serving.verdicts);
  response->set_unknown_reason(ToMessage(blocked));
  response->set_free(PackedBits(free, count));
  response->set_occupied(PackedBits(occupied, count));
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Policy> PolicyFor(const Serving& serving, const v1::Policy& message,
                                 const ServedDatabase& database) {
  absl::StatusOr<Policy> policy =
      PolicyFrom(message, DefaultPolicy(serving.settings, database), database.views());
  if (!policy.ok()) return policy;
  RETURN_IF_ERROR(database.CanServe(*policy));
  return policy;
}

absl::StatusOr<Checker> CheckerFor(Serving& serving, const v1::Policy& message,
                                   const std::string& variant) {
  const Moment now = serving.settings.clock();
  ASSIGN_OR_RETURN(Served served, WithVariant(serving.scenes.Newest(now), variant));
  ASSIGN_OR_RETURN(const Policy policy, PolicyFor(serving, message, *served.database));
  std::shared_ptr<const ConfigurationSpace> map;
  if (served.scene != nullptr && served.database->robot_images().has_nodes()) {
    map = serving.spaces.Find(served, policy);
  }
  return Checker(std::move(served), policy, serving.settings.scene, now, std::move(map));
}

Reason Conclude(const Serving& serving, const Served& served, const Policy& policy,
                v1::Basis* basis) {
  const Moment now = serving.settings.clock();
  ToMessage(served, policy, now, basis);
  // What has become known of the calibration meanwhile counts, too.
  Served of_now = served;
  of_now.trust = serving.scenes.trust();
  Reason blocked = BlockedReason(of_now, policy, serving.settings.scene, now);
  const auto& database = served.whole != nullptr ? served.whole : served.database;
  if (blocked == Reason::kNone && serving.scenes.database() != database) {
    blocked = Reason::kGenerationMismatch;  // it was replaced meanwhile
  }
  if (blocked == Reason::kNone && serving.scenes.Revoked(*served.regions)) {
    blocked = Reason::kRegionEnded;
  }
  if (blocked == Reason::kNone && serving.scenes.Withdrawn(*served.scene)) {
    blocked = Reason::kVariantUnknown;
  }
  for (const SceneDefect& defect : DefectsOf(of_now, blocked, serving.settings, now)) {
    ToMessage(defect, basis->add_defects());
  }
  ToMessage(blocked == Reason::kNone ? ValidFor(of_now, policy, serving.settings.scene, now)
                                     : absl::ZeroDuration(),
            basis->mutable_valid_for());
  return blocked;
}

Verdict Final(const Verdict& verdict, Reason blocked) {
  return blocked == Reason::kNone ? verdict : Verdict::Unknown(blocked);
}

bool AnsweredAtOnce(const Serving& serving, const v1::CheckConfigurationsRequest& request) {
  if (AsksNothing(request)) return true;
  if (!request.numbers().empty() || request.include_clearance() ||
      request.configurations_size() > kFewChecks) {
    return false;
  }
  const std::shared_ptr<const ServedDatabase> whole = serving.scenes.database();
  const SharedScene scene = serving.scenes.Find(0);
  const bool as_scene = request.variant().empty() && scene != nullptr;
  const ServedDatabase* database = whole->Variant(as_scene ? scene->variant : request.variant());
  if (database == nullptr) return true;
  const RobotImageTable& images = database->robot_images();
  const bool reads = !images.in_memory() && images.drawn() == nullptr;
  if (reads) return false;
  const absl::StatusOr<Policy> policy = PolicyFor(serving, request.policy(), *database);
  if (!policy.ok()) return true;
  if (IsSound(policy->preset)) return false;  // even one may take long
  const bool slow = images.drawn() != nullptr || IsCalibrated(policy->preset);
  return !slow || request.configurations_size() <= kFewSlowChecks;
}

absl::Status Answer(Serving& serving, const v1::CheckConfigurationsRequest& request,
                    const Stop& cancelled, v1::CheckConfigurationsResponse* response) {
  if (AsksNothing(request)) return AnswerNothing(serving, request, response);
  if (!request.numbers().empty()) return AnswerNumbers(serving, request, cancelled, response);
  ASSIGN_OR_RETURN(const Checker checker, CheckerFor(serving, request.policy(), request.variant()));
  const ServedDatabase& database = *checker.served().database;
  ASSIGN_OR_RETURN(const auto configurations,
                   ConfigurationsFrom(request.configurations(), database.grid(), "configurations",
                                      kMaxConfigurations));
  const size_t views = request.omit_evidence() ? 0 : static_cast<size_t>(database.views());
  const std::optional<ClearanceMeter> meter =
      request.include_clearance() ? checker.Clearances() : std::nullopt;
  std::vector<Finding> findings;
  std::vector<std::vector<std::string>> regions;
  std::vector<ViewEvidence> evidence(views * configurations.size());
  const auto evidence_of = [&](size_t i) { return std::span(evidence).subspan(i * views, views); };
  for (size_t i = 0; i < configurations.size(); ++i) {
    if (Stopped(cancelled)) return absl::CancelledError();
    findings.push_back(
        CheckOne(checker, configurations[i], evidence_of(i), meter ? &*meter : nullptr));
    regions.push_back(checker.RegionsAt(configurations[i]));
  }
  const Reason blocked =
      Conclude(serving, checker.served(), checker.policy(), response->mutable_basis());
  for (size_t i = 0; i < findings.size(); ++i) {
    const Verdict verdict = Final(findings[i].verdict, blocked);
    serving.verdicts.Add(verdict);
    ToMessage(verdict, evidence_of(i), regions[i], findings[i].clearance, database,
              response->add_verdicts());
  }
  return absl::OkStatus();
}

namespace {

absl::StatusOr<double> PathResolutionOf(const v1::CheckPathRequest& request) {
  if (!request.has_path_resolution()) return kMotionResolution;
  const double resolution = request.path_resolution();
  if (resolution >= kLeastPathResolution && resolution <= kMostPathResolution) return resolution;
  return FieldError("path_resolution",
                    absl::StrCat("it is ", resolution, " m; state ", kLeastPathResolution, " to ",
                                 kMostPathResolution, " m"));
}

// How many checks the request may take.
int64_t MostChecks(const ServingSettings& settings, const Policy& policy) {
  const bool searches = IsCalibrated(policy.preset) || IsSound(policy.preset);
  return searches ? settings.most_path_searches : settings.most_path_checks;
}

absl::Status TooManyChecks(int64_t most, const PathVerdict& path, bool drawn) {
  return absl::ResourceExhaustedError(absl::StrCat(
      "waypoints: the path takes more than ", most, " checks, as many were made up to waypoint ",
      path.segment, "; split it there", drawn ? ", or state a greater path_resolution" : ""));
}

void ProofToMessage(const ServedDatabase& database, const PathVerdict& path,
                    v1::CheckPathResponse* response) {
  if (database.robot_images().drawn() == nullptr) {
    response->set_proof(v1::PATH_PROOF_GRID);
    return;
  }
  response->set_proof(path.sampled_step > 0 ? v1::PATH_PROOF_SAMPLED : v1::PATH_PROOF_CONTINUOUS);
  response->set_sampled_step(path.sampled_step);
}

// What of a separation holds `passed` later. `blocked`: why nothing does; kNone: it does.
void Conclude(Reason blocked, absl::Duration passed, v1::Separation& separation) {
  if (blocked != Reason::kNone) {
    v1::Separation nothing_known;
    nothing_known.set_range(separation.range());
    nothing_known.set_unknown_reason(ToMessage(blocked));
    separation = nothing_known;
  } else if (separation.has_valid_for()) {
    ToMessage(std::max(absl::ZeroDuration(), DurationFrom(separation.valid_for()) - passed),
              separation.mutable_valid_for());
  }
}

}  // namespace

absl::Status Answer(Serving& serving, const v1::CheckPathRequest& request, const Stop& cancelled,
                    v1::CheckPathResponse* response) {
  ASSIGN_OR_RETURN(const Checker checker, CheckerFor(serving, request.policy(), request.variant()));
  const ServedDatabase& database = *checker.served().database;
  ASSIGN_OR_RETURN(const auto waypoints, ConfigurationsFrom(request.waypoints(), database.grid(),
                                                            "waypoints", kMaxWaypoints));
  if (waypoints.empty()) {
    return FieldError("waypoints", "a path has at least one");
  }
  ASSIGN_OR_RETURN(const double resolution, PathResolutionOf(request));
  std::vector<ViewEvidence> evidence(static_cast<size_t>(database.views()));
  std::set<std::string> touched;
  std::optional<PathClearance> narrowest;
  const int64_t most = MostChecks(serving.settings, checker.policy());
  int64_t checks = 0;
  const auto stop = [&] { return ++checks > most || Stopped(cancelled); };
  const PathVerdict path = checker.CheckPath(waypoints, evidence, &touched,
                                             request.include_clearance() ? &narrowest : nullptr,
                                             {.resolution = resolution, .stop = stop});
  if (path.stopped) {
    if (checks <= most) return absl::CancelledError();
    return TooManyChecks(most, path, database.robot_images().drawn() != nullptr);
  }
  absl::Duration separation_time;
  if (request.has_separation()) {
    ASSIGN_OR_RETURN(separation_time,
                     AnswerSeparation(
                         serving, checker, waypoints, request.separation(),
                         [&] { return Stopped(cancelled); }, response->mutable_separation()));
  }
  const Reason blocked =
      Conclude(serving, checker.served(), checker.policy(), response->mutable_basis());
  if (response->has_separation()) {
    Conclude(blocked, DurationFrom(response->basis().server_clock()) - separation_time,
             *response->mutable_separation());
  }
  const Verdict verdict = Final(path.verdict, blocked);
  serving.verdicts.Add(verdict);
  if (path.verdict.free()) evidence.clear();
  const std::vector<std::string> regions(touched.begin(), touched.end());
  std::optional<double> clearance;
  if (narrowest) clearance = narrowest->pixels();
  ToMessage(verdict, evidence, regions, clearance, database, response->mutable_verdict());
  if (narrowest && verdict.free()) ToMessage(*narrowest, response->mutable_narrowest());
  response->set_segment(path.segment);
  response->set_fraction(path.fraction);
  for (double position : path.configuration) {
    response->mutable_configuration()->add_positions(position);
  }
  response->set_checked(path.checked);
  if (verdict.free()) ProofToMessage(database, path, response);
  return absl::OkStatus();
}

absl::Status Answer(Serving& serving, const v1::ExplainRequest& request,
                    v1::ExplainResponse* response) {
  ASSIGN_OR_RETURN(const Checker checker, CheckerFor(serving, request.policy(), request.variant()));
  const ServedDatabase& database = *checker.served().database;
  ASSIGN_OR_RETURN(const Configuration q,
                   ConfigurationFrom(request.configuration(), database.grid(), "configuration"));
  std::vector<ViewEvidence> evidence(static_cast<size_t>(database.views()));
  const Verdict verdict = CheckOne(checker, q, evidence).verdict;
  ExplainViews(checker, q, response);
  const Reason blocked =
      Conclude(serving, checker.served(), checker.policy(), response->mutable_basis());
  ToMessage(Final(verdict, blocked), evidence, checker.RegionsAt(q), std::nullopt, database,
            response->mutable_verdict());
  return absl::OkStatus();
}

namespace {

// The planes, and in colours of their own the unknown pixels that are ignored and those that
// allowed regions made unknown.
Picture PictureOfView(const Scene& scene, size_t view, const Mask& obstacle, const Mask& unknown,
                      const Mask& error) {
  Picture picture = PictureOfPlanes(obstacle, unknown, error);
  const auto veil = [&](const std::optional<Mask>& pixels, Colour colour) {
    if (pixels) picture = WithVeil(picture, *pixels & unknown, colour, 1);
  };
  veil(scene.views[view]->ignored, palette::kIgnored);
  for (const RegionEffect& effect : scene.region_effects) {
    veil(effect.taken[view], palette::kAllowed);
  }
  return picture;
}

}  // namespace

void ExplainViews(const Checker& checker, std::span<const double> q,
                  v1::ExplainResponse* response) {
  const Served& served = checker.served();
  if (served.scene == nullptr) return;
  const CollisionImages collision = checker.CollisionImagesAt(q);
  const std::optional<std::vector<Mask>> robot = checker.TestRobotImages(q);
  for (int view = 0; view < served.database->views(); ++view) {
    v1::ViewExplanation& explanation = *response->add_views();
    explanation.set_view(served.database->view_name(view));
    const auto i = static_cast<size_t>(view);
    if (!served.scene->views[i]) continue;
    explanation.set_scene_png(EncodePng(PictureOf(served.scene->views[i]->foreground)));
    if (!served.scene->obstacle_images[i]) continue;
    const ObstacleImage& obstacle = *served.scene->obstacle_images[i];
    const Scene& scene = *served.scene;
    explanation.set_obstacle_png(EncodePng(
        PictureOfView(scene, i, obstacle.obstacle(), obstacle.unknown(), obstacle.error())));
    if (!robot) continue;
    ToMessage((*robot)[i], explanation.mutable_robot());
    const IntersectionImage intersection(obstacle, (*robot)[i]);
    explanation.set_intersection_png(EncodePng(PictureOfView(
        scene, i, intersection.obstacle(), intersection.unknown(), intersection.error())));
    if (!collision[i]) continue;
    const Mask none(collision[i]->size());
    explanation.set_collision_png(EncodePng(PictureOfPlanes(*collision[i], none, none)));
  }
}

}  // namespace silhouette
