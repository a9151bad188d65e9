// SPDX-License-Identifier: Apache-2.0
// Reads an MCAP file from its beginning to its end: chunks without compression or with LZ4. A file
// that was cut is read up to its last whole chunk.
#pragma once

#include <cstdint>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/mcap/mcap.h"
#include "common/mcap/mcap_records.h"

namespace silhouette {

// Not thread-safe.
class McapReader {
 public:
  // NotFound: there is no such file. InvalidArgument: it is no MCAP file.
  static absl::StatusOr<std::unique_ptr<McapReader>> Open(const std::string& path);

  // Where a message stands in the file.
  struct Place {
    uint64_t record = 0;    // where its record, or that of its chunk, begins
    uint64_t in_chunk = 0;  // in the decompressed chunk
  };
  struct Message {
    std::shared_ptr<const McapChannel> channel;
    absl::Time logged;
    absl::Time published;
    Place place;
    std::string data;
  };
  // The next message as they stand in the file; nothing at its end, or where it was cut. DataLoss:
  // a chunk fails its checksum, or a record cannot be. Unimplemented: another compression.
  absl::StatusOr<std::optional<Message>> Next();

  // A message that Next() returned, again; only once Next() has returned nothing. Messages of one
  // chunk, one after the other, are decompressed once. Errors as those of Next().
  absl::StatusOr<Message> Read(const Place& place);

  // Whether the file has no end: it was cut, or is still written. Known when Next() returned
  // nothing, until Read() is called.
  bool cut() const { return cut_; }

 private:
  McapReader(std::string path, uint64_t size);
  // The next record of the file into op and bytes_; false at its end.
  absl::StatusOr<std::optional<mcap::Op>> NextRecord();
  absl::Status TakeSchema(std::string_view content);
  absl::Status TakeChannel(std::string_view content);
  absl::Status TakeChunk(std::string_view content);
  absl::StatusOr<Message> MessageFrom(std::string_view content, const Place& place) const;
  absl::Status Damaged(std::string_view what) const;

  const std::string path_;
  const uint64_t size_;
  std::ifstream in_;
  uint64_t left_;              // bytes of the file
  uint64_t record_ = 0;        // where the record begins
  std::string bytes_;          // of the record
  std::string chunk_;          // records
  uint64_t chunk_record_ = 0;  // where the record of this chunk begins; 0: there is none
  mcap::Fields in_chunk_{""};
  std::map<uint16_t, McapChannel> schemas_;  // without topic
  std::map<uint16_t, std::shared_ptr<const McapChannel>> channels_;
  bool ended_ = false;
  bool cut_ = false;
};

}  // namespace silhouette
