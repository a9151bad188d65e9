// SPDX-License-Identifier: Apache-2.0
#include "common/recording/recorder.h"

#include <algorithm>
#include <utility>

#include "common/recording/channels.h"

namespace silhouette {
namespace {

constexpr absl::Duration kBetweenStates = absl::Seconds(5);
// The clock may be slewed back by so much; a step is longer.
constexpr absl::Duration kJitter = absl::Milliseconds(500);

McapRotationSettings RotationOf(const RecorderSettings& settings, const std::string& prefix) {
  return {.folder = settings.folder,
          .prefix = prefix,
          .file_bytes = settings.file_bytes,
          .files = settings.files,
          .standing = {kDatabaseChannel, kStateChannel, kPathChannel}};
}

}  // namespace

absl::Time WallTimeOf(const google::protobuf::Timestamp& time) {
  return absl::FromUnixSeconds(time.seconds()) + absl::Nanoseconds(time.nanos());
}

Recorder::Recorder(const RecorderSettings& settings, v1::GetDatabaseResponse database)
    : database_(std::move(database)),
      only_stops_(settings.only_stops),
      all_(RotationOf(settings, "recording"), ChannelsOf(database_),
           [this] {
             std::vector<McapMessage> opening = {{.channel = kDatabaseChannel,
                                                  .logged = now_.wall,
                                                  .published = now_.wall,
                                                  .data = database_.SerializeAsString()}};
             if (state_) {
               opening.push_back({.channel = kStateChannel,
                                  .logged = now_.wall,
                                  .published = now_.wall,
                                  .data = state_->SerializeAsString()});
             }
             return opening;
           }),
      stops_(
          McapRotation(RotationOf(settings, "stop"), ChannelsOf(database_),
                       [this] {
                         return std::vector<McapMessage>{{.channel = kDatabaseChannel,
                                                          .logged = now_.wall,
                                                          .published = now_.wall,
                                                          .data = database_.SerializeAsString()}};
                       }),
          settings.around_stops, settings.around_stops, kStateChannel) {}

void Recorder::Advance(const RecorderTime& now) {
  if (now.wall < now_.wall - kJitter) {
    now_.wall = now.wall;
    state_added_ = -absl::InfiniteDuration();  // the files that now begin say what holds
  }
  now_ = {.wall = std::max(now_.wall, now.wall), .running = now.running};
}

void Recorder::Add(uint16_t channel, absl::Time published, std::string data) {
  const McapMessage message{
      .channel = channel, .logged = now_.wall, .published = published, .data = std::move(data)};
  if (!only_stops_) fault_.Update(all_.Add(message));
  fault_.Update(stops_.Add(message, now_.running));
}

void Recorder::AddState() {
  if (!state_) return;
  state_added_ = now_.running;
  Add(kDatabaseChannel, now_.wall, database_.SerializeAsString());
  Add(kStateChannel, now_.wall, state_->SerializeAsString());
}

void Recorder::AddImages(const v1::WatchScenesResponse& news) {
  for (const v1::CameraPicture& picture : news.images()) {
    const auto view = std::ranges::find(database_.views(), picture.view(), &v1::View::name);
    if (view == database_.views().end()) continue;
    const auto place = static_cast<uint16_t>(view - database_.views().begin());
    Add(static_cast<uint16_t>(kFirstCameraChannel + place), now_.wall,
        CompressedImageOf(picture.jpeg(), now_.wall));
  }
}

void Recorder::Update(v1::GetDatabaseResponse database, const RecorderTime& now) {
  const std::string before = database_.calibration_check().SerializeAsString();
  database_ = std::move(database);
  if (database_.calibration_check().SerializeAsString() == before) return;
  Advance(now);
  Add(kDatabaseChannel, now_.wall, database_.SerializeAsString());
}

std::vector<RecordedStop> Recorder::Take(const v1::WatchScenesResponse& news,
                                         const RecorderTime& now) {
  Advance(now);
  if (news.has_state()) {
    state_ = news.state();
    AddState();
  } else if (now_.running - state_added_ >= kBetweenStates) {
    AddState();
  }
  if (news.has_scene()) {
    const uint64_t id = news.scene().id();
    if (last_scene_ != 0 && id > last_scene_ + 1) missed_scenes_ += id - last_scene_ - 1;
    last_scene_ = id;
    ++scenes_;
    Add(kSceneChannel, WallTimeOf(news.scene().time()), news.scene().SerializeAsString());
  }
  AddImages(news);
  std::vector<RecordedStop> stops;
  for (const v1::WatchedPath& path : news.paths()) {
    Add(kPathChannel, now_.wall, path.SerializeAsString());
    if (path.ended()) {
      free_.erase(path.id());
      continue;
    }
    const bool is_free = path.answer().check().verdict().state() == v1::Verdict::STATE_FREE;
    if (std::exchange(free_[path.id()], is_free) && !is_free) {
      stops.push_back({.time = now_.wall, .path = path});
    }
  }
  if (!stops.empty()) fault_.Update(stops_.Keep(now_.running));
  return stops;
}

void Recorder::Lose(const RecorderTime& now) {
  Advance(now);
  state_.emplace().set_database_generation(database_.generation());
  state_->set_unknown_reason(v1::Verdict::REASON_NO_SCENE);
  v1::SceneDefect& lost = *state_->add_defects();
  lost.set_reason(v1::Verdict::REASON_NO_SCENE);
  lost.set_message("the recorder lost the server: what it said is not recorded");
  AddState();
  state_.reset();
  for (const auto& [id, is_free] : std::exchange(free_, {})) {
    v1::WatchedPath path;
    path.set_id(id);
    path.set_ended(true);
    Add(kPathChannel, now_.wall, path.SerializeAsString());
  }
}

absl::Status Recorder::Flush() {
  absl::Status fault = std::exchange(fault_, absl::OkStatus());
  fault.Update(all_.Flush());
  fault.Update(stops_.Flush());
  return fault;
}

absl::Status Recorder::Close() {
  absl::Status fault = std::exchange(fault_, absl::OkStatus());
  fault.Update(all_.Close());
  fault.Update(stops_.Close());
  return fault;
}

}  // namespace silhouette
