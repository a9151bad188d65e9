// SPDX-License-Identifier: Apache-2.0
// MCAP files of bounded size, the oldest of which make room; and the time around events.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "common/mcap/mcap.h"
#include "common/mcap/mcap_writer.h"

namespace silhouette {

struct McapRotationSettings {
  std::string folder;
  // Files are PREFIX-20260131T120000.123Z.mcap; of one millisecond, the later has the next one.
  std::string prefix;
  // A file of this many bytes is ended, and the next one begins; above 0.
  uint64_t file_bytes = 0;
  // The number of files of such names that are kept, the one that is written included; above 0.
  int files = 0;
  // Channels whose messages hold until the next one: of those that wait for a disk they are lost
  // last.
  std::vector<uint16_t> standing = {};
};

// Not thread-safe.
class McapRotation {
 public:
  // `opening`: what each file begins with, when its first message is added, so that it can be read
  // alone. Throws std::invalid_argument for settings that cannot be.
  McapRotation(McapRotationSettings settings, std::vector<McapChannel> channels,
               std::function<std::vector<McapMessage>()> opening);

  // Begins a file if there is none, and the next one if it is full or the wall clock was set back:
  // the times of a file never step back. A message that cannot be written is kept (see Flush).
  absl::Status Add(const McapMessage& message);

  // Writes to the disk what was added, into a new file if somebody removed this one; the oldest
  // files make room to one that has its first bytes.
  // After an error (a full disk) it is kept and written later, up to kMostWaiting bytes; of more,
  // the oldest is lost, and counted.
  absl::Status Flush();

  // Ends the file; a later message begins another.
  absl::Status Close();

  // How many messages were lost to a disk that took nothing.
  uint64_t lost() const { return lost_; }
  // How many wait for a disk that takes nothing: after a last Close() that failed, they are lost.
  uint64_t unwritten() const { return waiting_.size() - opening_size_; }
  // The newest file of which the disk has something; empty: none yet.
  const std::string& path() const { return path_; }

 private:
  static constexpr uint64_t kMostWaiting = uint64_t{64} << 20;

  std::string NameOf(absl::Time begin) const;
  // A new file, which has what waits after its opening.
  void Begin(absl::Time time);
  void LoseOldest();
  // Removes the oldest files: those of earlier runs by their names, then those begun here in the
  // order in which they were begun, whatever the wall clock said.
  void MakeRoom();

  const McapRotationSettings settings_;
  const std::vector<McapChannel> channels_;
  const std::function<std::vector<McapMessage>()> opening_;
  std::unique_ptr<McapWriter> writer_;
  std::string path_;
  std::vector<std::string> begun_;  // in this order; the last files that can still be there
  absl::Time newest_;               // of the messages of the file
  // Added since the last Flush that succeeded; in a new file, after its opening.
  std::deque<McapMessage> waiting_;
  size_t opening_size_ = 0;
  uint64_t waiting_bytes_ = 0;  // without the opening
  uint64_t lost_ = 0;
  bool failed_ = false;  // the last write; only the next Flush() tries again
};

// Keeps the messages around events: those of `before` in memory, and from an event on for `after`
// they go into files, after those that were kept. Each event, or several that follow each other
// closely, has a file of its own, more if it becomes too large or the wall clock is set back. What
// is before and after counts by a clock that never steps, `running`. Not thread-safe.
class EventExcerpts {
 public:
  // `standing`: a channel whose newest message holds until the next. What is kept before an event
  // begins with that which held then.
  EventExcerpts(McapRotation files, absl::Duration before, absl::Duration after, uint16_t standing)
      : files_(std::move(files)), before_(before), after_(after), standing_channel_(standing) {}

  // Messages come in the order of `running`.
  absl::Status Add(const McapMessage& message, absl::Duration running);
  // There is an event at the time of the newest message.
  absl::Status Keep(absl::Duration running);
  absl::Status Flush() { return files_.Flush(); }
  // Ends the file, and forgets what is kept in memory.
  absl::Status Close();

  const McapRotation& files() const { return files_; }

 private:
  // No more is kept in memory, whatever `before` says.
  static constexpr uint64_t kMostBytes = uint64_t{512} << 20;

  struct Kept {
    McapMessage message;
    absl::Duration running;
  };

  McapRotation files_;
  const absl::Duration before_;
  const absl::Duration after_;
  const uint16_t standing_channel_;
  std::optional<McapMessage> standing_;  // the newest that is not in kept_
  std::deque<Kept> kept_;
  uint64_t kept_bytes_ = 0;
  std::optional<absl::Duration> until_;  // while an excerpt is written
};

}  // namespace silhouette
