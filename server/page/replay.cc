// SPDX-License-Identifier: Apache-2.0
#include "server/page/replay.h"

#include <algorithm>
#include <exception>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "absl/memory/memory.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "server/scene/make_scene.h"
#include "server/service/messages.h"
#include "server/service/serving.h"

namespace silhouette {
namespace {

using nlohmann::json;

constexpr char kNoScene[] = "no scene is recorded at this time";

int64_t MillisOf(absl::Time time) {
  return absl::ToUnixMillis(time + absl::Milliseconds(1) - absl::Nanoseconds(1));
}

// The wall clock of the recorder orders everything.
Moment MomentAt(absl::Time time) { return {time, time - absl::UnixEpoch()}; }

// A defect never stops to be one because its reason is of a newer server.
Reason RecordedReason(v1::Verdict::Reason reason) {
  return reason > static_cast<int>(Reason::kNone) &&
                 reason <= static_cast<int>(Reason::kRobotImageSuspect)
             ? static_cast<Reason>(reason)
             : Reason::kInternal;
}

void AddDefect(const v1::SceneDefect& recorded, std::vector<SceneDefect>& defects) {
  if (std::ranges::find(defects, recorded.message(), &SceneDefect::message) != defects.end())
    return;
  defects.push_back({RecordedReason(recorded.reason()), recorded.message()});
}

// Why nothing was known then; those of the scene first.
std::vector<SceneDefect> DefectsOf(const RecordedMoment& moment) {
  std::vector<SceneDefect> defects;
  if (moment.scene) {
    for (const v1::SceneDefect& defect : moment.scene->defects()) AddDefect(defect, defects);
  }
  if (!moment.state || moment.state->unknown_reason() == v1::Verdict::REASON_UNSPECIFIED) {
    return defects;
  }
  for (const v1::SceneDefect& defect : moment.state->defects()) AddDefect(defect, defects);
  const Reason reason = RecordedReason(moment.state->unknown_reason());
  if (std::ranges::find(defects, reason, &SceneDefect::reason) == defects.end()) {
    defects.push_back({reason, absl::StrCat("the server said: ", NameOf(reason))});
  }
  return defects;
}

// The scene as the recording has it, with the defects that it had. Its age at its arrival is that
// of the time stamps, if the clocks of server and recorder agree.
absl::StatusOr<Scene> SceneOf(const RecordedMoment& moment, const ServedDatabase& database,
                              const ServingSettings& settings) {
  const v1::Scene& recorded = *moment.scene;
  Moment arrived = MomentAt(moment.scene_time);
  const absl::Duration lag = arrived.time - WallTimeOf(recorded.time());
  if (lag < absl::ZeroDuration() || lag > settings.scene.max_age) {
    arrived.time = WallTimeOf(recorded.time()) + DurationFrom(recorded.skew());
  }
  v1::PublishSceneRequest request = RequestOf(recorded);
  *request.mutable_joints() = recorded.joints();
  for (int view = 0; view < request.views_size(); ++view) {
    *request.mutable_views(view)->mutable_capture_time() = recorded.views(view).capture_time();
  }
  ASSIGN_OR_RETURN(SceneInput input, SceneInputFrom(request, settings.scene, arrived));
  if (input.joints.empty()) input.without_joints = "it is not recorded";
  if (recorded.variant().empty()) input.without_variant = "the variant is not recorded";
  if (input.views.empty()) input.without_views.emplace("", "");
  const std::vector<SceneDefect> defects = DefectsOf(moment);
  ASSIGN_OR_RETURN(Scene scene,
                   MakeScene(database, input, settings.scene, settings.segmentation, arrived));
  std::vector<SceneDefect> all = defects;
  for (SceneDefect& defect : scene.defects) {
    if (std::ranges::find(defects, defect.reason, &SceneDefect::reason) == defects.end()) {
      all.push_back(std::move(defect));
    }
  }
  scene.defects = std::move(all);
  return scene;
}

// Allows the regions of then, with the time that was left at the moment of the clock.
absl::Status AllowRegions(const v1::ServedState& state, const Moment& now, Serving& serving) {
  const std::shared_ptr<const ServedDatabase> database = serving.scenes.database();
  for (const v1::AllowedRegion& region : state.regions()) {
    const absl::Duration left = WallTimeOf(region.end_time()) - now.time;
    if (left <= absl::ZeroDuration()) continue;
    v1::AllowRegionRequest request;
    *request.mutable_views() = region.views();
    ASSIGN_OR_RETURN(auto pixels, RegionPixelsFrom(request, *database));
    RETURN_IF_ERROR(serving.scenes
                        .Allow(region.name(), std::move(pixels),
                               std::min(left, AllowedRegions::kLongest), now, database)
                        .status());
  }
  return absl::OkStatus();
}

}  // namespace

Replay::Replay(std::unique_ptr<Recording> recording, std::shared_ptr<const ServedDatabase> database,
               ServingSettings settings)
    : database_(std::move(database)),
      settings_(std::move(settings)),
      recording_(std::move(recording)) {}

absl::StatusOr<std::unique_ptr<Replay>> Replay::Open(const std::string& path,
                                                     std::shared_ptr<const ServedDatabase> database,
                                                     const ServingSettings& settings) {
  ASSIGN_OR_RETURN(auto recording, Recording::Open(path));
  const RecordingSummary& summary = recording->summary();
  if (summary.empty()) return FailedPrecondition(path, ": nothing is recorded");
  v1::GetDatabaseResponse served;
  const Policy policy = DefaultPolicy(settings, *database);
  ToMessage(*database, settings, &served);
  if (summary.cell.empty()) {
    return FailedPrecondition(path, ": the part that says of which cell it is, is lost");
  }
  if (summary.cell != served.cell_name()) {
    return FailedPrecondition(path, ": the recording is of the cell '", summary.cell,
                              "', and the cell file is of '", served.cell_name(), "'");
  }
  if (summary.cell_digest != 0 && summary.cell_digest != database->cell_digest()) {
    return FailedPrecondition(path, ": the recording is of another cell or grid of the name '",
                              summary.cell,
                              "' than the database; give the database that was served then");
  }
  RETURN_IF_ERROR(database->CanServe(policy));
  ServingSettings frozen;
  frozen.policy = policy;
  frozen.scene = settings.scene;
  frozen.segmentation = settings.segmentation;
  frozen.joint_slides = settings.joint_slides;
  frozen.map_time = absl::ZeroDuration();
  frozen.index_check = {.rate = 0, .samples = 0};
  frozen.worker_threads = 1;
  return absl::WrapUnique(new Replay(std::move(recording), std::move(database), std::move(frozen)));
}

json Replay::TimeLine() const {
  const RecordingSummary& recorded = summary();
  json scenes = json::array();  // from when to when there are some
  absl::Time end = absl::InfinitePast();
  for (const absl::Time time : recorded.scenes) {
    if (time > end) scenes.push_back({MillisOf(time), nullptr});
    end = time + settings_.scene.max_age;
    scenes.back()[1] = MillisOf(std::min(end, recorded.end));
  }
  json stops = json::array();
  for (const RecordedStop& stop : recorded.stops) {
    const v1::Verdict& verdict = stop.path.answer().check().verdict();
    const bool occupied = verdict.state() == v1::Verdict::STATE_OCCUPIED;
    stops.push_back({{"time", MillisOf(stop.time)},
                     {"client", stop.path.client()},
                     {"state", occupied ? NameOf(State::kOccupied) : NameOf(State::kUnknown)},
                     {"reason", occupied ? "" : NameOf(RecordedReason(verdict.reason()))}});
  }
  return {{"start", MillisOf(recorded.start)},
          {"end", MillisOf(recorded.end)},
          {"scenes", std::move(scenes)},
          {"stops", std::move(stops)},
          {"cut", recorded.cut},
          {"damage", recorded.damage},
          {"other_database", recorded.generation != database_->generation()}};
}

json Replay::PlaceOf(int64_t time, bool scene) const {
  const std::vector<absl::Time>& scenes = summary().scenes;
  const auto next = std::ranges::upper_bound(scenes, time, {}, MillisOf);
  auto shown = next;
  if (shown != scenes.begin() && scene) --shown;
  return {{"time", time},
          {"previous", shown == scenes.begin() ? json() : json(MillisOf(*std::prev(shown)))},
          {"next", next == scenes.end() ? json() : json(MillisOf(*next))}};
}

absl::StatusOr<RecordedMoment> Replay::MomentOf(absl::Time time) const {
  const std::lock_guard lock(mutex_);
  return recording_->At(time, settings_.scene.max_age);
}

absl::StatusOr<json> Replay::Show(absl::Time time, RecordedMoment moment,
                                  const SliceChoice& choice) const {
  const Moment now = MomentAt(time);
  ServingSettings settings = settings_;
  settings.clock = [now] { return now; };
  if (moment.database.has_calibration_check() && !moment.database.calibration_check().holds()) {
    settings.trust = std::make_shared<const CalibrationTrust>(
        CalibrationTrust{.holds = false,
                         .fingerprint = "",
                         .until = absl::InfiniteDuration(),
                         .message = moment.database.calibration_check().message()});
  }
  Serving serving(database_, std::move(settings));
  if (!moment.state) moment.scene.reset();  // what holds beside it is not known
  if (moment.scene) {
    ASSIGN_OR_RETURN(Scene scene, SceneOf(moment, *database_, settings_));
    RETURN_IF_ERROR(serving.scenes.Publish(std::move(scene), database_).status());
  }
  if (moment.state) RETURN_IF_ERROR(AllowRegions(*moment.state, now, serving));
  std::vector<std::shared_ptr<WatchedPath>> paths;
  for (const RecordedPath& path : moment.paths) {
    paths.push_back(serving.watched_paths.Add(path.path.client(), path.path.request()));
    paths.back()->Note(path.path.answer(), MomentAt(path.time).running);
  }
  json shown = PageSnapshot(serving, choice);
  if (shown.contains("error")) return shown;
  if (!moment.scene) {
    json& defects = shown["basis"]["defects"] = json::array({{{"message", kNoScene}}});
    for (const SceneDefect& defect : DefectsOf(moment)) {
      defects.push_back({{"message", defect.message}});
    }
    return shown;
  }
  const std::string id = absl::StrCat(moment.scene->id());  // as JSON of the API has it
  shown["scene"]["id"] = shown["basis"]["scene_id"] = id;
  for (const auto& [view, jpeg] : moment.pictures) {
    json& views = shown["views"];
    if (views.contains(view)) views[view]["image"] = absl::Base64Escape(jpeg);
  }
  return shown;
}

json Replay::At(int64_t time, const SliceChoice& choice) const {
  const int64_t bounded = std::clamp(time, MillisOf(summary().start), MillisOf(summary().end));
  const absl::Time exact = std::min(absl::FromUnixMillis(bounded), summary().end);
  bool scene = true;  // of a moment that cannot be read: the way back must not lead to it again
  json shown;
  try {
    absl::StatusOr<RecordedMoment> moment = MomentOf(exact);
    if (moment.ok()) scene = moment->scene.has_value();
    absl::StatusOr<json> made =
        moment.ok() ? Show(exact, *std::move(moment), choice) : moment.status();
    shown = made.ok() ? *std::move(made) : json{{"error", std::string(made.status().message())}};
  } catch (const std::exception& error) {
    shown = {{"error", absl::StrCat("internal error: ", error.what())}};
  }
  shown["replay"] = PlaceOf(bounded, scene);
  return shown;
}

}  // namespace silhouette
