// SPDX-License-Identifier: Apache-2.0
#include "common/mcap/mcap_reader.h"

#include <lz4frame.h>
#include <zlib.h>

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

using mcap::Fields;
using mcap::Op;
using mcap::Record;

// A greater length is damaged.
constexpr uint64_t kMostChunkBytes = uint64_t{1} << 30;

absl::Time TimeOf(uint64_t nanoseconds) {
  return absl::FromUnixNanos(static_cast<int64_t>(nanoseconds));
}

// Nothing if it is not `size` bytes in one frame.
std::optional<std::string> Decompressed(std::string_view frame, uint64_t size) {
  if (size > 256 * frame.size() + 65536) return std::nullopt;  // more than LZ4 can make of it
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION))) return std::nullopt;
  std::string bytes(size, '\0');
  size_t done = 0;
  size_t hint = 1;
  while (hint != 0) {
    size_t in = frame.size();
    size_t out = bytes.size() - done;
    hint = LZ4F_decompress(context, bytes.data() + done, &out, frame.data(), &in, nullptr);
    if (LZ4F_isError(hint) || (in == 0 && out == 0)) break;
    frame.remove_prefix(in);
    done += out;
  }
  LZ4F_freeDecompressionContext(context);
  if (hint != 0 || done != size) return std::nullopt;
  return bytes;
}

}  // namespace

absl::StatusOr<std::unique_ptr<McapReader>> McapReader::Open(const std::string& path) {
  std::error_code error;
  const uint64_t size = std::filesystem::file_size(path, error);
  if (error) return NotFound(path, ": ", error.message());
  std::unique_ptr<McapReader> reader(new McapReader(path, size));
  std::string magic(mcap::kMagic.size(), '\0');
  if (size < magic.size() ||
      !reader->in_.read(magic.data(), static_cast<std::streamsize>(magic.size())) ||
      magic != mcap::kMagic) {
    return InvalidArgument(path, " is no MCAP file");
  }
  reader->left_ -= magic.size();
  return reader;
}

McapReader::McapReader(std::string path, uint64_t size)
    : path_(std::move(path)), size_(size), in_(path_, std::ios::binary), left_(size) {}

absl::Status McapReader::Damaged(std::string_view what) const {
  return absl::DataLossError(absl::StrCat(path_, ": ", std::string(what)));
}

absl::StatusOr<std::optional<Op>> McapReader::NextRecord() {
  std::string head(mcap::kRecordHead, '\0');
  record_ = size_ - left_;
  cut_ = left_ < head.size();
  if (cut_) return std::nullopt;
  in_.read(head.data(), static_cast<std::streamsize>(head.size()));
  left_ -= head.size();
  Fields fields(head);
  const Op op{fields.Take<uint8_t>()};
  const auto length = fields.Take<uint64_t>();
  cut_ = length > left_;
  if (cut_) return std::nullopt;
  if (length > kMostChunkBytes) return Damaged("a record has more than a gigabyte");
  bytes_.resize(length);
  in_.read(bytes_.data(), static_cast<std::streamsize>(length));
  left_ -= length;
  if (!in_) return Damaged("it cannot be read");
  return op;
}

absl::StatusOr<std::optional<McapReader::Message>> McapReader::Next() {
  while (!ended_) {
    if (in_chunk_.rest().empty()) {
      ASSIGN_OR_RETURN(const std::optional<Op> op, NextRecord());
      ended_ = !op || *op == Op::kDataEnd || *op == Op::kFooter;
      if (ended_) break;
      if (*op == Op::kSchema) RETURN_IF_ERROR(TakeSchema(bytes_));
      if (*op == Op::kChannel) RETURN_IF_ERROR(TakeChannel(bytes_));
      if (*op == Op::kChunk) RETURN_IF_ERROR(TakeChunk(bytes_));
      if (*op == Op::kMessage) return MessageFrom(bytes_, {.record = record_});
      continue;
    }
    const Place place{.record = record_, .in_chunk = chunk_.size() - in_chunk_.rest().size()};
    const std::optional<Record> record = TakeRecord(in_chunk_);
    if (!record) return Damaged("a record of a chunk goes beyond it");
    if (record->op == Op::kSchema) RETURN_IF_ERROR(TakeSchema(record->content));
    if (record->op == Op::kChannel) RETURN_IF_ERROR(TakeChannel(record->content));
    if (record->op == Op::kMessage) return MessageFrom(record->content, place);
  }
  return std::nullopt;
}

absl::StatusOr<McapReader::Message> McapReader::Read(const Place& place) {
  if (chunk_record_ != place.record) {
    in_.clear();
    in_.seekg(static_cast<std::streamoff>(place.record));
    left_ = size_ - place.record;
    ASSIGN_OR_RETURN(const std::optional<Op> op, NextRecord());
    if (op == Op::kMessage) return MessageFrom(bytes_, place);
    if (op != Op::kChunk) return Damaged("it was changed while it was read");
    RETURN_IF_ERROR(TakeChunk(bytes_));
  }
  Fields rest(std::string_view(chunk_).substr(std::min(chunk_.size(), place.in_chunk)));
  const std::optional<Record> record = TakeRecord(rest);
  if (!record || record->op != Op::kMessage) return Damaged("it was changed while it was read");
  return MessageFrom(record->content, place);
}

absl::Status McapReader::TakeSchema(std::string_view content) {
  Fields fields(content);
  const auto id = fields.Take<uint16_t>();
  McapChannel& schema = schemas_[id];
  schema.schema_name = fields.TakeText();
  schema.schema_encoding = fields.TakeText();
  schema.schema = fields.TakeText();
  return fields.failed() ? Damaged("a schema is too short") : absl::OkStatus();
}

absl::Status McapReader::TakeChannel(std::string_view content) {
  Fields fields(content);
  const auto id = fields.Take<uint16_t>();
  const auto schema = schemas_.find(fields.Take<uint16_t>());
  McapChannel channel = schema == schemas_.end() ? McapChannel() : schema->second;
  channel.topic = fields.TakeText();
  channel.message_encoding = fields.TakeText();
  if (fields.failed()) return Damaged("a channel is too short");
  channels_[id] = std::make_shared<const McapChannel>(std::move(channel));
  return absl::OkStatus();
}

absl::Status McapReader::TakeChunk(std::string_view content) {
  chunk_record_ = 0;  // of none, unless it is whole
  Fields fields(content);
  fields.Take<uint64_t>();  // times of its messages
  fields.Take<uint64_t>();
  const auto size = fields.Take<uint64_t>();
  const auto crc = fields.Take<uint32_t>();
  const std::string_view compression = fields.TakeText();
  const std::string_view records = fields.TakeBytes(fields.Take<uint64_t>());
  if (fields.failed() || size > kMostChunkBytes) return Damaged("a chunk's head is damaged");
  if (compression.empty()) {
    chunk_ = records;
  } else if (compression == "lz4") {
    std::optional<std::string> decompressed = Decompressed(records, size);
    if (!decompressed) return Damaged("a chunk cannot be decompressed");
    chunk_ = *std::move(decompressed);
  } else {
    return absl::UnimplementedError(absl::StrCat(path_, ": its chunks are compressed with '",
                                                 std::string(compression), "'; known is lz4"));
  }
  const uLong is = crc32_z(0, reinterpret_cast<const Bytef*>(chunk_.data()), chunk_.size());
  if (crc != 0 && crc != is) return Damaged("a chunk fails its checksum");
  in_chunk_ = Fields(chunk_);
  chunk_record_ = record_;
  return absl::OkStatus();
}

absl::StatusOr<McapReader::Message> McapReader::MessageFrom(std::string_view content,
                                                            const Place& place) const {
  Fields fields(content);
  const auto channel = channels_.find(fields.Take<uint16_t>());
  if (channel == channels_.end()) return Damaged("a message has no channel");
  fields.Take<uint32_t>();  // sequence
  Message message{
      .channel = channel->second, .logged = {}, .published = {}, .place = place, .data = {}};
  message.logged = TimeOf(fields.Take<uint64_t>());
  message.published = TimeOf(fields.Take<uint64_t>());
  if (fields.failed()) return Damaged("a message is too short");
  message.data = fields.rest();
  return message;
}

}  // namespace silhouette
