// SPDX-License-Identifier: Apache-2.0
#include "capture/segmentation/settings.h"

#include <charconv>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace silhouette {
namespace {

// The shortest decimal that reads back as the same number.
std::string Number(double value) {
  char buffer[32];
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof(buffer), value);
  return std::string(buffer, end);
}

struct Entry {
  std::string key;
  std::string value;
};

// All keys in alphabetical order, the same ones always.
std::vector<Entry> Entries(const SegmentationSettings& settings) {
  return {{"clean_up_radius", absl::StrCat(settings.clean_up_radius)},
          {"faint_difference", Number(settings.faint_difference)},
          {"faint_side", absl::StrCat(settings.faint_side)},
          {"follow_brightness", settings.follow_brightness ? "true" : "false"},
          {"keep_thin_parts", settings.keep_thin_parts ? "true" : "false"},
          {"min_blob_pixels", absl::StrCat(settings.min_blob_pixels)},
          {"min_cover", Number(settings.min_cover)},
          {"min_difference", Number(settings.min_difference)},
          {"noise_factor", Number(settings.noise_factor)},
          {"shadows", settings.shadows == Shadows::kIgnore ? "ignore" : "foreground"},
          {"texture_difference", Number(settings.texture_difference)}};
}

bool CameLater(const std::string& key) {
  return key == "faint_difference" || key == "faint_side" || key == "keep_thin_parts" ||
         key == "shadows" || key == "texture_difference";
}

}  // namespace

std::string Describe(const SegmentationSettings& settings) {
  const std::vector<Entry> left_out = Entries(LeftOutOfDescriptions());
  const std::vector<Entry> entries = Entries(settings);
  const bool looks_around = settings.faint_difference > 0 || settings.texture_difference > 0;
  std::string text;
  for (size_t i = 0; i < entries.size(); ++i) {
    const auto& [key, value] = entries[i];
    if (CameLater(key) && value == left_out[i].value) continue;
    if (key == "faint_side" && !looks_around) continue;
    absl::StrAppend(&text, key, ": ", value, "\n");
  }
  return text;
}

SegmentationSettings LeftOutOfDescriptions() {
  return {.faint_difference = 0,
          .texture_difference = 0,
          .faint_side = 5,
          .keep_thin_parts = false,
          .shadows = Shadows::kForeground};
}

std::string CellFileLine(const SegmentationSettings& settings) {
  const std::vector<Entry> usual = Entries({});
  const std::vector<Entry> entries = Entries(settings);
  std::vector<std::string> keys;
  for (size_t i = 0; i < entries.size(); ++i) {
    if (entries[i].value == usual[i].value) continue;
    keys.push_back(absl::StrCat(entries[i].key, ": ", entries[i].value));
  }
  return absl::StrCat("segmentation: {", absl::StrJoin(keys, ", "), "}");
}

}  // namespace silhouette
