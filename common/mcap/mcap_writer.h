// SPDX-License-Identifier: Apache-2.0
// Writes an MCAP file. Messages are gathered in chunks, compressed with LZ4; a file that is cut, by
// a crash or a full disk, can be read up to its last whole chunk.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "common/mcap/mcap.h"

namespace silhouette {

// Not thread-safe.
class McapWriter {
 public:
  // Throws std::invalid_argument if there are more than 65,534 channels. The first Write() creates
  // the file.
  McapWriter(std::string path, std::vector<McapChannel> channels);
  McapWriter(const McapWriter&) = delete;
  McapWriter& operator=(const McapWriter&) = delete;
  // Closes the file as it is; Close() makes it whole.
  ~McapWriter();

  const std::string& path() const { return path_; }
  // Of the file; 0: it is not there yet.
  uint64_t bytes() const { return written_; }

  // Appends the messages as a chunk, and waits until the disk has it. After an error (a full disk)
  // the file is as before, and a new one is not there. AlreadyExists: a new file, and there is one
  // of this name. Throws std::invalid_argument if there is no such channel.
  absl::Status Write(const std::deque<McapMessage>& messages);
  // For a file that is not there yet.
  void Rename(std::string path) { path_ = std::move(path); }

  // Writes the index and the file's end, after a Write(). Nothing may follow.
  absl::Status Close();

 private:
  struct ChunkIndex {
    uint64_t offset = 0;
    uint64_t length = 0;
    uint64_t index_length = 0;
    uint64_t compressed = 0;
    uint64_t size = 0;
    uint64_t start = 0;  // of its messages, nanoseconds
    uint64_t end = 0;
    std::map<uint16_t, uint64_t> indexes;  // offsets of the message indexes, by channel
  };

  // All of the bytes, or none of them. The first create the file.
  absl::Status Append(const std::string& bytes);
  std::string SchemasAndChannels(std::vector<std::pair<uint8_t, std::string>>& groups) const;

  std::string path_;
  int file_ = -1;
  std::vector<McapChannel> channels_;
  uint64_t written_ = 0;
  uint32_t crc_ = 0;       // of what is written
  uint32_t sequence_ = 0;  // of the next message
  std::vector<ChunkIndex> chunks_;
  std::map<uint16_t, uint64_t> counts_;  // messages in chunks_, by channel
};

}  // namespace silhouette
