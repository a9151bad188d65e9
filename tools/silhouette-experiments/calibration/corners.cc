#include <opencv2/core/mat.hpp>

#include "calib/detection/tag_detector.h"
#include "tools/silhouette-experiments/calibration/photographs.h"
#include "tools/silhouette-experiments/calibration/rig.h"
#include "tools/silhouette-experiments/calibration/trials.h"

namespace silhouette::calibration_experiment {
namespace {

constexpr size_t kFrames = 6;
constexpr double kLeastSize = 60;  // of a tag's shortest side, pixels

Board LargeTags() {
  return Board({.name = "large", .rows = 2, .columns = 3, .tag_size = 0.15, .gap = 0.15});
}

void AddErrors(const std::vector<TagSighting>& truth, const std::vector<DetectedTag>& found,
               RootMeanSquare& errors) {
  for (const TagSighting& sighting : truth) {
    for (const DetectedTag& tag : found) {
      if (tag.tag != sighting.tag) continue;
      for (size_t i = 0; i < 4; ++i) {
        errors.Add((tag.corners[i] - sighting.corners[i]).squaredNorm(), 2);
      }
    }
  }
}

}  // namespace

Figures MeasureCorners(uint64_t seed) {
  const Rig rig = DrawRig(seed);
  const Board board = LargeTags();
  TagDetector detector({board.description().family});
  RootMeanSquare errors;
  const NamedCamera& camera = rig.cameras[seed % rig.cameras.size()];
  const BoardFrames frames =
      DrawBoardFrames(std::span(&camera, 1), board, {.volume = PlacesOf(rig).volume, .tilt = 0.7},
                      kFrames, {.sigma = 0, .least_size = kLeastSize, .most_tilt = 1}, seed);
  Photographer photographer(camera, board, seed);
  const CameraIntrinsics& lens = camera.model.intrinsics();
  for (size_t f = 0; f < frames.frames.size(); ++f) {
    std::vector<uint8_t> pixels = photographer.Take(frames.world_from_board[f]);
    const cv::Mat image(lens.height, lens.width, CV_8UC1, pixels.data());
    std::vector<TagSighting> truth;
    for (const TagSighting& sighting : frames.sightings) {
      if (sighting.frame == frames.frames[f]) truth.push_back(sighting);
    }
    AddErrors(truth, detector.Detect(image), errors);
  }
  Figures figures;
  if (errors.count() > 0) figures["corner_px"] = errors.Result();
  return figures;
}

}  // namespace silhouette::calibration_experiment
