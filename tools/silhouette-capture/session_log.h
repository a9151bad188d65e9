// The log of a database's capture sessions: plain sentences with time stamps, appended session by
// session, so that the next morning tells the story of the night.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace spdlog {
class logger;
}

namespace silhouette {

class SessionLog {
 public:
  // Appends to `file`. FailedPrecondition if it cannot be written.
  static absl::StatusOr<SessionLog> Open(const std::string& file);

  // A log that goes nowhere.
  SessionLog() = default;

  // A sentence; it is in the file when this returns. What cannot be written is lost, and nothing
  // else.
  void Write(const std::string& line);

  // The same now and then: not if the last such line is younger than five minutes.
  void WriteProgress(uint64_t done, uint64_t total, absl::Time begin);

  const std::string& file() const { return file_; }

 private:
  std::string file_;
  std::shared_ptr<spdlog::logger> logger_;
  absl::Time next_progress_ = absl::InfinitePast();
};

// Where the log of a database is kept if nobody says otherwise: beside its folder.
std::string DefaultLogFile(const std::string& database);

}  // namespace silhouette
