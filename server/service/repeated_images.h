// SPDX-License-Identifier: Apache-2.0
// Whether the cameras live whose images are published: a frozen one repeats its image.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <utility>

#include "absl/time/time.h"
#include "server/scene/clock.h"
#include "server/scene/make_scene.h"
#include "server/scene/served_database.h"

namespace silhouette {

// Remembers the newest published camera image of every view. Thread-safe.
//
// A camera is frozen if kFrozen of its images in a row are the same, byte for byte, each taken
// after the one before: noise makes every image another one. It lives again with its next other
// image. (With --live ProofOfLife tells more, and sooner.)
class RepeatedImages {
 public:
  static constexpr int kFrozen = 3;

  // `without_noise`: views whose source has no noise; they are never frozen.
  explicit RepeatedImages(std::set<std::string> without_noise)
      : without_noise_(std::move(without_noise)) {}

  // Takes the database's views whose cameras are frozen out of `input`, and says why they are
  // missing. `arrived`: when the images without a capture time were taken.
  void TakeOut(const ServedDatabase& database, const Moment& arrived, SceneInput& input);

 private:
  struct Image {
    uint64_t digest = 0;
    absl::Duration captured;
    int times = 0;  // in a row
  };

  const std::set<std::string> without_noise_;
  std::mutex mutex_;
  std::map<std::string, Image> newest_;  // by view
};

}  // namespace silhouette
