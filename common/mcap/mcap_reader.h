// SPDX-License-Identifier: Apache-2.0
// Reads an MCAP file from its beginning to its end: chunks without compression or with LZ4. What is
// damaged or not given by the disk is left out and named: after it, reading goes on with the next
// whole chunk that has LZ4.
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
    bool after_damage = false;  // between the one before and this one messages may be lost
    std::string data;
  };
  // The next message as they stand in the file, without those that are damaged; nothing at its end,
  // or where it was cut. Unimplemented: another compression.
  absl::StatusOr<std::optional<Message>> Next();

  // A message that Next() returned, again; only once Next() has returned nothing. Messages of one
  // chunk, one after the other, are decompressed once. DataLoss: the disk does not give it, or the
  // file was changed since.
  absl::StatusOr<Message> Read(const Place& place);

  // Whether the file has no end: it was cut, or is still written. Known when Next() returned
  // nothing, until Read() is called.
  bool cut() const { return cut_; }

  // Where messages may be lost, to follow the file's name: "is damaged at byte 4711 (a chunk fails
  // its checksum)". Empty: all are there, as far as the file shows. Known when Next() returned
  // nothing, until Read() is called.
  std::string Damage() const;
  // Messages may be lost after the last one.
  bool damaged_at_end() const { return after_damage_; }

 private:
  McapReader(std::string path, uint64_t size);
  // Schemas, channels and the number of messages from the end of the file, if that is whole.
  void TakeSummary();
  void Seek(uint64_t place);
  // The next bytes of the file, zeros where the disk does not give them; false: not all of them.
  bool ReadBytes(std::string& bytes);
  // The next record of the file into op, bytes_ and readable_; nothing if it does not fit.
  std::optional<mcap::Op> NextRecord();
  // The next record of the file, whole or not; a message of it.
  absl::StatusOr<std::optional<Message>> TakeNextRecord();
  absl::StatusOr<std::optional<Message>> TakeWhole(mcap::Op op);
  absl::StatusOr<std::optional<Message>> NextInChunk();
  void NoteDamage(std::string_view what);
  // Goes on with the next chunk that was not read; LeaveOutRecord: after this one.
  void LeaveOutRecord(mcap::Op op, std::string_view what);
  void LeaveOut(std::string_view what);
  // Goes to the first record from unread_ on that can be a chunk; false: there is none.
  bool FindChunk();
  void End();
  // DataLoss, without the file's name.
  absl::Status TakeSchema(std::string_view content);
  absl::Status TakeChannel(std::string_view content);
  absl::Status TakeChunk(std::string_view content);
  absl::StatusOr<Message> MessageFrom(std::string_view content, const Place& place) const;

  const std::string path_;
  const uint64_t size_;
  std::ifstream in_;
  uint64_t left_;              // bytes of the file
  uint64_t record_ = 0;        // where the record begins
  std::string bytes_;          // of the record
  bool readable_ = true;       // the disk gave all of it
  std::string chunk_;          // records
  uint64_t chunk_record_ = 0;  // where the record of this chunk begins; 0: there is none
  uint64_t unread_ = 0;        // from here on there may be chunks that were not read
  mcap::Fields in_chunk_{""};
  std::map<uint16_t, McapChannel> schemas_;  // without topic
  std::map<uint16_t, std::shared_ptr<const McapChannel>> channels_;
  bool has_summary_ = false;  // with the channels
  std::optional<uint64_t> all_messages_;
  uint64_t messages_ = 0;
  bool data_ended_ = false;
  bool ended_ = false;
  bool cut_ = false;
  uint64_t damaged_places_ = 0;
  std::string first_damage_;
  bool after_damage_ = false;
};

}  // namespace silhouette
