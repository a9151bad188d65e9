// SPDX-License-Identifier: Apache-2.0
#include "capture/session/reference_images.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <set>
#include <span>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "capture/session/history.h"
#include "capture/session/image_change.h"
#include "capture/session/visitor.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

storage::v1::Reference Stored(const Reference& reference, size_t images, absl::Time captured) {
  storage::v1::Reference stored;
  stored.set_mean_png(reference.MeanPng());
  stored.set_noise_png(reference.NoisePng());
  stored.set_images(static_cast<int>(images));
  SetTime(captured, *stored.mutable_time());
  return stored;
}

// Where what moved from the first image of a view on; empty: nothing did.
std::optional<MovedInView> FindMoved(size_t view, const std::vector<cv::Mat>& images) {
  const SegmentationSettings settings;
  const auto least = static_cast<int>(images[0].size().area() * MovedInView::kLeastShare);
  std::optional<MovedInView> found;
  int most = 0;
  for (const cv::Mat& image : std::span(images).subspan(1)) {
    const cv::Mat moved = ChangedAreas(images[0], image, nullptr, settings, least);
    const int pixels = cv::countNonZero(moved);
    if (pixels > std::exchange(most, std::max(most, pixels))) found = {view, image, moved};
  }
  return found;
}

}  // namespace

absl::StatusOr<storage::v1::References> TakeReferences(CellCameras& cameras, int count,
                                                       const CaptureObserver& observer,
                                                       std::vector<MovedInView>* moved) {
  if (count < 2) return absl::InvalidArgumentError("a reference needs at least two images");
  std::vector<std::vector<cv::Mat>> images;  // by view
  absl::Time captured;
  for (int i = 0; i < count; ++i) {
    if (observer.stop_requested()) {
      return absl::CancelledError("stopped; no reference images were stored");
    }
    ASSIGN_OR_RETURN(ImageSet set, cameras.Grab(observer.say));
    images.resize(set.images.size());
    for (size_t v = 0; v < images.size(); ++v) images[v].push_back(std::move(set.images[v]));
    captured = set.captured;
    observer.progress(static_cast<uint64_t>(i) + 1);
  }
  for (size_t v = 0; moved != nullptr && v < images.size(); ++v) {
    if (const auto found = FindMoved(v, images[v])) moved->push_back(*found);
  }
  storage::v1::References references;
  for (const std::vector<cv::Mat>& view : images) {
    *references.add_views() = Stored(Reference::FromImages(view), view.size(), captured);
  }
  return references;
}

absl::StatusOr<std::vector<Reference>> ReadReferences(const Database& database) {
  ASSIGN_OR_RETURN(const Snapshot snapshot, database.Read());
  ASSIGN_OR_RETURN(const auto stored, snapshot.References());
  if (!stored.has_value()) {
    return absl::NotFoundError("there are no reference images of the empty cell yet");
  }
  return ReferencesIn(*stored, database.cell());
}

absl::StatusOr<std::vector<Reference>> ReferencesIn(const storage::v1::References& stored,
                                                    const storage::v1::CellDescription& cell) {
  const auto& views = cell.views();
  if (stored.views_size() != views.size()) {
    return absl::DataLossError("there are reference images for another number of views");
  }
  std::vector<Reference> references;
  for (int v = 0; v < views.size(); ++v) {
    const storage::v1::Reference& view = stored.views(v);
    absl::StatusOr<Reference> reference = Reference::FromPng(view.mean_png(), view.noise_png());
    if (!reference.ok()) {
      return absl::DataLossError(absl::StrCat("view '", views[v].name(),
                                              "': ", reference.status().message(),
                                              "; take the reference images again"));
    }
    if (reference->size() != cv::Size(views[v].image_width(), views[v].image_height())) {
      return absl::FailedPreconditionError(absl::StrCat(
          "the reference image of the view '", views[v].name(), "' has ", reference->size().width,
          " x ", reference->size().height, " pixels, its camera image ", views[v].image_width(),
          " x ", views[v].image_height(), "; take the reference images again"));
    }
    references.push_back(*std::move(reference));
  }
  return references;
}

namespace {

// The digits of `i` in base `base`, mirrored at the point: evenly spread over 0 to 1.
double Halton(uint64_t i, uint64_t base) {
  double value = 0;
  double digit = 1;
  for (; i > 0; i /= base) {
    digit /= static_cast<double>(base);
    value += digit * static_cast<double>(i % base);
  }
  return value;
}

// 255 where the mask, or a pixel next to it, covers a pixel of a camera image.
cv::Mat CoveredBy(const Mask& mask, cv::Size size) {
  const Mask grown = Grown(mask, 1);
  cv::Mat covered(size, CV_8UC1);
  for (int y = 0; y < size.height; ++y) {
    const int row = y * mask.height() / size.height;
    for (int x = 0; x < size.width; ++x) {
      covered.at<uint8_t>(y, x) = grown.at(x * mask.width() / size.width, row) ? 255 : 0;
    }
  }
  return covered;
}

}  // namespace

std::vector<ConfigurationNumber> SpreadConfigurations(const Travel& travel, int count) {
  constexpr std::array<uint64_t, 7> kBases = {2, 3, 5, 7, 11, 13, 17};
  constexpr int kTries = 50;  // times `count`
  const ConfigurationGrid& grid = travel.grid();
  std::set<ConfigurationNumber> seen;
  std::vector<ConfigurationNumber> spread;
  for (int i = 1; i <= kTries * count && static_cast<int>(spread.size()) < count; ++i) {
    GridIndex index{};
    for (size_t j = 0; j < grid.joints().size(); ++j) {
      const int steps = grid.joints()[j].steps;
      const double place = Halton(static_cast<uint64_t>(i), kBases[j]) * steps;
      index[j] = std::min(static_cast<int>(place), steps - 1);
    }
    const ConfigurationNumber number = grid.NumberOf(index);
    if (travel.Forbidden(number) || !seen.insert(number).second) continue;
    spread.push_back(number);
  }
  return spread;
}

absl::StatusOr<storage::v1::References> TakeReferencesWithRobot(
    Database& database, const Travel& travel, Robot& robot, CameraRig& rig,
    const CaptureSettings& settings, int count, const CaptureObserver& observer) {
  ASSIGN_OR_RETURN(auto cell_robot, CellRobot::Create(database.cell(), robot));
  ASSIGN_OR_RETURN(auto cameras, CellCameras::Create(database.cell(), rig, settings.noisy_views));
  ASSIGN_OR_RETURN(const auto snapshot, database.Read());
  ASSIGN_OR_RETURN(const auto history, snapshot.CaptureHistory());
  const SuspectSpans suspects(history);
  const bool changed = !history.checks().empty() && !history.checks().rbegin()->alarm().empty();
  SessionParts parts{.database = &database,
                     .travel = &travel,
                     .robot = std::move(cell_robot),
                     .cameras = std::move(cameras),
                     .references = {},
                     .settings = settings,
                     .segmentation = {}};
  Visitor visitor(parts, observer);
  const auto views = static_cast<size_t>(database.cell().views_size());
  std::vector<std::vector<cv::Mat>> images(views);
  std::vector<std::vector<cv::Mat>> covered(views);
  uint64_t done = 0;
  for (const ConfigurationNumber number : SpreadConfigurations(travel, count)) {
    absl::StatusOr<Visit> visit = visitor.Go(number);
    if (!visit.ok()) visitor.StopRobot();
    if (absl::IsCancelled(visit.status())) {
      return absl::CancelledError("stopped; no reference images were stored");
    }
    if (!visit.ok()) return visit.status();
    observer.progress(++done);
    if (visit->outcome != Visit::Outcome::kTaken) {
      observer.say(visit->why);
      continue;
    }
    const auto record = snapshot.Find(number);
    const bool known = !changed && record.ok() && *record && !(*record)->excluded &&
                       !suspects.Contain((*record)->captured);
    for (size_t v = 0; v < views; ++v) {
      cv::Mat& image = visit->images.images[v];
      covered[v].push_back(known ? CoveredBy((*record)->masks[v], image.size()) : cv::Mat());
      images[v].push_back(std::move(image));
    }
  }
  if (images[0].size() < static_cast<size_t>(Reference::kFewestUncovered)) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the robot reached ", images[0].size(), " configurations; a reference with the ",
        "robot in it needs images of at least ", Reference::kFewestUncovered));
  }
  storage::v1::References references;
  for (size_t v = 0; v < views; ++v) {
    storage::v1::Reference& stored = *references.add_views();
    stored = Stored(Reference::FromImagesWithRobot(images[v], covered[v]), images[v].size(),
                    absl::Now());
    stored.set_with_robot(true);
  }
  return references;
}

}  // namespace silhouette
