// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette/formats/inputs.h"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/picture/files.h"
#include "common/picture/mask_png.h"
#include "common/times/times.h"
#include "db/status/status_macros.h"
#include "silhouette/messages.h"

namespace silhouette {
namespace {

absl::StatusOr<std::string> ReadText(const std::string& file) {
  std::string text;
  if (file == "-") {
    text.assign(std::istreambuf_iterator<char>(std::cin), {});
  } else {
    ASSIGN_OR_RETURN(text, ReadWholeFile(file));
  }
  if (text.starts_with("\xef\xbb\xbf")) text.erase(0, 3);  // some programs begin a text with it
  return text;
}

namespace fs = std::filesystem;

// The object under `key`; empty if there is none.
absl::StatusOr<nlohmann::ordered_json> Section(const nlohmann::ordered_json& index,
                                               const std::string& key) {
  const nlohmann::ordered_json section = index.value(key, nlohmann::ordered_json::object());
  if (section.is_object()) return section;
  return absl::InvalidArgumentError(absl::StrCat("'", key, "' must be {name: value}"));
}

absl::StatusOr<ImagesFolder> FromJson(const nlohmann::ordered_json& index, const fs::path& folder) {
  if (!index.is_object()) return absl::InvalidArgumentError("an object is expected");
  ImagesFolder images;
  if (index.contains("time")) {
    absl::Time time;
    std::string error;
    if (!index["time"].is_string() ||
        !absl::ParseTime(absl::RFC3339_full, index["time"].get<std::string>(), &time, &error)) {
      return absl::InvalidArgumentError(
          "'time' must be RFC 3339 text, as \"2026-01-31T12:00:00.5Z\"");
    }
    images.time = time;
  }
  ASSIGN_OR_RETURN(const nlohmann::ordered_json joints, Section(index, "joints"));
  for (const auto& [name, value] : joints.items()) {
    if (!value.is_number()) {
      return absl::InvalidArgumentError(absl::StrCat("joint '", name, "' must be a number"));
    }
    images.joints.push_back({name, value.get<double>()});
  }
  ASSIGN_OR_RETURN(const nlohmann::ordered_json views, Section(index, "views"));
  for (const auto& [name, file] : views.items()) {
    if (!file.is_string()) {
      return absl::InvalidArgumentError(absl::StrCat("view '", name, "' must be a file's name"));
    }
    images.images.push_back({name, (folder / file.get<std::string>()).string()});
  }
  if (images.images.empty()) return absl::InvalidArgumentError("'views' is missing or empty");
  return images;
}

}  // namespace

absl::StatusOr<std::vector<Configuration>> ReadConfigurations(const std::string& file,
                                                              TypedJoints& joints) {
  ASSIGN_OR_RETURN(const std::string text, ReadText(file));
  std::vector<Configuration> configurations;
  int line_number = 0;
  for (const absl::string_view line : absl::StrSplit(text, '\n')) {
    ++line_number;
    const std::vector<std::string> values = ValuesOnLine(line);
    if (values.empty()) continue;
    ASSIGN_OR_RETURN(Configuration configuration,
                     joints.Parse(values, absl::StrCat(file, ":", line_number, ": ")));
    configurations.push_back(std::move(configuration));
  }
  if (configurations.empty()) {
    return absl::InvalidArgumentError(
        file + ": it has no configuration; write one a line, such as 0.1,-30deg");
  }
  return configurations;
}

std::vector<std::string> ValuesOnLine(absl::string_view line) {
  const absl::string_view content =
      absl::StripAsciiWhitespace(line.substr(0, std::min(line.find('#'), line.size())));
  return absl::StrSplit(content, absl::ByAnyChar(", \t"), absl::SkipEmpty());
}

absl::StatusOr<PathFile> ReadPath(const std::string& file) {
  ASSIGN_OR_RETURN(const std::string text, ReadText(file));
  return ParsePath(text, file);
}

absl::StatusOr<ImagesFolder> ReadImagesFolder(const std::string& folder) {
  const std::string file = (fs::path(folder) / "images.json").string();
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(file));
  const nlohmann::ordered_json index =
      nlohmann::ordered_json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (index.is_discarded()) return absl::InvalidArgumentError(file + ": not JSON");
  auto images = FromJson(index, folder);
  if (images.ok()) return images;
  return absl::InvalidArgumentError(absl::StrCat(file, ": ", images.status().message()));
}

absl::StatusOr<v1::RegionPixels> ParseRegionPolygon(const std::string& text) {
  const absl::Status wrong = absl::InvalidArgumentError(absl::StrCat(
      "'", text,
      "' is not VIEW:x,y;x,y;x,y: a view and at least three corners in pixels of its mask; in most "
      "shells quotes belong around it"));
  // A view may have a colon in its name, corners have none.
  const size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon == 0) return wrong;
  v1::RegionPixels region;
  region.set_view(text.substr(0, colon));
  for (const absl::string_view corner : absl::StrSplit(text.substr(colon + 1), ';')) {
    const std::vector<absl::string_view> values = absl::StrSplit(corner, ',');
    double x = 0;
    double y = 0;
    if (values.size() != 2 || !absl::SimpleAtod(values[0], &x) ||
        !absl::SimpleAtod(values[1], &y)) {
      return wrong;
    }
    v1::Point& added = *region.mutable_polygon()->add_corners();
    added.set_x(x);
    added.set_y(y);
  }
  if (region.polygon().corners_size() < 3) return wrong;
  return region;
}

absl::StatusOr<v1::RegionPixels> ReadRegionMask(const std::string& text) {
  const auto parts = SplitAtEquals(text);
  if (!parts) return absl::InvalidArgumentError(absl::StrCat("'", text, "' is not VIEW=FILE"));
  ASSIGN_OR_RETURN(const Mask mask, ReadMaskPng(parts->second));
  v1::RegionPixels region;
  region.set_view(parts->first);
  *region.mutable_mask() = client::ToMessage(mask);
  return region;
}

std::optional<std::pair<std::string, std::string>> SplitAtEquals(const std::string& text) {
  const size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0 || equals + 1 == text.size()) return std::nullopt;
  return std::pair(text.substr(0, equals), text.substr(equals + 1));
}

}  // namespace silhouette
