// SPDX-License-Identifier: Apache-2.0
// The bytes of MCAP's records: little-endian numbers, and texts after their length.
#pragma once

#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>

namespace silhouette::mcap {

inline constexpr std::string_view kMagic("\x89MCAP0\r\n", 8);

enum class Op : uint8_t {
  kHeader = 1,
  kFooter = 2,
  kSchema = 3,
  kChannel = 4,
  kMessage = 5,
  kChunk = 6,
  kMessageIndex = 7,
  kChunkIndex = 8,
  kStatistics = 11,
  kSummaryOffset = 14,
  kDataEnd = 15,
};

// Private kinds are from 128 on.
inline bool IsKnown(Op op) {
  const auto kind = static_cast<uint8_t>(op);
  return (kind >= static_cast<uint8_t>(Op::kHeader) &&
          kind <= static_cast<uint8_t>(Op::kDataEnd)) ||
         kind >= 128;
}

// Of a record: its kind and the length of what follows.
inline constexpr size_t kRecordHead = 9;
inline constexpr size_t kFooterBytes = 20;

// Numbers are written as they lie in memory: x86-64 and ARM have them little-endian.
template <typename Number>
void Append(std::string& bytes, Number number) {
  bytes.append(reinterpret_cast<const char*>(&number), sizeof(number));
}
inline void AppendText(std::string& bytes, std::string_view text) {
  Append(bytes, static_cast<uint32_t>(text.size()));
  bytes.append(text);
}
inline void AppendRecord(std::string& bytes, Op op, std::string_view content) {
  Append(bytes, static_cast<uint8_t>(op));
  Append(bytes, static_cast<uint64_t>(content.size()));
  bytes.append(content);
}

// Reads what was appended, in turn. What does not fit any more is zero or empty, and `failed`.
class Fields {
 public:
  explicit Fields(std::string_view bytes) : bytes_(bytes) {}

  template <typename Number>
  Number Take() {
    Number number{};
    const std::string_view taken = TakeBytes(sizeof(number));
    if (!failed_) std::memcpy(&number, taken.data(), sizeof(number));
    return number;
  }
  std::string_view TakeText() { return TakeBytes(Take<uint32_t>()); }
  std::string_view TakeBytes(uint64_t count) {
    if (count > bytes_.size()) failed_ = true;
    if (failed_) return {};
    const std::string_view taken = bytes_.substr(0, count);
    bytes_.remove_prefix(count);
    return taken;
  }
  std::string_view rest() const { return bytes_; }
  bool failed() const { return failed_; }

 private:
  std::string_view bytes_;
  bool failed_ = false;
};

struct Record {
  Op op{};
  std::string_view content;
};

// The next record; nothing at the end, or if its content does not fit.
inline std::optional<Record> TakeRecord(Fields& fields) {
  if (fields.rest().empty()) return std::nullopt;
  const Op op{fields.Take<uint8_t>()};
  const std::string_view content = fields.TakeBytes(fields.Take<uint64_t>());
  if (fields.failed()) return std::nullopt;
  return Record{op, content};
}

}  // namespace silhouette::mcap
