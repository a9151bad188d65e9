// SPDX-License-Identifier: Apache-2.0
#include "server/service/repeated_images.h"

#include <xxhash.h>

#include <variant>

#include "absl/strings/str_cat.h"

namespace silhouette {
namespace {

// An image whose time is nearer than this to that of the one before is that image, sent again: its
// sender may have read the server's clock again.
constexpr absl::Duration kSameTime = absl::Milliseconds(5);

}  // namespace

void RepeatedImages::TakeOut(const ServedDatabase& database, const Moment& arrived,
                             SceneInput& input) {
  const std::lock_guard lock(mutex_);
  for (ViewInput& view : input.views) {
    const auto* image = std::get_if<EncodedImage>(&view.image);
    if (image == nullptr || !database.ViewOf(view.view) || without_noise_.contains(view.view)) {
      continue;
    }
    const absl::Duration captured = view.captured.value_or(arrived).running;
    if (captured > arrived.running + kClockTolerance) continue;  // MakeScene refuses it
    const uint64_t digest = XXH3_64bits(image->bytes.data(), image->bytes.size());
    View& known = views_[view.view];
    const absl::Duration later = captured - known.captured;
    if (!known.digest || later > (digest == *known.digest ? kSameTime : absl::ZeroDuration())) {
      known.repeats = known.recent.Repeats(digest) ? known.repeats + 1 : 0;
      known.digest = digest;
      known.captured = captured;
    }
    if (known.repeats < kFrozen) continue;
    input.without_views[view.view] = absl::StrCat(
        "the camera is frozen: ", known.repeats,
        " images in a row repeat earlier ones, byte for byte, under new time stamps; restart the "
        "camera; if its source has no noise (a file, a simulator, strong compression), state "
        "'noise: none' at its view in the cell file");
    view.image = LeftOut{};
  }
}

}  // namespace silhouette
