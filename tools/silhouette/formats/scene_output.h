// Scenes in words, as JSON, and as a picture.
#pragma once

#include <map>
#include <string>

#include "absl/status/statusor.h"
#include "common/picture/picture.h"
#include "silhouette/scene.h"

namespace silhouette {

void PrintScene(const client::Scene& scene, bool json);

// Figure 9: a column per view with its camera image (as far as there is one), scene image and
// obstacle image. The scene comes with its planes. `cameras`: view -> file of the camera image.
absl::StatusOr<Picture> PictureOfScene(const client::Scene& scene,
                                       const std::map<std::string, std::string>& cameras);

}  // namespace silhouette
