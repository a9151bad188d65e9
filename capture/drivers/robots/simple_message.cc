#include "capture/drivers/robots/simple_message.h"

#include <bit>
#include <stdexcept>

#include "absl/strings/str_cat.h"

namespace silhouette::simple_message {
namespace {

constexpr size_t kWord = 4;
constexpr size_t kHeader = 3 * kWord;

uint32_t Swapped(uint32_t word) { return __builtin_bswap32(word); }

bool IsLength(uint32_t length) {
  return length >= kHeader && length <= kMostBytes && length % kWord == 0;
}

}  // namespace

std::vector<uint8_t> Encode(const Message& message, ByteOrder order) {
  const size_t length = kHeader + kWord * message.body.size();
  if (length > kMostBytes) {
    throw std::invalid_argument(absl::StrCat("a message of ", length, " bytes is too long"));
  }
  std::vector<uint8_t> bytes;
  bytes.reserve(kWord + length);
  const auto put = [&](uint32_t word) {
    for (size_t i = 0; i < kWord; ++i) {
      const size_t shift = order == ByteOrder::kLittle ? 8 * i : 8 * (kWord - 1 - i);
      bytes.push_back(static_cast<uint8_t>(word >> shift));
    }
  };
  put(static_cast<uint32_t>(length));
  for (const int32_t field : {message.type, message.comm, message.reply}) {
    put(static_cast<uint32_t>(field));
  }
  for (const uint32_t word : message.body) put(word);
  return bytes;
}

void MessageReader::Append(std::span<const uint8_t> bytes) {
  if (broken_.ok()) bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
}

uint32_t MessageReader::WordAt(size_t place) const {
  uint32_t word = 0;
  for (size_t i = 0; i < kWord; ++i) {
    const size_t shift = order_ == ByteOrder::kLittle ? 8 * i : 8 * (kWord - 1 - i);
    word |= uint32_t{bytes_[place + i]} << shift;
  }
  return word;
}

absl::StatusOr<std::optional<Message>> MessageReader::Next() {
  if (!broken_.ok()) return broken_;
  if (bytes_.size() < kWord) return std::nullopt;
  const uint32_t length = WordAt(0);
  if (!IsLength(length)) {
    broken_ = absl::DataLossError(
        IsLength(Swapped(length))
            ? "its messages are in the other byte order; change 'byte_order'"
            : absl::StrCat("what it sends is no simple_message: the length ", length));
    bytes_.clear();
    return broken_;
  }
  if (bytes_.size() < kWord + length) return std::nullopt;
  Message message;
  message.type = std::bit_cast<int32_t>(WordAt(kWord));
  message.comm = std::bit_cast<int32_t>(WordAt(2 * kWord));
  message.reply = std::bit_cast<int32_t>(WordAt(3 * kWord));
  for (size_t place = kWord + kHeader; place < kWord + length; place += kWord) {
    message.body.push_back(WordAt(place));
  }
  bytes_.erase(bytes_.begin(), bytes_.begin() + static_cast<ptrdiff_t>(kWord + length));
  return message;
}

}  // namespace silhouette::simple_message
