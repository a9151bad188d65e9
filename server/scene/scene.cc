// SPDX-License-Identifier: Apache-2.0
#include "server/scene/scene.h"

#include <algorithm>

namespace silhouette {

absl::Duration Scene::AgeAt(const Moment& now) const {
  // An image stamped by a clock that is a little ahead is as old as its arrival.
  const absl::Duration at_arrival = std::max(arrived.time - oldest, absl::ZeroDuration());
  return at_arrival + (now.running - arrived.running);
}

Reason Scene::Blocked() const {
  for (const SceneDefect& defect : defects) {
    if (defect.reason != Reason::kViewMissing) return defect.reason;
  }
  return Reason::kNone;
}

}  // namespace silhouette
