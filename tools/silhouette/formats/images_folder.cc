#include "tools/silhouette/formats/images_folder.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

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

}  // namespace silhouette
