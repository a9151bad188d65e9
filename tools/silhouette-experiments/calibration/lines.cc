#include "tools/silhouette-experiments/calibration/lines.h"

#include <algorithm>
#include <limits>

#include "calib/camera/calibration.h"
#include "calib/fundamental/correspondences.h"
#include "calib/fundamental/epipolar_geometry.h"
#include "calib/fundamental/model_matrices.h"
#include "calib/fundamental/weak_calibration.h"
#include "server/collision/epipolar_bands.h"
#include "server/scene/scene_settings.h"

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

// Exactly where they are; not of a session that is calibrated with.
BoardFrames DrawHeldOut(const Rig& rig, uint64_t seed) {
  return DrawSession(rig, kHeldOut, 0, seed + 1000003);
}

Rig Straightened(Rig rig) {
  for (NamedCamera& camera : rig.cameras) {
    CameraIntrinsics lens = camera.model.intrinsics();
    lens.distortion = {};
    camera.model = CameraModel(lens, camera.model.camera_from_world());
  }
  return rig;
}

ViewSizes SizesOf(const CameraModel& camera) {
  return {.image = {camera.intrinsics().width, camera.intrinsics().height},
          .mask = {kMask.width, kMask.height}};
}

void Add(const EpipolarDistance& distance, RootMeanSquare& distances) {
  distances.Add(distance.in_a * distance.in_a + distance.in_b * distance.in_b, 2);
}

}  // namespace

void MeasureLines(const Rig& rig, const std::vector<CameraModel>& models, uint64_t seed,
                  Figures& figures) {
  const BoardFrames held_out = DrawHeldOut(rig, seed);
  RootMeanSquare distances;
  for (size_t a = 0; a < models.size(); ++a) {
    for (size_t b = a + 1; b < models.size(); ++b) {
      const Eigen::Matrix3d f = FundamentalBetween(models[a], models[b]);
      const ViewPair pair =
          CornersOfPair(held_out.sightings, rig.cameras[a].view, rig.cameras[b].view);
      for (const Correspondence& corner : pair.corners) {
        const auto straight = Undistorted(models[a], models[b], corner);
        if (straight) Add(DistanceBetween(f, straight->a, straight->b), distances);
      }
    }
  }
  if (distances.count() > 0) figures["epipolar_px"] = distances.Result();
}

void MeasureWeakLines(const Rig& rig, size_t boards, double sigma, uint64_t seed,
                      Figures& figures) {
  const Rig straight = Straightened(rig);
  const BoardFrames session = DrawSession(straight, boards, sigma, seed);
  const BoardFrames held_out = DrawHeldOut(straight, seed);
  RootMeanSquare distances;
  for (size_t a = 0; a < straight.cameras.size(); ++a) {
    for (size_t b = a + 1; b < straight.cameras.size(); ++b) {
      const NamedCamera& camera_a = straight.cameras[a];
      const NamedCamera& camera_b = straight.cameras[b];
      const WeakCalibration found = CalibrateWeakly(
          CornersOfPair(session.sightings, camera_a.view, camera_b.view), SizesOf(camera_a.model),
          SizesOf(camera_b.model), std::numeric_limits<double>::infinity(), 1);
      if (found.refusal) continue;
      for (const Correspondence& corner :
           CornersOfPair(held_out.sightings, camera_a.view, camera_b.view).corners) {
        Add(DistanceBetween(found.f, corner.a, corner.b), distances);
      }
    }
  }
  if (distances.count() > 0) figures["weak_epipolar_px"] = distances.Result();
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
