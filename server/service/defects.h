// SPDX-License-Identifier: Apache-2.0
// Why nothing is free, in sentences that name the thing: the scene's defects, its age, what the
// devices do if the server acquires images itself, and what happened while an answer was made.
#pragma once

#include <string>
#include <vector>

#include "server/scene/scene.h"
#include "server/scene/scene_store.h"
#include "server/service/serving_settings.h"

namespace silhouette {

// The defects of a scene, with its age at the moment `now`.
std::vector<SceneDefect> DefectsOf(const Scene& scene, const ServingSettings& settings,
                                   const Moment& now);

// The same of what an answer rests on. `blocked`: why every verdict is unknown, kNone if some are
// known.
std::vector<SceneDefect> DefectsOf(const Served& served, Reason blocked,
                                   const ServingSettings& settings, const Moment& now);

// Why there is no scene: `without_scene` of Served.
std::string WhyNoScene(Reason without_scene, const ServingSettings& settings);

}  // namespace silhouette
