// SPDX-License-Identifier: Apache-2.0
#include "capture/devices/camera_set.h"

#include <algorithm>
#include <chrono>
#include <future>
#include <stdexcept>
#include <utility>

#include "absl/strings/str_cat.h"
#include "capture/devices/running_clock.h"

namespace silhouette {
namespace {

// Where each source's images go in a set of `views`.
std::vector<std::vector<size_t>> PlacesOf(
    const std::vector<std::string>& views,
    const std::vector<std::unique_ptr<CameraSource>>& sources) {
  std::vector<std::vector<size_t>> places;
  std::vector<int> given(views.size());
  for (const auto& source : sources) {
    places.emplace_back();
    for (const std::string& view : source->views()) {
      const auto found = std::find(views.begin(), views.end(), view);
      if (found == views.end()) {
        throw std::invalid_argument(absl::StrCat("there is no view '", view, "'"));
      }
      places.back().push_back(static_cast<size_t>(found - views.begin()));
      ++given[places.back().back()];
    }
  }
  for (size_t v = 0; v < views.size(); ++v) {
    if (given[v] != 1) {
      throw std::invalid_argument(
          absl::StrCat("the view '", views[v], "' has ", given[v], " sources of images, not 1"));
    }
  }
  return places;
}

}  // namespace

CameraSet::CameraSet(std::vector<std::string> views,
                     std::vector<std::unique_ptr<CameraSource>> sources)
    : views_(std::move(views)),
      sources_(std::move(sources)),
      reaching_(sources_.size()),
      places_(PlacesOf(views_, sources_)),
      counts_(views_.size()) {}

CameraSet::~CameraSet() {
  // A camera that does not answer any more is waited for; all of them at the same time.
  std::vector<std::future<void>> closing;
  for (size_t s = 0; s < sources_.size(); ++s) {
    closing.push_back(std::async(std::launch::async, [this, s] {
      if (reaching_[s].opened.valid()) reaching_[s].opened.wait();
      sources_[s].reset();
    }));
  }
}

std::vector<absl::Status> CameraSet::ReachAll(bool complete) {
  bool wait = true;
  for (size_t s = 0; s < sources_.size(); ++s) {
    if (reaching_[s].opened.valid()) continue;
    if (sources_[s]->ready()) {
      wait = complete;
    } else {
      reaching_[s].opened =
          std::async(std::launch::async, [&source = *sources_[s]] { return source.Open(); });
    }
  }
  std::vector<absl::Status> there(sources_.size());
  for (size_t s = 0; s < sources_.size(); ++s) {
    auto& [opened, why] = reaching_[s];
    if (!opened.valid()) continue;
    if (wait || opened.wait_for(std::chrono::seconds(0)) == std::future_status::ready) {
      there[s] = why = opened.get();
    } else {
      there[s] = why.ok()
                     ? absl::UnavailableError("the connection to it was lost; it is looked for")
                     : why;
    }
  }
  return there;
}

std::vector<absl::Status> CameraSet::TriggerAll(bool complete) {
  std::vector<absl::Status> asked = ReachAll(complete);
  // A source that is not there may take seconds to say so: several do so at the same time.
  std::vector<std::future<void>> slow;
  bool all_there = true;
  for (size_t s = 0; s < sources_.size(); ++s) {
    if (!asked[s].ok()) continue;
    if (all_there) {
      asked[s] = sources_[s]->Trigger();
      all_there = asked[s].ok();
    } else {
      slow.push_back(
          std::async(std::launch::async, [this, s, &asked] { asked[s] = sources_[s]->Trigger(); }));
    }
  }
  for (std::future<void>& triggered : slow) triggered.get();
  return asked;
}

std::vector<absl::StatusOr<CameraImage>> CameraSet::Take(bool complete) {
  std::vector<absl::StatusOr<CameraImage>> images(views_.size());
  const auto fail = [&](size_t source, const absl::Status& status) {
    for (const size_t view : places_[source]) images[view] = Failed(source, view, status);
  };
  const std::vector<absl::Status> asked = TriggerAll(complete);
  const absl::Duration begin = RunningNow();
  for (size_t s = 0; s < sources_.size(); ++s) {  // even if one failed: nothing may be left over
    if (!asked[s].ok()) {
      fail(s, asked[s]);
      continue;
    }
    auto taken = sources_[s]->Wait(begin + sources_[s]->timeout());
    if (!taken.ok()) {
      fail(s, taken.status());
    } else if (taken->size() != places_[s].size()) {
      fail(s, absl::InternalError(absl::StrCat("it gave ", taken->size(), " images instead of ",
                                               places_[s].size())));
    } else {
      for (size_t i = 0; i < taken->size(); ++i) {
        const size_t view = places_[s][i];
        absl::StatusOr<CameraImage>& image = (*taken)[i];
        if (image.ok()) ++counts_[view].taken;
        images[view] = image.ok() ? std::move(image) : Failed(s, view, image.status());
      }
    }
  }
  return images;
}

std::vector<absl::StatusOr<CameraImage>> CameraSet::GrabEach() { return Take(/*complete=*/false); }

absl::StatusOr<std::vector<CameraImage>> CameraSet::Grab() {
  std::vector<CameraImage> images;
  for (absl::StatusOr<CameraImage>& image : Take(/*complete=*/true)) {
    if (!image.ok()) return image.status();
    images.push_back(*std::move(image));
  }
  return images;
}

absl::Status CameraSet::Failed(size_t source, size_t view, const absl::Status& status) {
  absl::IsDataLoss(status) ? ++counts_[view].incomplete : ++counts_[view].lost;
  std::string message(status.message());
  if (places_[source].size() == 1) {
    message = absl::StrCat("the camera of the view '", views_[view], "': ", message);
  }
  // An image that is not whole may be whole the next time.
  return absl::Status(absl::IsDataLoss(status) ? absl::StatusCode::kUnavailable : status.code(),
                      message);
}

absl::Duration SkewOf(const std::vector<CameraImage>& images) {
  if (images.empty()) return absl::ZeroDuration();
  const auto [oldest, newest] = std::minmax_element(
      images.begin(), images.end(),
      [](const CameraImage& a, const CameraImage& b) { return a.captured < b.captured; });
  return newest->captured - oldest->captured;
}

}  // namespace silhouette
