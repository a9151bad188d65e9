// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/calibration/photographer.h"

#include <algorithm>
#include <optional>
#include <span>
#include <vector>

namespace silhouette::calibration_experiment {
namespace {

constexpr double kNoise = 2;      // standard deviation of a pixel, grey levels
constexpr double kMargin = 0.02;  // white paper around the print, metres

SimulationSettings SettingsOf(const NamedCamera& camera, const Board& board, uint64_t seed) {
  SimulationSettings settings;
  settings.cameras = {{camera.view, camera.model}};
  settings.boards = {{.board = board, .margin = kMargin}};
  settings.noise_sigma = kNoise;
  settings.seed = seed;
  return settings;
}

// `share` of a motion.
Eigen::Isometry3d PartOf(const Eigen::Isometry3d& motion, double share) {
  const Eigen::AngleAxisd turn(motion.linear());
  Eigen::Isometry3d part(Eigen::Translation3d(share * motion.translation()));
  part.rotate(Eigen::AngleAxisd(share * turn.angle(), turn.axis()));
  return part;
}

void Vignette(double share, cv::Mat& light) {
  const double middle_x = 0.5 * (light.cols - 1);
  const double middle_y = 0.5 * (light.rows - 1);
  const double corner = middle_x * middle_x + middle_y * middle_y;
  for (int y = 0; y < light.rows; ++y) {
    auto* row = light.ptr<float>(y);
    for (int x = 0; x < light.cols; ++x) {
      const double out = (x - middle_x) * (x - middle_x) + (y - middle_y) * (y - middle_y);
      row[x] *= static_cast<float>(1 - share * out / corner);
    }
  }
}

}  // namespace

Photographer::Photographer(const NamedCamera& camera, const Board& board, uint64_t seed)
    : settings_(SettingsOf(camera, board, seed)), renderer_(settings_, {}), sensor_(settings_) {}

cv::Mat Photographer::Render(const Eigen::Isometry3d& world_from_board) {
  const CameraIntrinsics& lens = settings_.cameras[0].model.intrinsics();
  cv::Mat light(lens.height, lens.width, CV_32FC1);
  const std::vector<std::optional<Eigen::Isometry3d>> boards{world_from_board};
  renderer_.Render(std::vector<size_t>{0}, nullptr, boards, {},
                   [&](size_t, int y, const Renderer::Row& row) {
                     std::ranges::copy(row.levels, light.ptr<float>(y));
                   });
  return light;
}

cv::Mat Photographer::Take(const Eigen::Isometry3d& world_from_board, const Shot& shot) {
  // Gauss and Legendre's three places stand for all of the exposure.
  constexpr double kOuter = 0.3872983346207417;  // from the middle, as shares of the exposure
  constexpr double kOuterWeight = 5.0 / 18;
  const auto at = [&](double share) {
    return Render(world_from_board * PartOf(shot.motion, share));
  };
  cv::Mat light = at(0);
  if (!shot.motion.isApprox(Eigen::Isometry3d::Identity())) {
    light = (1 - 2 * kOuterWeight) * light + kOuterWeight * at(-kOuter) + kOuterWeight * at(kOuter);
  }
  Vignette(shot.vignetting, light);
  Blur(light, shot.blur);
  cv::Mat image(light.size(), CV_8UC1);
  const auto width = static_cast<size_t>(light.cols);
  for (int y = 0; y < light.rows; ++y) {
    sensor_.Expose({light.ptr<float>(y), width}, shot.gain, {.frame = frame_, .y = y},
                   {image.ptr<uint8_t>(y), width});
  }
  ++frame_;
  return image;
}

}  // namespace silhouette::calibration_experiment
