#include "tools/experiments/calibration/lines.h"

#include <algorithm>

#include "calib/calibration.h"
#include "calib/fundamental/correspondences.h"
#include "calib/fundamental/epipolar_geometry.h"
#include "calib/fundamental/model_matrices.h"
#include "server/collision/epipolar_bands.h"
#include "server/scene/calibration_settings.h"

namespace silhouette::calibration_experiment {
namespace {

constexpr size_t kHeldOut = 20;
constexpr int kPoints = 1000000;  // for the bands
constexpr MaskSize kMask{.width = 64, .height = 64};

int PixelOf(const CameraModel& camera, const Eigen::Vector2d& pixel) {
  const CameraIntrinsics& image = camera.intrinsics();
  const auto x = static_cast<int>((pixel.x() + 0.5) * kMask.width / image.width);
  const auto y = static_cast<int>((pixel.y() + 0.5) * kMask.height / image.height);
  return std::min(y, kMask.height - 1) * kMask.width + std::min(x, kMask.width - 1);
}

}  // namespace

void MeasureLines(const Rig& rig, const std::vector<CameraModel>& models, uint64_t seed,
                  Figures& figures) {
  const BoardFrames held_out = DrawSession(rig, kHeldOut, 0, seed + 1000003);
  RootMeanSquare distances;
  for (size_t a = 0; a < models.size(); ++a) {
    for (size_t b = a + 1; b < models.size(); ++b) {
      const Eigen::Matrix3d f = FundamentalBetween(models[a], models[b]);
      const ViewPair pair =
          CornersOfPair(held_out.sightings, rig.cameras[a].view, rig.cameras[b].view);
      for (const Correspondence& corner : pair.corners) {
        const auto straight = Undistorted(models[a], models[b], corner);
        if (!straight) continue;
        const EpipolarDistance distance = DistanceBetween(f, straight->a, straight->b);
        distances.Add(distance.in_a * distance.in_a + distance.in_b * distance.in_b, 2);
      }
    }
  }
  if (distances.count() > 0) figures["epipolar_px"] = distances.Result();
}

void MeasureBands(const Rig& rig, const std::vector<CameraModel>& models, uint64_t seed,
                  Figures& figures) {
  const std::vector<MaskSize> masks(models.size(), kMask);
  const EpipolarBands bands({.cameras = models, .fundamental_matrices = {}}, masks,
                            CalibrationSettings().margin);
  Chance chance(seed);
  int misses = 0;
  for (int tested = 0; tested < kPoints;) {
    const Eigen::Vector3d share(chance.Uniform(), chance.Uniform(), chance.Uniform());
    const Eigen::Vector3d point = rig.workspace.min() + share.cwiseProduct(rig.workspace.sizes());
    const size_t a = chance.Index(models.size());
    const size_t b = (a + 1 + chance.Index(models.size() - 1)) % models.size();
    const auto in_a = rig.cameras[a].model.Project(point);
    const auto in_b = rig.cameras[b].model.Project(point);
    if (!in_a || !in_b || !rig.cameras[a].model.Contains(*in_a) ||
        !rig.cameras[b].model.Contains(*in_b)) {
      continue;
    }
    ++tested;
    misses += bands.Meet(static_cast<int>(a), PixelOf(rig.cameras[a].model, *in_a),
                         static_cast<int>(b), PixelOf(rig.cameras[b].model, *in_b))
                  ? 0
                  : 1;
  }
  figures["band_misses"] = misses;
}

}  // namespace silhouette::calibration_experiment
