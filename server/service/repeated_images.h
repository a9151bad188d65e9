// SPDX-License-Identifier: Apache-2.0
// Whether the cameras live whose images are published: a frozen one repeats its images.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "absl/time/time.h"
#include "server/scene/clock.h"
#include "server/scene/make_scene.h"
#include "server/scene/recent_images.h"
#include "server/scene/served_database.h"

namespace silhouette {

// Remembers the published camera images of every view. Thread-safe.
//
// A camera is frozen if kFrozen of its images in a row, each taken after the one before, are byte
// for byte one of its recent ones (RecentImages). It lives again with its next new image. (With
// --live ProofOfLife tells more, and sooner.)
class RepeatedImages {
 public:
  static constexpr int kFrozen = 2;

  // `without_noise`: views whose source has no noise; they are never frozen.
  explicit RepeatedImages(std::set<std::string> without_noise)
      : without_noise_(std::move(without_noise)) {}

  // Takes the database's views whose cameras are frozen out of `input`, and says why they are
  // missing. `arrived`: when the images without a capture time were taken.
  void TakeOut(const ServedDatabase& database, const Moment& arrived, SceneInput& input);

 private:
  struct View {
    RecentImages recent;
    std::optional<uint64_t> digest;  // of the newest image
    absl::Duration captured;         // the newest
    int repeats = 0;                 // in a row
  };

  const std::set<std::string> without_noise_;
  std::mutex mutex_;
  std::map<std::string, View> views_;
};

}  // namespace silhouette
