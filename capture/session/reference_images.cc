#include "capture/session/reference_images.h"

#include <cstdint>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "db/status/status_macros.h"

namespace silhouette {

absl::StatusOr<storage::v1::References> TakeReferences(CellCameras& cameras, int count,
                                                       const CaptureObserver& observer) {
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
  storage::v1::References references;
  for (const std::vector<cv::Mat>& view : images) {
    const Reference reference = Reference::FromImages(view);
    storage::v1::Reference& stored = *references.add_views();
    stored.set_mean_png(reference.MeanPng());
    stored.set_noise_png(reference.NoisePng());
    stored.set_images(count);
    const absl::Duration since_epoch = captured - absl::UnixEpoch();
    stored.mutable_time()->set_seconds(absl::ToInt64Seconds(since_epoch));
    stored.mutable_time()->set_nanos(
        static_cast<int32_t>(absl::ToInt64Nanoseconds(since_epoch) % 1'000'000'000));
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
                                              "; take the reference images anew"));
    }
    if (reference->size() != cv::Size(views[v].image_width(), views[v].image_height())) {
      return absl::FailedPreconditionError(absl::StrCat(
          "the reference image of the view '", views[v].name(), "' has ", reference->size().width,
          " x ", reference->size().height, " pixels, its camera image ", views[v].image_width(),
          " x ", views[v].image_height(), "; take the reference images anew"));
    }
    references.push_back(*std::move(reference));
  }
  return references;
}

}  // namespace silhouette
