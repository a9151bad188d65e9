// SPDX-License-Identifier: Apache-2.0
#include "server/scene/scene.h"

#include <algorithm>

namespace silhouette {

const CollisionImages& ResolvedImages::Get(const ObstacleImages& images, const EpipolarBands& bands,
                                           bool errors_convict) const {
  Entry& entry = entries_[errors_convict ? 1 : 0];
  std::call_once(entry.once,
                 [&] { entry.images = ResolvedObstacleImages(images, bands, errors_convict); });
  return entry.images;
}

const DistanceImages& SceneDistances::ToObstacles(const ObstacleImages& images) const {
  std::call_once(obstacles_.once,
                 [&] { obstacles_.distances = DistancesTo(ObstaclePlanes(images)); });
  return obstacles_.distances;
}

const DistanceImages& SceneDistances::ToResolved(const CollisionImages& resolved,
                                                 bool errors_convict) const {
  Entry& entry = resolved_[errors_convict ? 1 : 0];
  std::call_once(entry.once, [&] { entry.distances = DistancesTo(resolved); });
  return entry.distances;
}

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
