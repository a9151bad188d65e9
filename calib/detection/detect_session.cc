// SPDX-License-Identifier: Apache-2.0
#include "calib/detection/detect_session.h"

#include <algorithm>
#include <set>
#include <tuple>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace silhouette {
namespace {

constexpr double kMostImageBlur = 1.5;  // pixels
constexpr double kLeastSize = 20;       // pixels, of a tag
constexpr size_t kMostListed = 8;       // ids in a message

// "tagStandard41h12 3, 4, 7"
std::string NamesOf(const std::vector<DetectedTag>& tags) {
  std::map<std::string, std::set<int>> ids;
  for (const DetectedTag& tag : tags) ids[tag.family].insert(tag.tag);
  std::vector<std::string> names;
  for (const auto& [family, all] : ids) {
    std::vector<int> some(all.begin(), all.end());
    const bool more = some.size() > kMostListed;
    if (more) some.resize(kMostListed);
    names.push_back(absl::StrCat(family, " ", absl::StrJoin(some, ", "), more ? ", ..." : ""));
  }
  return absl::StrJoin(names, "; ");
}

std::string SizeText(const ImageTags& image) {
  return absl::StrCat(image.size.width, "x", image.size.height);
}

// What is weak in an image by itself.
std::vector<ImageWarning> WarningsOf(const ImageTags& image) {
  std::vector<ImageWarning> warnings;
  if (image.mirrored) {
    warnings.push_back(
        {"tags are mirrored (turn the camera's image over again, or print the board unmirrored)",
         ""});
  } else if (image.tags.empty() && image.foreign.empty() && image.ambiguous.empty()) {
    warnings.push_back({"none of the boards is seen", ""});
  }
  if (!image.ambiguous.empty()) {
    warnings.push_back({"tags at several places are left out (were they printed twice?)",
                        NamesOf(image.ambiguous)});
  }
  if (!image.foreign.empty()) {
    warnings.push_back({"tags of no board are left out", NamesOf(image.foreign)});
  }
  if (image.MedianBlur() > kMostImageBlur) {
    warnings.push_back({"edges are blurred (focus, hold still, or give more light)",
                        absl::StrFormat("by %.1f px", image.MedianBlur())});
  }
  if (!image.tags.empty() && image.MeanSize() < kLeastSize) {
    warnings.push_back({absl::StrFormat("tags are smaller than %.0f px (come nearer, or print them "
                                        "larger)",
                                        kLeastSize),
                        absl::StrFormat("%.0f px", image.MeanSize())});
  }
  if (image.at_rim > 0) {
    warnings.push_back({"tags at the image's very rim have less exact corners",
                        absl::StrCat(image.at_rim, " tag(s)")});
  }
  return warnings;
}

}  // namespace

absl::Status DetectSession::Add(ImageTags tags, const std::string& source) {
  const auto [first, fresh] = first_of_view_.emplace(tags.view, images_.size());
  if (!fresh && images_[first->second].tags.size != tags.size) {
    const SessionImage& other = images_[first->second];
    return absl::InvalidArgumentError(absl::StrCat(
        "view '", tags.view, "' has images of different sizes: ", other.source, " ",
        SizeText(other.tags), ", ", source, " ", SizeText(tags),
        "; a calibration holds for one size, so keep those of the size that is used later"));
  }
  const auto [same, unique] = by_digest_.emplace(tags.digest, images_.size());
  bool copy = false;
  if (!unique && !tags.tags.empty()) {
    const SessionImage& other = images_[same->second];
    if (other.tags.view != tags.view) {
      return absl::InvalidArgumentError(
          absl::StrCat(source, " (view '", tags.view, "') and ", other.source, " (view '",
                       other.tags.view, "') are the same picture; mend the views' patterns"));
    }
    copy = true;
  }
  if (!copy) coverage_[tags.view].Add(tags);
  images_.push_back({.tags = std::move(tags), .source = source, .copy = copy, .warnings = {}});
  return absl::OkStatus();
}

void DetectSession::Judge() {
  std::ranges::sort(images_, {}, [](const SessionImage& image) {
    return std::tie(image.tags.view, image.tags.frame);
  });
  first_of_view_.clear();
  by_digest_.clear();
  for (size_t i = 0; i < images_.size(); ++i) {
    SessionImage& image = images_[i];
    first_of_view_.emplace(image.tags.view, i);
    const auto [same, unique] = by_digest_.emplace(image.tags.digest, i);
    image.copy = !unique && !image.tags.tags.empty();
    image.warnings = WarningsOf(image.tags);
    if (image.copy) {
      image.warnings.push_back({"the picture is a copy of another and left out",
                                absl::StrCat("as frame '", images_[same->second].tags.frame, "'")});
      continue;
    }
    for (size_t k = first_of_view_.at(image.tags.view); k < i; ++k) {
      if (images_[k].copy || !ShowTheSame(images_[k].tags, image.tags)) continue;
      image.warnings.push_back({"nothing moved since another one, so it adds no information",
                                absl::StrCat("as frame '", images_[k].tags.frame, "'")});
      break;
    }
  }
}

std::vector<TagSighting> DetectSession::Sightings() const {
  std::vector<TagSighting> all;
  for (const SessionImage& image : images_) {
    if (image.copy) continue;
    const std::vector<TagSighting> some = SightingsOf(image.tags);
    all.insert(all.end(), some.begin(), some.end());
  }
  return all;
}

absl::Status DetectSession::CheckThatTagsWereSeen() const {
  std::vector<DetectedTag> foreign;
  size_t mirrored = 0;
  for (const SessionImage& image : images_) {
    if (!image.tags.tags.empty()) return absl::OkStatus();
    foreign.insert(foreign.end(), image.tags.foreign.begin(), image.tags.foreign.end());
    mirrored += image.tags.mirrored ? 1 : 0;
  }
  const std::string none =
      absl::StrCat("none of ", images_.size(), " images shows one of the boards");
  if (mirrored > 0) {
    return absl::NotFoundError(
        absl::StrCat(none, ", but ", mirrored,
                     " would if they were mirrored: turn the camera's images over "
                     "again, or print the boards unmirrored"));
  }
  if (!foreign.empty()) {
    return absl::NotFoundError(
        absl::StrCat(none, ", but they show ", NamesOf(foreign), "; is --boards the right file?"));
  }
  return absl::NotFoundError(absl::StrCat(
      none,
      "; look at them: whole tags of 15 pixels and more, or a whole chessboard, must be in the "
      "image, sharp and with a white rim"));
}

}  // namespace silhouette
