// SPDX-License-Identifier: Apache-2.0
// Reads what a Recorder wrote.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/mcap/mcap_reader.h"
#include "silhouette/v1/database_service.pb.h"
#include "silhouette/v1/scene_service.pb.h"
#include "tools/recording/recorder.h"

namespace silhouette {

// One message, and when it was recorded.
struct Recorded {
  absl::Time time;
  std::variant<v1::GetDatabaseResponse, v1::ServedState, v1::Scene, v1::WatchedPath> message;
};

class Recording {
 public:
  // As McapReader::Open.
  static absl::StatusOr<Recording> Open(const std::string& path);

  // The next message, without camera images and what others put into the file; nothing at the end.
  // Errors as those of McapReader::Next; DataLoss: a message cannot be parsed.
  absl::StatusOr<std::optional<Recorded>> Next();

  // As McapReader::cut.
  bool cut() const { return reader_->cut(); }

 private:
  explicit Recording(std::unique_ptr<McapReader> reader) : reader_(std::move(reader)) {}

  std::unique_ptr<McapReader> reader_;
};

// What was known at a moment, as far as the recording has it.
struct RecordedMoment {
  v1::GetDatabaseResponse database;
  v1::ServedState state;
  std::optional<v1::Scene> scene;
  std::map<uint64_t, v1::WatchedPath> paths;  // by id: those with an answer

  void Take(const Recorded& recorded);
};

// What a recording is about.
struct RecordingSummary {
  std::string cell;
  absl::Time start = absl::InfiniteFuture();
  absl::Time end = absl::InfinitePast();
  uint64_t scenes = 0;
  std::vector<Stop> stops;
  bool cut = false;
};
absl::StatusOr<RecordingSummary> SummaryOf(const std::string& path);

// What the file knows of the moment `time`; OutOfRange: it has nothing of it.
absl::StatusOr<RecordedMoment> MomentAt(const std::string& path, absl::Time time);

// Publishes the scene again as it was seen: its masks, joint values and variant. Capture times are
// left out. A scene that had defects goes without joint values, so that nothing is free by it:
// masks alone do not show all of them.
v1::PublishSceneRequest RequestOf(const v1::Scene& scene);

}  // namespace silhouette
