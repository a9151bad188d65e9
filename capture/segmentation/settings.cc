#include "capture/segmentation/settings.h"

#include <charconv>

#include "absl/strings/str_cat.h"

namespace silhouette {
namespace {

// The shortest decimal that reads back as the same number.
std::string Number(double value) {
  char buffer[32];
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof(buffer), value);
  return std::string(buffer, end);
}

}  // namespace

std::string Describe(const SegmentationSettings& settings) {
  std::string text;
  absl::StrAppend(&text, "clean_up_radius: ", settings.clean_up_radius, "\n");
  const SegmentationSettings usual;
  if (settings.faint_difference > 0) {
    absl::StrAppend(&text, "faint_difference: ", Number(settings.faint_difference), "\n");
  }
  if (settings.faint_side != usual.faint_side) {
    absl::StrAppend(&text, "faint_side: ", settings.faint_side, "\n");
  }
  absl::StrAppend(&text, "follow_brightness: ", settings.follow_brightness ? "true" : "false",
                  "\n");
  absl::StrAppend(&text, "min_blob_pixels: ", settings.min_blob_pixels, "\n");
  absl::StrAppend(&text, "min_cover: ", Number(settings.min_cover), "\n");
  absl::StrAppend(&text, "min_difference: ", Number(settings.min_difference), "\n");
  absl::StrAppend(&text, "noise_factor: ", Number(settings.noise_factor), "\n");
  if (settings.shadows != usual.shadows) absl::StrAppend(&text, "shadows: ignore\n");
  if (settings.texture_difference > 0) {
    absl::StrAppend(&text, "texture_difference: ", Number(settings.texture_difference), "\n");
  }
  return text;
}

}  // namespace silhouette
