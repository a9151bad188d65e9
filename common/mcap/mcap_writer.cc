// SPDX-License-Identifier: Apache-2.0
#include "common/mcap/mcap_writer.h"

#include <fcntl.h>
#include <lz4frame.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <set>
#include <stdexcept>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "common/mcap/mcap_records.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

using mcap::AppendRecord;
using mcap::AppendText;
using mcap::Op;

uint32_t Crc(uint32_t crc, std::string_view bytes) {
  return static_cast<uint32_t>(
      crc32_z(crc, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

uint64_t NanosecondsOf(absl::Time time) {
  return static_cast<uint64_t>(std::max<int64_t>(absl::ToUnixNanos(time), 0));
}

std::string Compressed(std::string_view bytes) {
  std::string frame(LZ4F_compressFrameBound(bytes.size(), nullptr), '\0');
  const size_t size =
      LZ4F_compressFrame(frame.data(), frame.size(), bytes.data(), bytes.size(), nullptr);
  if (LZ4F_isError(size)) {
    throw std::runtime_error(absl::StrCat("LZ4: ", LZ4F_getErrorName(size)));
  }
  frame.resize(size);
  return frame;
}

// Places with their values, after their length in bytes.
void AppendMap(std::string& bytes, const std::map<uint16_t, uint64_t>& map) {
  mcap::Append(bytes, static_cast<uint32_t>(map.size() * (sizeof(uint16_t) + sizeof(uint64_t))));
  for (const auto& [key, value] : map) {
    mcap::Append(bytes, key);
    mcap::Append(bytes, value);
  }
}

// A file counts channels and schemas from 1.
uint16_t IdOf(uint16_t channel) { return static_cast<uint16_t>(channel + 1); }

absl::Status DiskError(const std::string& path, int error) {
  const std::string what = absl::StrCat(path, ": ", std::strerror(error));
  if (error == ENOSPC || error == EDQUOT) return absl::ResourceExhaustedError(what);
  return absl::UnavailableError(what);
}

}  // namespace

absl::StatusOr<std::unique_ptr<McapWriter>> McapWriter::Create(const std::string& path,
                                                               std::vector<McapChannel> channels) {
  if (channels.size() >= std::numeric_limits<uint16_t>::max()) {
    throw std::invalid_argument("an MCAP file has at most 65,534 channels");
  }
  const int file = open(path.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0644);
  if (file < 0 && errno == EEXIST) {
    return absl::AlreadyExistsError(absl::StrCat(path, " exists already"));
  }
  if (file < 0) return DiskError(path, errno);
  std::unique_ptr<McapWriter> writer(new McapWriter(path, file, std::move(channels)));
  std::string start(mcap::kMagic);
  std::string header;
  AppendText(header, "");
  AppendText(header, "silhouette");
  AppendRecord(start, Op::kHeader, header);
  std::vector<std::pair<uint8_t, std::string>> groups;
  start += writer->SchemasAndChannels(groups);
  writer->start_ = std::move(start);
  // If the disk is full, Flush() writes it before the first chunk.
  writer->AppendStart().IgnoreError();
  return writer;
}

McapWriter::McapWriter(std::string path, int file, std::vector<McapChannel> channels)
    : path_(std::move(path)), file_(file), channels_(std::move(channels)) {}

McapWriter::~McapWriter() {
  if (file_ < 0) return;
  close(file_);
  if (written_ == 0) unlink(path_.c_str());
}

std::string McapWriter::SchemasAndChannels(
    std::vector<std::pair<uint8_t, std::string>>& groups) const {
  std::map<std::string, uint16_t> schemas;
  std::string of_schemas;
  std::string of_channels;
  for (uint16_t i = 0; i < channels_.size(); ++i) {
    const McapChannel& channel = channels_[i];
    const auto [schema, is_new] =
        schemas.emplace(channel.schema_name, static_cast<uint16_t>(schemas.size() + 1));
    if (is_new) {
      std::string content;
      mcap::Append(content, schema->second);
      AppendText(content, channel.schema_name);
      AppendText(content, channel.schema_encoding);
      AppendText(content, channel.schema);
      AppendRecord(of_schemas, Op::kSchema, content);
    }
    std::string content;
    mcap::Append(content, IdOf(i));
    mcap::Append(content, schema->second);
    AppendText(content, channel.topic);
    AppendText(content, channel.message_encoding);
    mcap::Append(content, uint32_t{0});  // no metadata
    AppendRecord(of_channels, Op::kChannel, content);
  }
  groups.emplace_back(static_cast<uint8_t>(Op::kSchema), of_schemas);
  groups.emplace_back(static_cast<uint8_t>(Op::kChannel), of_channels);
  return of_schemas + of_channels;
}

void McapWriter::Add(const McapMessage& message) {
  if (message.channel >= channels_.size()) {
    throw std::invalid_argument(absl::StrCat("there is no channel ", message.channel));
  }
  const uint64_t logged = NanosecondsOf(message.logged);
  index_[message.channel].emplace_back(logged, chunk_.size());
  std::string content;
  content.reserve(22 + message.data.size());
  mcap::Append(content, IdOf(message.channel));
  mcap::Append(content, sequence_++);
  mcap::Append(content, logged);
  mcap::Append(content, NanosecondsOf(message.published));
  content += message.data;
  AppendRecord(chunk_, Op::kMessage, content);
}

absl::Status McapWriter::Flush() {
  RETURN_IF_ERROR(AppendStart());
  if (index_.empty()) return absl::OkStatus();
  ChunkIndex chunk{.offset = written_, .size = chunk_.size(), .indexes = {}};
  chunk.start = std::numeric_limits<uint64_t>::max();
  for (const auto& [channel, messages] : index_) {
    for (const auto& [time, place] : messages) {
      chunk.start = std::min(chunk.start, time);
      chunk.end = std::max(chunk.end, time);
    }
  }
  const std::string records = Compressed(chunk_);
  chunk.compressed = records.size();
  std::string content;
  mcap::Append(content, chunk.start);
  mcap::Append(content, chunk.end);
  mcap::Append(content, chunk.size);
  mcap::Append(content, Crc(0, chunk_));
  AppendText(content, "lz4");
  mcap::Append(content, static_cast<uint64_t>(records.size()));
  content += records;
  std::string bytes;
  AppendRecord(bytes, Op::kChunk, content);
  chunk.length = bytes.size();
  for (const auto& [channel, messages] : index_) {
    chunk.indexes[IdOf(channel)] = written_ + bytes.size();
    std::string index;
    mcap::Append(index, IdOf(channel));
    mcap::Append(index, static_cast<uint32_t>(messages.size() * 2 * sizeof(uint64_t)));
    for (const auto& [time, place] : messages) {
      mcap::Append(index, time);
      mcap::Append(index, place);
    }
    AppendRecord(bytes, Op::kMessageIndex, index);
  }
  chunk.index_length = bytes.size() - chunk.length;
  RETURN_IF_ERROR(Append(bytes));
  for (const auto& [channel, messages] : index_) counts_[IdOf(channel)] += messages.size();
  chunks_.push_back(std::move(chunk));
  chunk_.clear();
  index_.clear();
  return absl::OkStatus();
}

absl::Status McapWriter::Close() {
  RETURN_IF_ERROR(Flush());
  std::string bytes;
  std::string data_end;
  mcap::Append(data_end, crc_);
  AppendRecord(bytes, Op::kDataEnd, data_end);
  const uint64_t summary = written_ + bytes.size();
  const size_t summary_begin = bytes.size();

  std::vector<std::pair<uint8_t, std::string>> groups;
  SchemasAndChannels(groups);
  std::set<std::string> schemas;
  for (const McapChannel& channel : channels_) schemas.insert(channel.schema_name);
  uint64_t start = chunks_.empty() ? 0 : std::numeric_limits<uint64_t>::max();
  uint64_t end = 0;
  uint64_t messages = 0;
  for (const auto& [channel, count] : counts_) messages += count;
  std::string of_chunks;
  for (const ChunkIndex& chunk : chunks_) {
    start = std::min(start, chunk.start);
    end = std::max(end, chunk.end);
    std::string content;
    mcap::Append(content, chunk.start);
    mcap::Append(content, chunk.end);
    mcap::Append(content, chunk.offset);
    mcap::Append(content, chunk.length);
    AppendMap(content, chunk.indexes);
    mcap::Append(content, chunk.index_length);
    AppendText(content, "lz4");
    mcap::Append(content, chunk.compressed);
    mcap::Append(content, chunk.size);
    AppendRecord(of_chunks, Op::kChunkIndex, content);
  }
  std::string statistics;
  mcap::Append(statistics, messages);
  mcap::Append(statistics, static_cast<uint16_t>(schemas.size()));
  mcap::Append(statistics, static_cast<uint32_t>(channels_.size()));
  mcap::Append(statistics, uint32_t{0});  // attachments
  mcap::Append(statistics, uint32_t{0});  // metadata
  mcap::Append(statistics, static_cast<uint32_t>(chunks_.size()));
  mcap::Append(statistics, start);
  mcap::Append(statistics, end);
  AppendMap(statistics, counts_);
  std::string of_statistics;
  AppendRecord(of_statistics, Op::kStatistics, statistics);
  groups.emplace_back(static_cast<uint8_t>(Op::kStatistics), of_statistics);
  groups.emplace_back(static_cast<uint8_t>(Op::kChunkIndex), of_chunks);

  std::string offsets;
  for (const auto& [op, records] : groups) {
    if (records.empty()) continue;
    std::string content;
    mcap::Append(content, op);
    mcap::Append(content, static_cast<uint64_t>(written_ + bytes.size()));
    mcap::Append(content, static_cast<uint64_t>(records.size()));
    AppendRecord(offsets, Op::kSummaryOffset, content);
    bytes += records;
  }
  const uint64_t summary_offset = written_ + bytes.size();
  bytes += offsets;

  // The footer's CRC covers the summary and the footer up to itself.
  mcap::Append(bytes, static_cast<uint8_t>(Op::kFooter));
  mcap::Append(bytes, uint64_t{20});
  mcap::Append(bytes, summary);
  mcap::Append(bytes, summary_offset);
  mcap::Append(bytes, Crc(0, std::string_view(bytes).substr(summary_begin)));
  bytes += mcap::kMagic;
  RETURN_IF_ERROR(Append(bytes));
  close(std::exchange(file_, -1));
  return absl::OkStatus();
}

absl::Status McapWriter::AppendStart() {
  if (start_.empty()) return absl::OkStatus();
  RETURN_IF_ERROR(Append(start_));
  start_.clear();
  return absl::OkStatus();
}

absl::Status McapWriter::Append(const std::string& bytes) {
  size_t done = 0;
  bool failed = false;
  while (done < bytes.size() && !failed) {
    const ssize_t count = write(file_, bytes.data() + done, bytes.size() - done);
    failed = count == 0 || (count < 0 && errno != EINTR);
    if (count > 0) done += static_cast<size_t>(count);
  }
  // Some file systems cannot.
  failed = failed || (fdatasync(file_) != 0 && errno != EINVAL && errno != EROFS);
  if (failed) {
    const int error = errno;
    // Back to the last whole record.
    if (ftruncate(file_, static_cast<off_t>(written_)) == 0) {
      lseek(file_, static_cast<off_t>(written_), SEEK_SET);
    }
    return DiskError(path_, error);
  }
  written_ += bytes.size();
  crc_ = Crc(crc_, bytes);
  return absl::OkStatus();
}

}  // namespace silhouette
