// SPDX-License-Identifier: Apache-2.0
#include "common/recording/recording.h"

#include <algorithm>
#include <utility>

#include "absl/memory/memory.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/time.h"
#include "common/recording/channels.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr char kCameraTopic[] = "/camera/";
// A picture that is recorded so much before a scene still shows it.
constexpr absl::Duration kPictureBefore = absl::Milliseconds(300);

std::string TimeText(absl::Time time) {
  return absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ", time, absl::UTCTimeZone());
}

bool IsFree(const v1::WatchedPath& path) {
  return path.answer().check().verdict().state() == v1::Verdict::STATE_FREE;
}

}  // namespace

absl::StatusOr<std::unique_ptr<Recording>> Recording::Open(const std::string& path) {
  ASSIGN_OR_RETURN(auto reader, McapReader::Open(path));
  auto recording = absl::WrapUnique(new Recording(path, std::move(reader)));
  while (true) {
    ASSIGN_OR_RETURN(const auto message, recording->reader_->Next());
    if (!message) break;
    RETURN_IF_ERROR(recording->Take(*message));
  }
  RecordingSummary& summary = recording->summary_;
  summary.cut = recording->reader_->cut();
  if (recording->reader_->Damage().empty()) recording->gaps_.clear();
  if (recording->reader_->damaged_at_end()) {
    recording->gaps_.emplace_back(summary.end, absl::InfiniteFuture());
  }
  summary.damage = recording->DamageText();
  if (summary.empty() && !summary.damage.empty()) return absl::DataLossError(summary.damage);
  if (summary.empty() && recording->others_) {
    return InvalidArgument(path, ": it is no recording of silhouette-record: no message is of one");
  }
  if (!recording->databases_.empty()) {
    const v1::GetDatabaseResponse& database = recording->databases_.front().second;
    summary.cell = database.cell_name();
    summary.cell_digest = database.cell_digest();
    summary.generation = database.generation();
  }
  return recording;
}

std::string Recording::DamageText() const {
  const std::string damage = reader_->Damage();
  if (damage.empty()) {
    // A writer begins a file with its first message, and writes at least once a second.
    return summary_.empty() && summary_.cut && !others_
               ? absl::StrCat(path_, " is cut: it has no message and no end")
               : "";
  }
  std::vector<std::string> lost;
  for (const auto& [before, after] : gaps_) {
    const bool first = before == absl::InfinitePast();
    const bool last = after == absl::InfiniteFuture();
    lost.push_back(
        first && last ? "all of it"
        : first       ? absl::StrCat("what was before ", TimeText(after))
        : last        ? absl::StrCat("what came after ", TimeText(before))
               : absl::StrCat("what was between ", TimeText(before), " and ", TimeText(after)));
  }
  constexpr size_t kNamed = 3;
  const size_t more = lost.size() > kNamed ? lost.size() - kNamed : 0;
  lost.resize(lost.size() - more);
  return absl::StrCat(path_, " ", damage, ": lost is ", absl::StrJoin(lost, ", and "),
                      more > 0 ? absl::StrCat(", and ", more, " further parts") : "");
}

absl::Status Recording::Take(const McapReader::Message& message) {
  const std::string& type = message.channel->schema_name;
  const std::string& topic = message.channel->topic;
  // Times of a file do not step back; those of a damaged clock are those of the message before.
  absl::Time time = std::max(message.logged, summary_.end);
  const bool standing =
      type == "silhouette.v1.ServedState" || type == "silhouette.v1.GetDatabaseResponse";
  // A scene, and the state and database written before it, are in a later millisecond than the
  // scene before.
  if ((standing || type == "silhouette.v1.Scene") && !scenes_.empty()) {
    time = std::max(time, scenes_.back().time + absl::Milliseconds(1));
  }
  if (message.after_damage) gaps_.emplace_back(summary_.end, time);
  const Entry entry{.time = time, .place = message.place, .gaps = gaps_.size()};
  if (type == "silhouette.v1.GetDatabaseResponse") {
    if (message.data != database_) {
      databases_.emplace_back(entry.time, v1::GetDatabaseResponse());
      RETURN_IF_ERROR(Parse(message, databases_.back().second));
      database_ = message.data;
    }
  } else if (type == "silhouette.v1.ServedState") {
    states_.push_back(entry);
  } else if (type == "silhouette.v1.Scene") {
    scenes_.push_back(entry);
    summary_.scenes.push_back(entry.time);
  } else if (type == "silhouette.v1.WatchedPath") {
    RETURN_IF_ERROR(TakePath(message, entry));
  } else if (topic.starts_with(kCameraTopic)) {
    pictures_[topic.substr(sizeof(kCameraTopic) - 1)].push_back(entry);
  } else {
    others_ = true;
    return absl::OkStatus();
  }
  summary_.start = std::min(summary_.start, entry.time);
  summary_.end = entry.time;
  return absl::OkStatus();
}

absl::Status Recording::TakePath(const McapReader::Message& message, const Entry& entry) {
  v1::WatchedPath path;
  RETURN_IF_ERROR(Parse(message, path));
  const auto [watched, is_new] = watched_.try_emplace(path.id(), paths_.size());
  if (path.ended()) {
    if (!is_new) paths_[watched->second].ended = entry.time;
    watched_.erase(watched);
    free_.erase(path.id());
    return absl::OkStatus();
  }
  if (is_new) paths_.emplace_back();
  paths_[watched->second].answers.push_back(entry);
  if (std::exchange(free_[path.id()], IsFree(path)) && !IsFree(path)) {
    summary_.stops.push_back({.time = entry.time, .path = std::move(path)});
  }
  return absl::OkStatus();
}

absl::Status Recording::Parse(const McapReader::Message& from,
                              google::protobuf::Message& message) const {
  if (message.ParseFromString(from.data)) return absl::OkStatus();
  return absl::DataLossError(
      absl::StrCat(path_, ": a message of the topic ", from.channel->topic, " cannot be parsed"));
}

absl::Status Recording::Read(const Entry& entry, google::protobuf::Message& message) {
  ASSIGN_OR_RETURN(const McapReader::Message from, reader_->Read(entry.place));
  return Parse(from, message);
}

const Recording::Entry* Recording::Newest(const std::vector<Entry>& entries,
                                          absl::Time time) const {
  const auto after = std::ranges::upper_bound(entries, time, {}, &Entry::time);
  if (after == entries.begin()) return nullptr;
  const Entry& newest = *std::prev(after);
  const auto begun = std::ranges::lower_bound(gaps_, time, {}, &Gap::first) - gaps_.begin();
  return newest.gaps < static_cast<size_t>(begun) ? nullptr : &newest;
}

absl::StatusOr<RecordedMoment> Recording::At(absl::Time time, absl::Duration longest) {
  if (time < summary_.start || time > summary_.end) {
    return absl::OutOfRangeError(absl::StrCat(path_, " has nothing of that moment; 'silhouette ",
                                              "replay ", path_, "' shows from when to when it is"));
  }
  RecordedMoment moment;
  for (const auto& [from, database] : databases_) {
    if (from <= time) moment.database = database;
  }
  if (const Entry* state = Newest(states_, time)) {
    RETURN_IF_ERROR(Read(*state, moment.state.emplace()));
  }
  for (const PathEntries& path : paths_) {
    const Entry* answer = Newest(path.answers, time);
    if (answer == nullptr || (path.ended && *path.ended <= time)) continue;
    RecordedPath& recorded = moment.paths.emplace_back();
    recorded.time = answer->time;
    RETURN_IF_ERROR(Read(*answer, recorded.path));
  }
  const Entry* scene = Newest(scenes_, time);
  if (scene == nullptr || time - scene->time > longest) return moment;
  moment.scene_time = scene->time;
  RETURN_IF_ERROR(Read(*scene, moment.scene.emplace()));
  for (const auto& [view, pictures] : pictures_) {
    const Entry* picture = Newest(pictures, time);
    if (picture == nullptr || picture->time < scene->time - kPictureBefore) continue;
    ASSIGN_OR_RETURN(const McapReader::Message message, reader_->Read(picture->place));
    ASSIGN_OR_RETURN(moment.pictures[view], JpegOfCompressedImage(message.data));
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
