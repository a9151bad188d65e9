// SPDX-License-Identifier: Apache-2.0
// Writes an MCAP file. Messages are gathered in chunks, compressed with LZ4; a file that is cut, by
// a crash or a full disk, can be read up to its last whole chunk.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/mcap/mcap.h"

namespace silhouette {

// Not thread-safe.
class McapWriter {
 public:
  // Creates the file; a full disk is an error of Flush(). AlreadyExists: there is one. Throws
  // std::invalid_argument if there are more than 65,534 channels.
  static absl::StatusOr<std::unique_ptr<McapWriter>> Create(const std::string& path,
                                                            std::vector<McapChannel> channels);
  McapWriter(const McapWriter&) = delete;
  McapWriter& operator=(const McapWriter&) = delete;
  // Closes the file as it is, and removes it if the disk took nothing; Close() makes it whole.
  ~McapWriter();

  const std::string& path() const { return path_; }
  // What the file has by now, and what waits for Flush(), before compression.
  uint64_t bytes() const { return written_ + chunk_.size(); }
  bool empty() const { return sequence_ == 0; }

  // Adds a message to the chunk in memory. Throws std::invalid_argument if there is no such
  // channel.
  void Add(const McapMessage& message);

  // Writes the chunk, and waits until the disk has it. After an error (a full disk) the file is as
  // before, and the chunk is kept for the next call.
  absl::Status Flush();

  // Writes what is left, the index and the file's end. Nothing may follow.
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

  McapWriter(std::string path, int file, std::vector<McapChannel> channels);
  // What the file begins with, if it is not there yet.
  absl::Status AppendStart();
  // All of the bytes, or none of them.
  absl::Status Append(const std::string& bytes);
  std::string SchemasAndChannels(std::vector<std::pair<uint8_t, std::string>>& groups) const;

  std::string path_;
  int file_ = -1;
  std::vector<McapChannel> channels_;
  std::string start_;  // until the disk has it
  uint64_t written_ = 0;
  uint32_t crc_ = 0;  // of what is written
  uint32_t sequence_ = 0;
  std::string chunk_;  // records of messages
  // Of the chunk: times and places of messages, by channel.
  std::map<uint16_t, std::vector<std::pair<uint64_t, uint64_t>>> index_;
  std::vector<ChunkIndex> chunks_;
  std::map<uint16_t, uint64_t> counts_;  // messages in chunks_, by channel
};

}  // namespace silhouette
