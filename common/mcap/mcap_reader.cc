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
constexpr std::string_view kLz4 = "lz4";
// Of a chunk: two times, size and checksum of its records. Then compression and length.
constexpr uint64_t kBeforeCompression = 28;
constexpr uint64_t kChunkHead = mcap::kRecordHead + kBeforeCompression + 4 + kLz4.size() + 8;

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

absl::Status Fault(std::string_view what) { return absl::DataLossError(std::string(what)); }

// Whether a chunk with LZ4 can begin here, `left` bytes before the end of the file.
bool CanBeChunk(std::string_view bytes, uint64_t left) {
  if (bytes[0] != static_cast<char>(Op::kChunk)) return false;
  Fields fields(bytes.substr(1, kChunkHead - 1));
  const auto length = fields.Take<uint64_t>();
  if (length > std::min(left - mcap::kRecordHead, kMostChunkBytes)) return false;
  fields.TakeBytes(kBeforeCompression);
  return fields.TakeText() == kLz4 &&
         fields.Take<uint64_t>() == length - (kChunkHead - mcap::kRecordHead);
}

// It is skipped: a damaged length would skip chunks, too. Fields that a later version of the format
// might append count as damage.
absl::Status CheckMessageIndex(std::string_view content) {
  Fields fields(content);
  fields.Take<uint16_t>();  // channel
  fields.TakeBytes(fields.Take<uint32_t>());
  return fields.failed() || !fields.rest().empty() ? Fault("a message index is damaged")
                                                   : absl::OkStatus();
}

uint32_t CrcOf(std::string_view bytes) {
  return static_cast<uint32_t>(
      crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
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
  reader->unread_ = magic.size();
  reader->TakeSummary();
  return reader;
}

McapReader::McapReader(std::string path, uint64_t size)
    : path_(std::move(path)), size_(size), in_(path_, std::ios::binary), left_(size) {}

void McapReader::Seek(uint64_t place) {
  in_.clear();
  in_.seekg(static_cast<std::streamoff>(place));
  left_ = size_ - place;
}

void McapReader::TakeSummary() {
  constexpr uint64_t kFooter = mcap::kRecordHead + mcap::kFooterBytes;
  constexpr uint64_t kTail = kFooter + mcap::kMagic.size();
  const uint64_t begin = size_ - left_;
  if (left_ < kTail) return;
  Seek(size_ - kTail);
  std::string tail(kTail, '\0');
  in_.read(tail.data(), static_cast<std::streamsize>(kTail));
  Fields footer(std::string_view(tail).substr(mcap::kRecordHead));
  const auto summary = footer.Take<uint64_t>();
  footer.Take<uint64_t>();
  const auto crc = footer.Take<uint32_t>();
  const uint64_t end = size_ - kTail;
  if (in_ && tail.ends_with(mcap::kMagic) && summary >= begin && summary < end &&
      end - summary <= kMostChunkBytes) {
    Seek(summary);
    std::string bytes(end - summary, '\0');
    in_.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    // It covers the footer up to itself, too.
    if (in_ && CrcOf(bytes + tail.substr(0, kFooter - sizeof(crc))) == crc) {
      Fields fields(bytes);
      while (const std::optional<Record> record = TakeRecord(fields)) {
        absl::Status status;
        if (record->op == Op::kSchema) status = TakeSchema(record->content);
        if (record->op == Op::kChannel) status = TakeChannel(record->content);
        if (record->op == Op::kStatistics) {
          all_messages_ = Fields(record->content).Take<uint64_t>();
        }
        if (!status.ok()) break;
      }
      has_summary_ = !channels_.empty();
    }
  }
  Seek(begin);
}

bool McapReader::ReadBytes(std::string& bytes) {
  const auto begin = static_cast<uint64_t>(in_.tellg());
  if (in_.read(bytes.data(), static_cast<std::streamsize>(bytes.size()))) return true;
  constexpr uint64_t kBlock = 4096;  // the disk gives whole ones
  for (uint64_t at = 0, size = 0; at < bytes.size(); at += size) {
    size = std::min(kBlock - (begin + at) % kBlock, bytes.size() - at);
    in_.clear();
    in_.seekg(static_cast<std::streamoff>(begin + at));
    if (!in_.read(&bytes[at], static_cast<std::streamsize>(size))) {
      std::fill_n(bytes.begin() + static_cast<ptrdiff_t>(at), size, '\0');
    }
  }
  in_.clear();
  in_.seekg(static_cast<std::streamoff>(begin + bytes.size()));
  return false;
}

std::optional<Op> McapReader::NextRecord() {
  std::string head(mcap::kRecordHead, '\0');
  record_ = size_ - left_;
  if (left_ < head.size()) return std::nullopt;
  readable_ = ReadBytes(head);
  left_ -= head.size();
  Fields fields(head);
  const Op op{fields.Take<uint8_t>()};
  const auto length = fields.Take<uint64_t>();
  if (length > left_ || length > kMostChunkBytes) return std::nullopt;
  bytes_.resize(length);
  readable_ = ReadBytes(bytes_) && readable_;
  left_ -= length;
  return op;
}

absl::StatusOr<std::optional<McapReader::Message>> McapReader::Next() {
  std::optional<Message> message;
  while (!message && !(ended_ && in_chunk_.rest().empty())) {
    ASSIGN_OR_RETURN(message, in_chunk_.rest().empty() ? TakeNextRecord() : NextInChunk());
  }
  if (!message) return message;
  ++messages_;
  message->after_damage = std::exchange(after_damage_, false);
  return message;
}

absl::StatusOr<std::optional<McapReader::Message>> McapReader::NextInChunk() {
  const Place place{.record = chunk_record_, .in_chunk = chunk_.size() - in_chunk_.rest().size()};
  const std::optional<Record> record = TakeRecord(in_chunk_);
  absl::Status status;
  if (!record) {
    status = Fault("a record of a chunk goes beyond it");
  } else if (record->op == Op::kMessage) {
    auto message = MessageFrom(record->content, place);
    if (message.ok()) return message;
    status = message.status();
  } else if (record->op == Op::kSchema && !has_summary_) {
    status = TakeSchema(record->content);
  } else if (record->op == Op::kChannel && !has_summary_) {
    status = TakeChannel(record->content);
  }
  if (status.ok()) return std::nullopt;
  in_chunk_ = Fields("");
  NoteDamage(std::string(status.message()));
  return std::nullopt;
}

absl::StatusOr<std::optional<McapReader::Message>> McapReader::TakeNextRecord() {
  const std::optional<Op> op = NextRecord();
  if (op && readable_) return TakeWhole(*op);
  if (op) {
    LeaveOutRecord(*op, "the disk does not give all of a record");
  } else if (record_ == size_) {
    cut_ = true;
    End();
  } else {
    LeaveOut("a record goes beyond the file's end");
  }
  return std::nullopt;
}

absl::StatusOr<std::optional<McapReader::Message>> McapReader::TakeWhole(Op op) {
  absl::Status status;
  switch (op) {
    case Op::kSchema:
      if (!has_summary_) status = TakeSchema(bytes_);
      break;
    case Op::kChannel:
      if (!has_summary_) status = TakeChannel(bytes_);
      break;
    case Op::kMessage: {
      auto message = MessageFrom(bytes_, {.record = record_});
      if (message.ok()) return message;
      status = message.status();
      break;
    }
    case Op::kChunk:
      status = TakeChunk(bytes_);
      break;
    case Op::kMessageIndex:
      status = CheckMessageIndex(bytes_);
      break;
    case Op::kDataEnd:
      data_ended_ = true;
      break;
    case Op::kFooter:
      if (bytes_.size() == mcap::kFooterBytes && left_ == mcap::kMagic.size()) {
        End();
      } else {
        status = Fault("a record is none that stands there");
      }
      break;
    default:
      if (!mcap::IsKnown(op)) status = Fault("a record is of no known kind");
  }
  if (status.ok()) return std::nullopt;
  if (!absl::IsDataLoss(status)) return status;
  LeaveOutRecord(op, std::string(status.message()));
  return std::nullopt;
}

void McapReader::NoteDamage(std::string_view what) {
  if (damaged_places_++ == 0) {
    first_damage_ = absl::StrCat("at byte ", record_, " (", std::string(what), ")");
  }
  after_damage_ = true;
}

void McapReader::LeaveOutRecord(Op op, std::string_view what) {
  if (op == Op::kChunk) unread_ = record_ + 1;  // not this one again
  LeaveOut(what);
}

void McapReader::LeaveOut(std::string_view what) {
  const bool more = FindChunk();
  if (more || !data_ended_) NoteDamage(what);
  if (more) return;
  cut_ = !all_messages_;
  End();
}

bool McapReader::FindChunk() {
  constexpr uint64_t kBlock = uint64_t{1} << 20;
  std::string block;
  for (uint64_t begin = unread_; begin + kChunkHead <= size_; begin += kBlock) {
    Seek(begin);
    // Chunks may begin anywhere in it, and their heads go beyond it.
    block.resize(std::min(size_ - begin, kBlock + kChunkHead - 1));
    ReadBytes(block);
    for (uint64_t at = 0; at + kChunkHead <= block.size(); ++at) {
      if (!CanBeChunk(std::string_view(block).substr(at), size_ - begin - at)) continue;
      Seek(begin + at);
      unread_ = begin + at;
      return true;
    }
  }
  return false;
}

void McapReader::End() {
  ended_ = true;
  if (!all_messages_) return;
  if (messages_ >= *all_messages_) {
    damaged_places_ = 0;
    after_damage_ = false;
  } else if (damaged_places_ == 0) {
    damaged_places_ = 1;
    first_damage_ = absl::StrCat("somewhere (", *all_messages_ - messages_, " of ", *all_messages_,
                                 " messages are missing)");
    after_damage_ = true;
  }
}

std::string McapReader::Damage() const {
  if (damaged_places_ == 0) return "";
  return absl::StrCat(
      "is damaged ", first_damage_,
      damaged_places_ > 1 ? absl::StrCat(" and in ", damaged_places_ - 1, " further places") : "");
}

absl::StatusOr<McapReader::Message> McapReader::Read(const Place& place) {
  const absl::Status changed =
      absl::DataLossError(absl::StrCat(path_, ": it was changed while it was read"));
  if (chunk_record_ != place.record) {
    Seek(place.record);
    const std::optional<Op> op = NextRecord();
    if (op && !readable_) {
      return absl::DataLossError(absl::StrCat(path_, ": it cannot be read"));
    }
    if (op != Op::kMessage && (op != Op::kChunk || !TakeChunk(bytes_).ok())) return changed;
    if (op == Op::kMessage) {
      auto message = MessageFrom(bytes_, place);
      return message.ok() ? std::move(message) : changed;
    }
  }
  Fields rest(std::string_view(chunk_).substr(std::min(chunk_.size(), place.in_chunk)));
  const std::optional<Record> record = TakeRecord(rest);
  if (!record || record->op != Op::kMessage) return changed;
  auto message = MessageFrom(record->content, place);
  return message.ok() ? std::move(message) : changed;
}

absl::Status McapReader::TakeSchema(std::string_view content) {
  Fields fields(content);
  const auto id = fields.Take<uint16_t>();
  McapChannel& schema = schemas_[id];
  schema.schema_name = fields.TakeText();
  schema.schema_encoding = fields.TakeText();
  schema.schema = fields.TakeText();
  return fields.failed() ? Fault("a schema is too short") : absl::OkStatus();
}

absl::Status McapReader::TakeChannel(std::string_view content) {
  Fields fields(content);
  const auto id = fields.Take<uint16_t>();
  const auto schema = schemas_.find(fields.Take<uint16_t>());
  McapChannel channel = schema == schemas_.end() ? McapChannel() : schema->second;
  channel.topic = fields.TakeText();
  channel.message_encoding = fields.TakeText();
  if (fields.failed()) return Fault("a channel is too short");
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
  if (fields.failed() || !fields.rest().empty() || size > kMostChunkBytes) {
    return Fault("a chunk's head is damaged");
  }
  if (compression.empty()) {
    chunk_ = records;
  } else if (compression == kLz4) {
    std::optional<std::string> decompressed = Decompressed(records, size);
    if (!decompressed) return Fault("a chunk cannot be decompressed");
    chunk_ = *std::move(decompressed);
  } else if (compression != "zstd") {
    return Fault("a chunk's head is damaged");
  } else {
    return absl::UnimplementedError(absl::StrCat(path_, ": its chunks are compressed with '",
                                                 std::string(compression), "'; known is lz4"));
  }
  if (crc != 0 && crc != CrcOf(chunk_)) return Fault("a chunk fails its checksum");
  in_chunk_ = Fields(chunk_);
  chunk_record_ = record_;
  unread_ = size_ - left_;
  return absl::OkStatus();
}

absl::StatusOr<McapReader::Message> McapReader::MessageFrom(std::string_view content,
                                                            const Place& place) const {
  Fields fields(content);
  const auto channel = channels_.find(fields.Take<uint16_t>());
  if (channel == channels_.end()) return Fault("a message has no channel");
  fields.Take<uint32_t>();  // sequence
  Message message{
      .channel = channel->second, .logged = {}, .published = {}, .place = place, .data = {}};
  message.logged = TimeOf(fields.Take<uint64_t>());
  message.published = TimeOf(fields.Take<uint64_t>());
  if (fields.failed()) return Fault("a message is too short");
  message.data = fields.rest();
  return message;
}

}  // namespace silhouette
