#include "tools/silhouette-capture/tune_images.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "capture/session/raw_archive.h"
#include "capture/session/reference_images.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

using References = std::vector<std::shared_ptr<const Reference>>;

absl::StatusOr<References> Shared(absl::StatusOr<std::vector<Reference>> references) {
  if (!references.ok()) return references.status();
  References shared;
  for (Reference& reference : *references) {
    shared.push_back(std::make_shared<const Reference>(std::move(reference)));
  }
  return shared;
}

// `most` of the numbers, evenly spread.
std::vector<ConfigurationNumber> Some(const std::vector<ConfigurationNumber>& numbers, int most) {
  const size_t count = std::min(numbers.size(), static_cast<size_t>(most));
  std::vector<ConfigurationNumber> some;
  for (size_t i = 0; i < count; ++i) some.push_back(numbers[i * numbers.size() / count]);
  return some;
}

absl::StatusOr<References> ReferencesOfRaw(const Snapshot& snapshot,
                                           const storage::v1::CellDescription& cell, uint64_t id) {
  ASSIGN_OR_RETURN(const auto stored, snapshot.ReferencesOf(id));
  return Shared(ReferencesIn(stored, cell));
}

}  // namespace

absl::StatusOr<std::vector<TuneImage>> RawImagesToTune(const Database& database, int most) {
  ASSIGN_OR_RETURN(const auto snapshot, database.Read());
  ASSIGN_OR_RETURN(const auto numbers, snapshot.RawImageNumbers());
  std::map<uint64_t, References> references;
  std::vector<TuneImage> images;
  for (const ConfigurationNumber number : Some(numbers, most)) {
    const auto robot = snapshot.Find(number);
    const bool recorded = robot.ok() && robot->has_value() && !(*robot)->masks.empty();
    for (int v = 0; v < database.cell().views_size(); ++v) {
      const auto place = static_cast<size_t>(v);
      ASSIGN_OR_RETURN(const auto raw, snapshot.FindRawImage(number, v));
      if (!raw.has_value()) continue;
      const uint64_t id = raw->references;
      if (!references.contains(id)) {
        ASSIGN_OR_RETURN(auto read, ReferencesOfRaw(snapshot, database.cell(), id));
        references[id] = std::move(read);
      }
      TuneImage image{.name = absl::StrCat(number, ", ", database.cell().views(v).name()),
                      .view = v,
                      .image = ImageInPng(raw->png),
                      .reference = references[id][place],
                      .empty = false,
                      .recorded = std::nullopt};
      if (image.image.size() != image.reference->size()) {
        return absl::DataLossError(absl::StrCat("the raw image of configuration ", number,
                                                " in the view '", database.cell().views(v).name(),
                                                "' cannot be read"));
      }
      if (recorded) image.recorded = (*robot)->masks[place];
      images.push_back(std::move(image));
    }
  }
  return images;
}

absl::StatusOr<std::vector<TuneImage>> FolderImagesToTune(const Database& database,
                                                          const std::string& folder, bool empty) {
  ASSIGN_OR_RETURN(const auto references, Shared(ReadReferences(database)));
  std::vector<TuneImage> images;
  std::string wanted;
  for (int v = 0; v < database.cell().views_size(); ++v) {
    const std::string& view = database.cell().views(v).name();
    absl::StrAppend(&wanted, v == 0 ? "" : ", ", view, ".png");
    for (const char* extension : {".png", ".jpg", ".jpeg"}) {
      const std::string path = absl::StrCat(folder, "/", view, extension);
      if (!std::filesystem::exists(path)) continue;
      TuneImage image{.name = path,
                      .view = v,
                      .image = cv::imread(path, cv::IMREAD_ANYCOLOR),
                      .reference = references[static_cast<size_t>(v)],
                      .empty = empty,
                      .recorded = std::nullopt};
      if (image.image.empty()) {
        return absl::InvalidArgumentError(
            absl::StrCat("'", path, "' is no image that can be read: give PNG or JPEG files"));
      }
      if (image.image.size() != image.reference->size()) {
        return absl::InvalidArgumentError(absl::StrCat(
            "'", path, "' has ", image.image.cols, " x ", image.image.rows,
            " pixels, the reference image of its view ", image.reference->size().width, " x ",
            image.reference->size().height, ": give images as the camera takes them"));
      }
      images.push_back(std::move(image));
      break;
    }
  }
  if (!images.empty()) return images;
  return absl::NotFoundError(absl::StrCat("the folder '", folder,
                                          "' has no image of a view; they are called ", wanted,
                                          " or so (.jpg, .jpeg)"));
}

}  // namespace silhouette
