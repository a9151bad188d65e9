// SPDX-License-Identifier: Apache-2.0
// Scenes, explanations and the configuration space as pictures.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/picture/chart.h"
#include "common/picture/picture.h"
#include "silhouette/answers.h"
#include "silhouette/configuration_space.h"
#include "silhouette/v1/scene_service.pb.h"

namespace silhouette {

// Figure 9: a column per view with its camera image (as far as there is one), scene image and
// obstacle image. The scene comes with its planes. `cameras`: view -> file of the camera image.
absl::StatusOr<Picture> PictureOfScene(const v1::Scene& scene,
                                       const std::map<std::string, std::string>& cameras);

// What stands on the sheet of an explanation beside its images.
struct ExplanationNotes {
  std::vector<std::string> lines;              // under the verdict
  std::map<std::string, double> shapes;        // view -> height / width of its camera images
  std::map<std::string, std::string> cameras;  // view -> file of the camera image
};

// Writes the images of an explanation into a folder: a file per view and image, and
// explanation.png: a row per view, in the shape of its camera images, with the outline of the
// tested robot. Without a scene the sheet has words alone. Errors: of files, and InvalidArgument if
// one of `cameras` is no image.
absl::Status WriteExplanation(const client::Explanation& explanation, const ExplanationNotes& notes,
                              const std::string& folder);

// The joints of a chart, of a grid of two.
struct ChartedJoints {
  const ConfigurationGrid& grid;
  // Of each, whether it slides: then it is in metres, else, or where that is not known, in degrees.
  const std::vector<std::optional<bool>>& slides;
};

// The configuration space of two joints as a chart (Figure 8).
// InvalidArgument if the grid has not two joints. With clearance levels free cells are shaded by
// the greatest that they exceed. `slides`: as in ChartedJoints.
absl::StatusOr<ConfigurationChart> ChartOf(const client::ConfigurationSpace& space,
                                           const std::vector<std::optional<bool>>& slides,
                                           const std::string& title);

// A place in the chart: continuous joints wrapped into it.
ChartPoint ChartPointOf(const ChartedJoints& charted, const Configuration& configuration);

// The path in the chart, in pieces where it goes over the rim of a continuous joint.
std::vector<std::vector<ChartPoint>> ChartLines(const ChartedJoints& charted,
                                                const std::vector<Configuration>& waypoints);

}  // namespace silhouette
