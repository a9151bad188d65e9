// SPDX-License-Identifier: Apache-2.0
#include "tools/recording/recording.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

template <typename Message>
absl::StatusOr<std::optional<Recorded>> Parsed(const McapReader::Message& message) {
  Message parsed;
  if (!parsed.ParseFromString(message.data)) {
    return absl::DataLossError(
        absl::StrCat("a message of the topic ", message.channel->topic, " cannot be parsed"));
  }
  return Recorded{.time = message.logged, .message = std::move(parsed)};
}

bool IsFree(const v1::WatchedPath& path) {
  return path.answer().check().verdict().state() == v1::Verdict::STATE_FREE;
}

}  // namespace

absl::StatusOr<Recording> Recording::Open(const std::string& path) {
  ASSIGN_OR_RETURN(auto reader, McapReader::Open(path));
  return Recording(std::move(reader));
}

absl::StatusOr<std::optional<Recorded>> Recording::Next() {
  while (true) {
    ASSIGN_OR_RETURN(const std::optional<McapReader::Message> message, reader_->Next());
    if (!message) return std::nullopt;
    const std::string& type = message->channel->schema_name;
    if (type == "silhouette.v1.GetDatabaseResponse") {
      return Parsed<v1::GetDatabaseResponse>(*message);
    }
    if (type == "silhouette.v1.ServedState") return Parsed<v1::ServedState>(*message);
    if (type == "silhouette.v1.Scene") return Parsed<v1::Scene>(*message);
    if (type == "silhouette.v1.WatchedPath") return Parsed<v1::WatchedPath>(*message);
  }
}

void RecordedMoment::Take(const Recorded& recorded) {
  if (const auto* its_database = std::get_if<v1::GetDatabaseResponse>(&recorded.message)) {
    database = *its_database;
  } else if (const auto* its_state = std::get_if<v1::ServedState>(&recorded.message)) {
    state = *its_state;
  } else if (const auto* its_scene = std::get_if<v1::Scene>(&recorded.message)) {
    scene = *its_scene;
  } else if (const auto* path = std::get_if<v1::WatchedPath>(&recorded.message)) {
    paths.erase(path->id());
    if (!path->ended()) paths.emplace(path->id(), *path);
  }
}

absl::StatusOr<RecordingSummary> SummaryOf(const std::string& path) {
  ASSIGN_OR_RETURN(Recording recording, Recording::Open(path));
  RecordingSummary summary;
  RecordedMoment moment;
  while (true) {
    ASSIGN_OR_RETURN(const std::optional<Recorded> recorded, recording.Next());
    if (!recorded) break;
    summary.start = std::min(summary.start, recorded->time);
    summary.end = std::max(summary.end, recorded->time);
    if (std::holds_alternative<v1::Scene>(recorded->message)) ++summary.scenes;
    if (const auto* watched = std::get_if<v1::WatchedPath>(&recorded->message)) {
      const auto before = moment.paths.find(watched->id());
      if (before != moment.paths.end() && IsFree(before->second) && !watched->ended() &&
          !IsFree(*watched)) {
        summary.stops.push_back({.time = recorded->time, .path = *watched});
      }
    }
    moment.Take(*recorded);
  }
  summary.cell = moment.database.cell_name();
  summary.cut = recording.cut();
  return summary;
}

absl::StatusOr<RecordedMoment> MomentAt(const std::string& path, absl::Time time) {
  ASSIGN_OR_RETURN(Recording recording, Recording::Open(path));
  RecordedMoment moment;
  absl::Time last = absl::InfinitePast();
  bool ended = false;
  while (!ended) {
    ASSIGN_OR_RETURN(const std::optional<Recorded> recorded, recording.Next());
    ended = !recorded;
    if (ended) break;
    if (recorded->time > time) break;
    last = recorded->time;
    moment.Take(*recorded);
  }
  if (!moment.scene || (ended && time > last)) {
    return absl::OutOfRangeError(absl::StrCat(path,
                                              " has no scene of that moment; 'silhouette replay ",
                                              path, "' shows from when to when it is"));
  }
  return moment;
}

v1::PublishSceneRequest RequestOf(const v1::Scene& scene) {
  v1::PublishSceneRequest request;
  request.set_variant(scene.variant());
  if (scene.defects().empty()) *request.mutable_joints() = scene.joints();
  for (const v1::SceneView& seen : scene.views()) {
    v1::ViewImage& view = *request.add_views();
    view.set_view(seen.view());
    *(seen.separates_robot() ? view.mutable_obstacle_mask() : view.mutable_scene_mask()) =
        seen.scene();
    if (seen.has_strong()) *view.mutable_strong_mask() = seen.strong();
  }
  return request;
}

}  // namespace silhouette
