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

McapWriter::McapWriter(std::string path, std::vector<McapChannel> channels)
    : path_(std::move(path)), channels_(std::move(channels)) {
  if (channels_.size() >= std::numeric_limits<uint16_t>::max()) {
    throw std::invalid_argument("an MCAP file has at most 65,534 channels");
  }
}

McapWriter::~McapWriter() {
  if (file_ >= 0) close(file_);
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

absl::Status McapWriter::Write(const std::deque<McapMessage>& messages) {
  std::string bytes;
  std::string records;
  if (written_ == 0) {
    bytes = mcap::kMagic;
    std::string header;
    AppendText(header, "");
    AppendText(header, "silhouette");
    AppendRecord(bytes, Op::kHeader, header);
    std::vector<std::pair<uint8_t, std::string>> groups;
    // The first chunk has them, too: without them, no message can be read.
    records = SchemasAndChannels(groups);
    bytes += records;
  }
  ChunkIndex chunk{.offset = written_ + bytes.size(), .indexes = {}};
  chunk.start = std::numeric_limits<uint64_t>::max();
  // Times and places of messages, by channel.
  std::map<uint16_t, std::vector<std::pair<uint64_t, uint64_t>>> index;
  uint32_t sequence = sequence_;
  for (const McapMessage& message : messages) {
    if (message.channel >= channels_.size()) {
      throw std::invalid_argument(absl::StrCat("there is no channel ", message.channel));
    }
    const uint64_t logged = NanosecondsOf(message.logged);
    chunk.start = std::min(chunk.start, logged);
    chunk.end = std::max(chunk.end, logged);
    index[IdOf(message.channel)].emplace_back(logged, records.size());
    std::string content;
    content.reserve(22 + message.data.size());
    mcap::Append(content, IdOf(message.channel));
    mcap::Append(content, sequence++);
    mcap::Append(content, logged);
    mcap::Append(content, NanosecondsOf(message.published));
    content += message.data;
    AppendRecord(records, Op::kMessage, content);
  }
  const std::string compressed = Compressed(records);
  chunk.size = records.size();
  chunk.compressed = compressed.size();
  std::string content;
  mcap::Append(content, chunk.start);
  mcap::Append(content, chunk.end);
  mcap::Append(content, chunk.size);
  mcap::Append(content, Crc(0, records));
  AppendText(content, "lz4");
  mcap::Append(content, static_cast<uint64_t>(compressed.size()));
  content += compressed;
  AppendRecord(bytes, Op::kChunk, content);
  const uint64_t indexes = written_ + bytes.size();
  chunk.length = indexes - chunk.offset;
  for (const auto& [channel, places] : index) {
    chunk.indexes[channel] = written_ + bytes.size();
    std::string of_channel;
    mcap::Append(of_channel, channel);
    mcap::Append(of_channel, static_cast<uint32_t>(places.size() * 2 * sizeof(uint64_t)));
    for (const auto& [time, place] : places) {
      mcap::Append(of_channel, time);
      mcap::Append(of_channel, place);
    }
    AppendRecord(bytes, Op::kMessageIndex, of_channel);
  }
  chunk.index_length = written_ + bytes.size() - indexes;
  RETURN_IF_ERROR(Append(bytes));
  for (const auto& [channel, places] : index) counts_[channel] += places.size();
  chunks_.push_back(std::move(chunk));
  sequence_ = sequence;
  return absl::OkStatus();
}

absl::Status McapWriter::Close() {
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

absl::Status McapWriter::Append(const std::string& bytes) {
  if (file_ < 0) {
    file_ = open(path_.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0644);
    if (file_ < 0 && errno == EEXIST) {
      return absl::AlreadyExistsError(absl::StrCat(path_, " exists already"));
    }
    if (file_ < 0) return DiskError(path_, errno);
  }
  size_t done = 0;
  bool failed = false;
  while (done < bytes.size() && !failed) {
    const ssize_t count = pwrite(file_, bytes.data() + done, bytes.size() - done,
                                 static_cast<off_t>(written_ + done));
    failed = count == 0 || (count < 0 && errno != EINTR);
    if (count > 0) done += static_cast<size_t>(count);
  }
  // Some file systems cannot.
  failed = failed || (fdatasync(file_) != 0 && errno != EINVAL && errno != EROFS);
  if (!failed) {
    written_ += bytes.size();
    crc_ = Crc(crc_, bytes);
    return absl::OkStatus();
  }
  const absl::Status error = DiskError(path_, errno);
  if (written_ > 0) {
    // Back to the last whole record; if that fails, too, the next call overwrites the rest.
    [[maybe_unused]] const int cut = ftruncate(file_, static_cast<off_t>(written_));
  } else {
    close(std::exchange(file_, -1));
    unlink(path_.c_str());
  }
  return error;
}

}  // namespace silhouette
