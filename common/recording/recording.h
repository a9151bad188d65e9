// SPDX-License-Identifier: Apache-2.0
// Reads what a Recorder wrote: what was known at each of its moments.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/mcap/mcap_reader.h"
#include "common/recording/recorder.h"
#include "silhouette/v1/database_service.pb.h"
#include "silhouette/v1/scene_service.pb.h"

namespace silhouette {

// What a recording is about.
struct RecordingSummary {
  std::string cell;
  uint64_t cell_digest = 0;  // as in v1::Basis; 0: not recorded
  uint64_t generation = 0;   // of the database
  absl::Time start = absl::InfiniteFuture();
  absl::Time end = absl::InfinitePast();
  std::vector<absl::Time> scenes;  // when each was recorded, ascending
  std::vector<RecordedStop> stops;
  bool cut = false;  // as McapReader::cut
  // What is lost, one sentence that names the file; empty: nothing, as far as the file shows.
  std::string damage;

  bool empty() const { return end < start; }
};

// The newest answer to a client that watched a path.
struct RecordedPath {
  absl::Time time;  // when it was recorded
  v1::WatchedPath path;
};

// What was known at a moment, as far as the recording has it.
struct RecordedMoment {
  v1::GetDatabaseResponse database;
  // What held beside the scene; nothing: the recording does not say.
  std::optional<v1::ServedState> state;
  // Nothing: no scene is recorded that held then.
  std::optional<v1::Scene> scene;
  absl::Time scene_time;  // when the scene was recorded
  std::vector<RecordedPath> paths;
  std::map<std::string, std::string> pictures;  // JPEG by view, of the time of the scene
};

// One file. Not thread-safe.
class Recording {
 public:
  // Reads the file from its beginning to its end, and keeps where each message is. What is damaged
  // is left out. Errors: those of McapReader; DataLoss: nothing of it can be read;
  // InvalidArgument: it is a file of another program.
  static absl::StatusOr<std::unique_ptr<Recording>> Open(const std::string& path);

  const RecordingSummary& summary() const { return summary_; }

  // The moment `time`. A scene holds until the next one, for `longest` after it was recorded; then
  // there is a gap, and the moment has no scene. Nothing from before a damaged place holds after it
  // begins: what came there may have ended it. OutOfRange: it is before the start or after the
  // end. DataLoss: the file was changed since it was opened.
  absl::StatusOr<RecordedMoment> At(absl::Time time, absl::Duration longest);

 private:
  struct Entry {
    absl::Time time;
    McapReader::Place place;
    size_t gaps = 0;  // that are before it
  };
  using Gap = std::pair<absl::Time, absl::Time>;
  struct PathEntries {
    std::vector<Entry> answers;
    std::optional<absl::Time> ended;
  };

  Recording(std::string path, std::unique_ptr<McapReader> reader)
      : path_(std::move(path)), reader_(std::move(reader)) {}
  absl::Status Take(const McapReader::Message& message);
  absl::Status TakePath(const McapReader::Message& message, const Entry& entry);
  absl::Status Read(const Entry& entry, google::protobuf::Message& message);
  absl::Status Parse(const McapReader::Message& from, google::protobuf::Message& message) const;
  // The newest that is not after `time` and holds then; null: there is none.
  const Entry* Newest(const std::vector<Entry>& entries, absl::Time time) const;
  std::string DamageText() const;

  const std::string path_;
  const std::unique_ptr<McapReader> reader_;
  RecordingSummary summary_;
  // Damaged places: the times of the messages before and after them, or infinite.
  std::vector<Gap> gaps_;
  bool others_ = false;  // there are messages that are not of a Recorder
  std::vector<std::pair<absl::Time, v1::GetDatabaseResponse>> databases_;  // each another
  std::string database_;  // the last of them, serialized
  std::vector<Entry> scenes_;
  std::vector<Entry> states_;
  // A client that watches again has a new entry: ids are unique only in the life of a server.
  std::vector<PathEntries> paths_;
  std::map<uint64_t, size_t> watched_;  // places in paths_, by id, of those that have not ended
  std::map<uint64_t, bool> free_;       // by id: the newest answer
  std::map<std::string, std::vector<Entry>> pictures_;  // by view
};

// Publishes the scene again as it was seen: its masks, joint values and variant. Capture times are
// left out. A scene that had defects goes without joint values, so that nothing is free by it:
// masks alone do not show all of them.
v1::PublishSceneRequest RequestOf(const v1::Scene& scene);

}  // namespace silhouette
