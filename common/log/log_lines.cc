// SPDX-License-Identifier: Apache-2.0
#include "common/log/log_lines.h"

#include <spdlog/pattern_formatter.h>

#include <cstddef>
#include <cstdint>
#include <utility>

namespace silhouette {

namespace {

struct Character {
  uint32_t code = 0;
  size_t bytes = 1;
  bool valid = false;
};

// The character at the beginning of a text that is not empty; as RFC 3629 has it.
Character FirstOf(std::string_view text) {
  const auto byte = [&](size_t i) { return static_cast<uint8_t>(text[i]); };
  if (byte(0) < 0x80) return {byte(0), 1, true};
  const size_t bytes = byte(0) >= 0xf0 ? 4 : byte(0) >= 0xe0 ? 3 : 2;
  if (byte(0) < 0xc2 || byte(0) > 0xf4 || text.size() < bytes) return {};
  uint32_t code = byte(0) & (0xffu >> (bytes + 1));
  for (size_t i = 1; i < bytes; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return {};
    code = (code << 6) | (byte(i) & 0x3fu);
  }
  constexpr uint32_t kLeast[] = {0, 0, 0x80, 0x800, 0x10000};
  if (code < kLeast[bytes] || code > 0x10ffff || (code >= 0xd800 && code < 0xe000)) return {};
  return {code, bytes, true};
}

bool IsShown(const Character& character) {
  const uint32_t code = character.code;
  const bool control = code < 0x20 || (code >= 0x7f && code < 0xa0);
  const bool separator = code == 0x2028 || code == 0x2029;
  const bool direction = code == 0x61c || code == 0x200e || code == 0x200f ||
                         (code >= 0x202a && code <= 0x202e) || (code >= 0x2066 && code <= 0x2069);
  return character.valid && !control && !separator && !direction;
}

void AppendEscaped(std::string_view bytes, std::string& to) {
  if (bytes == "\n" || bytes == "\t" || bytes == "\r") {
    to += bytes == "\n" ? "\\n" : bytes == "\t" ? "\\t" : "\\r";
    return;
  }
  constexpr char kDigits[] = "0123456789abcdef";
  for (const char c : bytes) {
    const auto byte = static_cast<uint8_t>(c);
    to += {'\\', 'x', kDigits[byte >> 4], kDigits[byte & 15]};
  }
}

class LineFormatterOf final : public spdlog::formatter {
 public:
  explicit LineFormatterOf(std::unique_ptr<spdlog::formatter> inner) : inner_(std::move(inner)) {}

  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& to) override {
    const std::string text = Printable({message.payload.data(), message.payload.size()});
    spdlog::details::log_msg printable = message;
    printable.payload = text;
    inner_->format(printable, to);
  }
  std::unique_ptr<spdlog::formatter> clone() const override {
    return std::make_unique<LineFormatterOf>(inner_->clone());
  }

 private:
  const std::unique_ptr<spdlog::formatter> inner_;
};

}  // namespace

std::string Printable(std::string_view text) {
  std::string printable;
  printable.reserve(text.size());
  while (!text.empty()) {
    const Character character = FirstOf(text);
    const std::string_view bytes = text.substr(0, character.bytes);
    IsShown(character) ? void(printable += bytes) : AppendEscaped(bytes, printable);
    text.remove_prefix(character.bytes);
  }
  return printable;
}

std::unique_ptr<spdlog::formatter> LineFormatter(const std::string& pattern) {
  return std::make_unique<LineFormatterOf>(std::make_unique<spdlog::pattern_formatter>(pattern));
}

}  // namespace silhouette
