#include "tools/silhouette-experiments/calibration/photographs.h"

#include <algorithm>

#include "capture/sim/blur.h"

namespace silhouette::calibration_experiment {
namespace {

SimulationSettings SettingsOf(const NamedCamera& camera, const Board& board, uint64_t seed) {
  SimulationSettings settings;
  settings.cameras = {{camera.view, camera.model}};
  settings.boards = {{.board = board, .margin = 0.02}};
  settings.noise_sigma = Photographer::kNoise;
  settings.blur = Photographer::kBlur;
  settings.seed = seed;
  return settings;
}

}  // namespace

Photographer::Photographer(const NamedCamera& camera, const Board& board, uint64_t seed)
    : settings_(SettingsOf(camera, board, seed)), renderer_(settings_, {}), sensor_(settings_) {}

std::vector<uint8_t> Photographer::Take(const Eigen::Isometry3d& world_from_board) {
  const CameraIntrinsics& lens = settings_.cameras[0].model.intrinsics();
  const auto width = static_cast<size_t>(lens.width);
  std::vector<float> sharp(width * static_cast<size_t>(lens.height));
  const std::vector<std::optional<Eigen::Isometry3d>> boards{world_from_board};
  renderer_.Render(std::vector<size_t>{0}, nullptr, boards, {},
                   [&](size_t, int y, const Renderer::Row& row) {
                     std::copy(row.levels.begin(), row.levels.end(),
                               sharp.begin() + static_cast<ptrdiff_t>(y) * std::ssize(row.levels));
                   });
  Blur(sharp, lens.width, settings_.blur);
  std::vector<uint8_t> pixels(sharp.size());
  for (int y = 0; y < lens.height; ++y) {
    const size_t first = static_cast<size_t>(y) * width;
    sensor_.Expose(std::span(sharp).subspan(first, width), {}, {.frame = frame_, .y = y},
                   std::span(pixels).subspan(first, width));
  }
  ++frame_;
  return pixels;
}

}  // namespace silhouette::calibration_experiment
