// SPDX-License-Identifier: Apache-2.0
// Records what a server sends (WatchScenes) into files of a folder: recording-TIME.mcap with all of
// it, stop-TIME.mcap with the time around each stop.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "common/mcap/mcap_rotation.h"
#include "silhouette/v1/database_service.pb.h"
#include "silhouette/v1/scene_service.pb.h"

namespace silhouette {

struct RecorderSettings {
  std::string folder;
  // Of one file, and how many are kept of either kind.
  uint64_t file_bytes = uint64_t{256} << 20;
  int files = 8;
  // Only the time around stops.
  bool only_stops = false;
  // What is kept before and after each stop.
  absl::Duration around_stops = absl::Seconds(30);
};

// An instant by both clocks.
struct RecorderTime {
  absl::Time wall;         // for people, in the files; may be set at any time, in either direction
  absl::Duration running;  // for order and age: since some fixed instant; never steps
};

// A watched path was free and is not any more.
struct RecordedStop {
  absl::Time time;
  v1::WatchedPath path;
};

// Of one generation of a database. Not thread-safe. Errors are of the disk: what was not written is
// written later, as McapRotation says.
class Recorder {
 public:
  // Throws std::invalid_argument for settings that cannot be.
  Recorder(const RecorderSettings& settings, v1::GetDatabaseResponse database);

  const v1::GetDatabaseResponse& database() const { return database_; }
  // From `now` on. `database`: of the same generation; what may have changed is the check of the
  // calibration.
  void Update(v1::GetDatabaseResponse database, const RecorderTime& now);

  // Adds a message that arrived at `now`, and returns the stops in it. If the wall clock was set
  // back, new files begin: the times of a file never step back. The time around a stop is kept
  // whatever the wall clock does.
  std::vector<RecordedStop> Take(const v1::WatchScenesResponse& news, const RecorderTime& now);
  // The server is lost: from `now` on nothing is known, and no path is watched. A server that comes
  // back counts scenes and paths from 1 again.
  void Lose(const RecorderTime& now);

  // Writes to the disk what was added; an error of Take(), too, comes from here. To be called once
  // a second.
  absl::Status Flush();
  // Ends the files.
  absl::Status Close();

  uint64_t scenes() const { return scenes_; }
  // Scenes that the server no longer had when it could have sent them.
  uint64_t missed_scenes() const { return missed_scenes_; }
  // Messages that the disk took too late.
  uint64_t lost() const { return all_.lost() + stops_.files().lost(); }
  // Messages that the disk has not taken yet: after a last Close() that failed, they are lost.
  uint64_t unwritten() const { return all_.unwritten() + stops_.files().unwritten(); }
  // The newest files of which the disk has something; empty: none yet.
  const std::string& path() const { return all_.path(); }
  const std::string& stop_path() const { return stops_.files().path(); }
  // Whether stop_path() has all that is to be kept of stops by now.
  bool stops_are_written() const { return stops_.files().unwritten() == 0; }

 private:
  // Sets now_.
  void Advance(const RecorderTime& now);
  void Add(uint16_t channel, absl::Time published, std::string data);
  void AddState();
  void AddImages(const v1::WatchScenesResponse& news);

  v1::GetDatabaseResponse database_;
  const bool only_stops_;
  McapRotation all_;
  EventExcerpts stops_;
  RecorderTime now_ = {.wall = absl::UnixEpoch(), .running = {}};
  std::optional<v1::ServedState> state_;
  absl::Duration state_added_ = -absl::InfiniteDuration();  // running
  std::map<uint64_t, bool> free_;                           // watched paths, by id
  uint64_t last_scene_ = 0;
  uint64_t scenes_ = 0;
  uint64_t missed_scenes_ = 0;
  absl::Status fault_;  // the first since the last Flush
};

// The time of a message.
absl::Time WallTimeOf(const google::protobuf::Timestamp& time);

}  // namespace silhouette
