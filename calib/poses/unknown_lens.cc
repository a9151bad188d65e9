// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/unknown_lens.h"

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"

namespace silhouette {
namespace {

// Of the workspace in the image. In simulated sessions with masks of 64 pixels, up to 90 % of the
// points outside of a region were off by more than the server's margin, 0.25 mask pixels, and at
// most 0.3 % of those inside.
constexpr double kMostUnknown = 0.01;
// Of the points outside: a part of the image with fewer is not named.
constexpr double kLeastNamed = 0.1;

constexpr std::array<const char*, 9> kParts = {"top left",    "top",    "top right",
                                               "left",        "middle", "right",
                                               "bottom left", "bottom", "bottom right"};

size_t PartOf(const Eigen::Vector2d& pixel, const CameraIntrinsics& lens) {
  const auto third = [](double at, int size) {
    return static_cast<size_t>(std::clamp(static_cast<int>(3 * (at + 0.5) / size), 0, 2));
  };
  return 3 * third(pixel.y(), lens.height) + third(pixel.x(), lens.width);
}

}  // namespace

UnknownLens FindUnknownLens(const PoseProblem& problem, const PoseView& view,
                            const Eigen::Isometry3d& camera_from_base) {
  if (!view.known || view.on_flange) return {};
  const CameraModel camera(view.lens, camera_from_base);
  int seen = 0;
  int unknown = 0;
  std::array<int, kParts.size()> parts{};
  for (const Eigen::Vector3d& point : problem.workspace) {
    const auto pixel = camera.Project(point);
    if (!pixel || !camera.Contains(*pixel)) continue;
    ++seen;
    if (view.known->Contains(*pixel)) continue;
    ++unknown;
    ++parts[PartOf(*pixel, view.lens)];
  }
  if (unknown <= kMostUnknown * seen) return {};
  std::vector<std::string> names;
  for (size_t i = 0; i < parts.size(); ++i) {
    if (parts[i] >= kLeastNamed * unknown) names.emplace_back(kParts[i]);
  }
  const double percent = 100.0 * unknown / seen;
  return {.sentence = absl::StrFormat(
              "view '%s': the lens is not known where it shows %.3g %% of the robot's workspace "
              "(%s of the image; valid_intrinsics_region of its camera model), so that masks may "
              "be off there by more than the server's margin; take images of a board there, too, "
              "and find the lens again with 'silhouette-calibrate intrinsics'",
              view.name, percent, FewOf(names)),
          .refused = view.known->sigma.has_value()};
}

}  // namespace silhouette
