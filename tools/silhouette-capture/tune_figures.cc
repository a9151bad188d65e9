// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-capture/tune_figures.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "capture/segmentation/down_sampling.h"
#include "capture/session/raw_archive.h"
#include "capture/session/reference_images.h"
#include "common/picture/image_file.h"
#include "db/status/status_macros.h"
#include "tools/cell/segmentation_text.h"

namespace silhouette {
namespace {

constexpr double kNearlyFound = 0.7;
constexpr double kHardlyFound = 1.4;

int64_t CountOf(const cv::Mat& set) { return cv::countNonZero(set); }

// How many pixels are in `a` and not in `b`.
int64_t OnlyIn(const Mask& a, const Mask& b) { return static_cast<int64_t>((a - b).Count()); }

}  // namespace

void TuneFigures::Add(const TuneFigures& other) {
  for (int64_t TuneFigures::*part :
       {&TuneFigures::pixels, &TuneFigures::foreground, &TuneFigures::areas, &TuneFigures::specks,
        &TuneFigures::close, &TuneFigures::gained, &TuneFigures::lost, &TuneFigures::empty_pixels,
        &TuneFigures::false_pixels, &TuneFigures::mask_pixels, &TuneFigures::mask_gained,
        &TuneFigures::mask_lost, &TuneFigures::recorded, &TuneFigures::recorded_added,
        &TuneFigures::recorded_removed}) {
    this->*part += other.*part;
  }
}

TunedImage Tune(const TuneImage& image, const std::vector<TuneVariant>& variants,
                MaskSize mask_size) {
  TunedImage tuned;
  std::vector<Mask> masks;
  for (const TuneVariant& variant : variants) {
    ForegroundSteps steps = StepsToForeground(image.image, *image.reference, variant.settings);
    if (image.recorded) steps.foreground |= steps.thin;
    tuned.steps.push_back(steps);
    masks.push_back(DownSample(steps.foreground, mask_size, variant.settings.min_cover));
    const cv::Mat& first = tuned.steps.front().foreground;
    TuneFigures figures;
    figures.pixels = static_cast<int64_t>(steps.foreground.total());
    figures.foreground = CountOf(steps.foreground);
    cv::Mat labels;
    figures.areas = cv::connectedComponents(steps.foreground, labels, 8) - 1;
    figures.specks = CountOf(steps.no_shadow & ~steps.foreground);
    figures.close = CountOf((steps.over_limit > kNearlyFound) & (steps.over_limit <= kHardlyFound));
    figures.gained = CountOf(steps.foreground & ~first);
    figures.lost = CountOf(first & ~steps.foreground);
    figures.empty_pixels = image.empty ? figures.pixels : 0;
    figures.false_pixels = image.empty ? figures.foreground : 0;
    figures.mask_pixels = static_cast<int64_t>(masks.back().Count());
    figures.mask_gained = OnlyIn(masks.back(), masks.front());
    figures.mask_lost = OnlyIn(masks.front(), masks.back());
    if (image.recorded && image.recorded->size() == mask_size) {
      figures.recorded = static_cast<int64_t>(image.recorded->Count());
      figures.recorded_added = OnlyIn(masks.back(), *image.recorded);
      figures.recorded_removed = OnlyIn(*image.recorded, masks.back());
    }
    tuned.figures.push_back(figures);
  }
  return tuned;
}

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
                      .image = ImageOfFile(path, cv::IMREAD_ANYCOLOR),
                      .reference = references[static_cast<size_t>(v)],
                      .empty = empty,
                      .recorded = std::nullopt};
      if (image.image.empty()) {
        return absl::InvalidArgumentError(absl::StrCat(
            "'", path, "' is no image that can be read, or is cut off: give PNG or JPEG files"));
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

namespace {

std::vector<std::string> Sweep(const SegmentationSettings& now) {
  std::vector<std::string> tries;
  const auto both = [&](const char* key, double value, double factor) {
    tries.push_back(absl::StrCat(key, ": ", value / factor));
    tries.push_back(absl::StrCat(key, ": ", value * factor));
  };
  const auto limit = [&](const char* key, double value, double usual) {
    if (value > 0) return both(key, value, 2);
    tries.push_back(absl::StrCat(key, ": ", usual));
  };
  both("noise_factor", now.noise_factor > 0 ? now.noise_factor : 6, 1.5);
  limit("min_difference", now.min_difference, SegmentationSettings{}.min_difference);
  limit("faint_difference", now.faint_difference, SegmentationSettings{}.faint_difference);
  limit("texture_difference", now.texture_difference, SegmentationSettings{}.texture_difference);
  if (now.faint_side > 3) {
    tries.push_back(absl::StrCat("faint_side: ", std::max(3, now.faint_side - 4)));
  }
  if (now.faint_side < SegmentationSettings::kMostFaintSide) {
    tries.push_back(absl::StrCat(
        "faint_side: ", std::min(SegmentationSettings::kMostFaintSide, now.faint_side + 4)));
  }
  tries.push_back(absl::StrCat("min_blob_pixels: ", now.min_blob_pixels / 3));
  tries.push_back(absl::StrCat("min_blob_pixels: ", 3 * std::max(now.min_blob_pixels, 4)));
  tries.push_back(now.shadows == Shadows::kIgnore ? "shadows: foreground" : "shadows: ignore");
  return tries;
}

}  // namespace

absl::StatusOr<std::vector<TuneVariant>> TuneVariants(const storage::v1::CellDescription& database,
                                                      const SegmentationSettings& of_cell_file,
                                                      const std::vector<std::string>& tries) {
  std::vector<TuneVariant> variants;
  const auto stored = SegmentationOf(database);
  if (stored.ok()) variants.push_back({"the database's", *stored});
  if (!stored.ok() || Describe(*stored) != Describe(of_cell_file)) {
    variants.push_back({"the cell file's", of_cell_file});
  }
  for (const std::string& text : tries.empty() ? Sweep(of_cell_file) : tries) {
    ASSIGN_OR_RETURN(const auto settings,
                     SegmentationIn(text, absl::StrCat("--try '", text, "'"), of_cell_file));
    if (settings != of_cell_file) {
      variants.push_back({text, settings});
    } else if (!tries.empty()) {
      return absl::InvalidArgumentError(
          absl::StrCat("--try '", text, "' changes nothing: the cell file says the same"));
    }
  }
  return variants;
}

}  // namespace silhouette
