#include "server/scene/image_header.h"

#include <cstddef>
#include <cstdint>

namespace silhouette {
namespace {

// With their lengths, as they contain zeros.
constexpr std::string_view kPngStart("\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR", 16);
constexpr std::string_view kPngEnd("\0\0\0\0IEND\xae\x42\x60\x82", 12);
constexpr std::string_view kJpegStart("\xff\xd8\xff");
constexpr std::string_view kJpegEnd("\xff\xd9");

// A big-endian number of `count` bytes; `at + count` is within `bytes`.
uint32_t NumberAt(std::string_view bytes, size_t at, size_t count) {
  uint32_t number = 0;
  for (size_t i = 0; i < count; ++i) number = number << 8 | static_cast<uint8_t>(bytes[at + i]);
  return number;
}

std::optional<ImageSize> PngSize(std::string_view bytes) {
  if (bytes.size() < kPngStart.size() + 8 || !bytes.ends_with(kPngEnd)) return std::nullopt;
  return ImageSize{static_cast<int>(NumberAt(bytes, kPngStart.size(), 4)),
                   static_cast<int>(NumberAt(bytes, kPngStart.size() + 4, 4))};
}

// Whether a JPEG marker starts a frame: SOF0 to SOF15 without DHT, JPG and DAC.
bool StartsFrame(uint8_t marker) {
  return marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
}

std::optional<ImageSize> JpegSize(std::string_view bytes) {
  // Some cameras pad their images with zeros.
  while (bytes.ends_with('\0')) bytes.remove_suffix(1);
  if (!bytes.ends_with(kJpegEnd)) return std::nullopt;
  size_t at = 2;
  while (at + 9 <= bytes.size() && bytes[at] == '\xff') {
    const auto marker = static_cast<uint8_t>(bytes[at + 1]);
    if (marker == 0xff) {  // a fill byte
      ++at;
      continue;
    }
    if (StartsFrame(marker)) {
      return ImageSize{static_cast<int>(NumberAt(bytes, at + 7, 2)),
                       static_cast<int>(NumberAt(bytes, at + 5, 2))};
    }
    at += 2 + NumberAt(bytes, at + 2, 2);
  }
  return std::nullopt;
}

}  // namespace

std::optional<ImageSize> SizeOfWholeImage(std::string_view bytes) {
  if (bytes.starts_with(kPngStart)) return PngSize(bytes);
  if (bytes.starts_with(kJpegStart)) return JpegSize(bytes);
  return std::nullopt;
}

}  // namespace silhouette
