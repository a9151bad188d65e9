// SPDX-License-Identifier: Apache-2.0
#include "db/store/raw_records.h"

#include "db/status/status_macros.h"
#include "db/store/robot_image_format.h"
#include "db/store/schema.h"
#include "db/store/tile_value.h"

namespace silhouette {
namespace {

constexpr size_t kChunkBytes = size_t{1} << 20;

// Calls `visit` for the records of a range until it returns false.
absl::Status Visit(const RecordSource& source, const KeyRange& keys,
                   const std::function<bool(std::string_view, std::string_view)>& visit) {
  const auto hold = source.environment.HoldMap();
  return source.environment.ForEachEntry(source.transaction, source.records, keys.after,
                                         [&](std::string_view key, std::string_view value) {
                                           if (!keys.end.empty() && key >= keys.end) return false;
                                           return (key == keys.after && !key.empty()) ||
                                                  visit(key, value);
                                         });
}

}  // namespace

KeyRange KeysOfTile(uint64_t tile) {
  return {tile == 0 ? "" : schema::EncodeKey(tile * kTileSize - 1),
          schema::EncodeKey((tile + 1) * kTileSize)};
}

std::string_view BaseOf(const RecordSource& source, ConfigurationNumber number,
                        std::string_view value) {
  if (!source.base || !NeedsBase(value)) return {};
  const auto base =
      source.environment.Get(source.transaction, *source.base, schema::EncodeKey(number));
  return base.ok() ? base->value_or("") : "";
}

absl::StatusOr<std::vector<RawRecord>> ReadChunk(const RecordSource& source, const KeyRange& keys) {
  std::vector<RawRecord> chunk;
  size_t bytes = 0;
  RETURN_IF_ERROR(Visit(source, keys, [&](std::string_view key, std::string_view value) {
    const size_t page_size = source.environment.PageSize();
    RawRecord& record = chunk.emplace_back();
    record.key = key;
    record.value = value;
    record.place = PlaceInFile(value, page_size);
    const std::optional<ConfigurationNumber> number = schema::DecodeKey(key);
    const std::string_view base = number ? BaseOf(source, *number, value) : "";
    if (!base.empty()) {
      record.base = base;
      record.base_place = PlaceInFile(base, page_size);
    }
    bytes += key.size() + value.size() + base.size();
    return bytes < kChunkBytes;
  }));
  return chunk;
}

absl::Status ForEachRecord(const RecordSource& source, KeyRange keys,
                           const std::function<absl::Status(const RawRecord&)>& visit) {
  for (;;) {
    ASSIGN_OR_RETURN(const std::vector<RawRecord> chunk, ReadChunk(source, keys));
    if (chunk.empty()) return absl::OkStatus();
    for (const RawRecord& record : chunk) RETURN_IF_ERROR(visit(record));
    keys.after = chunk.back().key;
  }
}

absl::StatusOr<std::optional<uint64_t>> NextTileWithRecords(const RecordSource& source,
                                                            uint64_t tile) {
  std::optional<uint64_t> next;
  RETURN_IF_ERROR(
      Visit(source, {KeysOfTile(tile).after, ""}, [&](std::string_view key, std::string_view) {
        const std::optional<uint64_t> number = schema::DecodeKey(key);
        if (number) next = *number / kTileSize;
        return !number;
      }));
  return next;
}

absl::StatusOr<std::optional<uint64_t>> DigestOfTile(const RecordSource& source, uint64_t tile) {
  RecordDigest digest;
  RETURN_IF_ERROR(
      Visit(source, KeysOfTile(tile), [&](std::string_view key, std::string_view value) {
        if (schema::DecodeKey(key)) digest.Add(key, value);
        return true;
      }));
  return digest.empty() ? std::nullopt : std::optional<uint64_t>(digest.Get());
}

}  // namespace silhouette
