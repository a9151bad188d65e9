// SPDX-License-Identifier: Apache-2.0
#include "server/scene/scene.h"

namespace silhouette {

Reason Scene::Blocked() const {
  for (const SceneDefect& defect : defects) {
    if (defect.reason != Reason::kViewMissing) return defect.reason;
  }
  return Reason::kNone;
}

}  // namespace silhouette
