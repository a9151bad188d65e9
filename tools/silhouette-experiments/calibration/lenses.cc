// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "calib/camera/calibration.h"
#include "calib/camera/camera_model.h"
#include "calib/fundamental/correspondences.h"
#include "calib/fundamental/epipolar_geometry.h"
#include "calib/fundamental/weak_calibration.h"
#include "calib/intrinsics/solve_lenses.h"
#include "server/collision/epipolar_bands.h"
#include "server/scene/scene_settings.h"
#include "tools/silhouette-experiments/calibration/figures.h"
#include "tools/silhouette-experiments/calibration/rig.h"
#include "tools/silhouette-experiments/calibration/trials.h"

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

// Adds epipolar_px: corners that were not calibrated with, exactly where they are, and how far they
// are from their lines in images without distortion. `models`: as calibrated, one per camera of the
// rig, in any common frame.
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

// Adds weak_epipolar_px: the same for matrices straight from the corners of a session of `boards`
// places with noise of `sigma` pixels, by cameras like those of the rig whose lenses do not bow
// lines. Pairs of views with too few corners for any matrix are left out.
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

// Adds band_misses: points of the workspace whose true pixels, in masks, the bands say do not show
// the same.
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

constexpr size_t kBoards = 80;
constexpr double kLensesCornerNoise = 0.1;  // pixels per axis

// The frame of the solution, from the boards' true places in the world: the motion that takes their
// outermost corners to where the solution has them, as the predicted uncertainty has it.
Eigen::Isometry3d ReferenceFromWorld(const LensSolution& solution, const BoardFrames& truth,
                                     const Board& board) {
  const BoardDescription& measures = board.description();
  const double pitch = measures.tag_size + measures.gap;
  const double right = (measures.columns - 1) * pitch + measures.tag_size;
  const double bottom = (measures.rows - 1) * pitch + measures.tag_size;
  const std::vector<Eigen::Vector3d> outermost{
      {0, 0, 0}, {right, 0, 0}, {0, bottom, 0}, {right, bottom, 0}};
  std::vector<Eigen::Vector3d> in_world;
  std::vector<Eigen::Vector3d> in_reference;
  for (const LensBoard& solved : solution.boards) {
    const auto frame = static_cast<size_t>(std::stoi(solved.frame)) - 1;
    for (const Eigen::Vector3d& corner : outermost) {
      in_world.push_back(truth.world_from_board[frame] * corner);
      in_reference.push_back(solved.reference_from_board * corner);
    }
  }
  const auto columns = static_cast<Eigen::Index>(in_world.size());
  Eigen::Isometry3d motion;
  motion.matrix() =
      Eigen::umeyama(Eigen::Matrix3Xd::Map(in_world[0].data(), 3, columns),
                     Eigen::Matrix3Xd::Map(in_reference[0].data(), 3, columns), false);
  return motion;
}

struct ProjectionErrors {
  RootMeanSquare pixels;
  ChiSquared predicted;
};

// How far the projections of workspace points are off, and how far that was to be expected.
ProjectionErrors ErrorsOf(const Rig& rig, const LensSolution& solution,
                          const Eigen::Isometry3d& reference_from_world) {
  ProjectionErrors errors;
  JointErrors joint;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const CameraModel& truth = rig.cameras[c].model;
    for (const Eigen::Vector3d& point : PointsOfWorkspace(rig)) {
      const auto expected = truth.Project(point);
      if (!expected || !truth.Contains(*expected)) continue;
      const Eigen::Vector3d in_reference = reference_from_world * point;
      const auto pixel = solution.cameras[c].model->Project(in_reference);
      const auto derivative = ProjectionDerivative(solution, c, in_reference);
      // A point outside the calibrated camera's image counts as off by the image's width.
      const Eigen::Vector2d error =
          pixel ? *pixel - *expected : Eigen::Vector2d(truth.intrinsics().width, 0);
      errors.pixels.Add(error.squaredNorm(), 1);
      if (derivative) joint.Add(*derivative, error);
    }
  }
  errors.predicted = joint.Against(solution.groups[0].covariance.covariance);
  return errors;
}

}  // namespace

absl::StatusOr<Figures> MeasureLenses(uint64_t seed, int calibrations) {
  const Rig rig = DrawRig(seed);
  const Board board = HandBoard();
  std::vector<LensCamera> cameras;
  for (const NamedCamera& camera : rig.cameras) {
    const CameraIntrinsics& lens = camera.model.intrinsics();
    cameras.push_back({.name = camera.view, .width = lens.width, .height = lens.height});
  }
  Figures figures;
  ChiSquared predicted;
  for (int i = 0; i < calibrations; ++i) {
    const BoardFrames frames =
        DrawSession(rig, kBoards, kLensesCornerNoise, seed + static_cast<uint64_t>(i) * 15485863);
    const auto begin = std::chrono::steady_clock::now();
    const auto solution = SolveLenses(cameras, {board}, frames.sightings);
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
    if (!solution.ok()) return solution.status();
    if (solution->groups.size() != 1) return absl::InternalError("the cameras were not tied");
    const ProjectionErrors errors =
        ErrorsOf(rig, *solution, ReferenceFromWorld(*solution, frames, board));
    predicted.Add(errors.predicted);
    figures["workspace_px"] = std::max(figures["workspace_px"], errors.pixels.Result());
    figures["seconds"] = std::max(figures["seconds"], spent.count());
    if (i > 0) continue;
    std::vector<CameraModel> models;
    for (const SolvedCamera& camera : solution->cameras) models.push_back(*camera.model);
    MeasureLines(rig, models, seed, figures);
    MeasureWeakLines(rig, kBoards, kLensesCornerNoise, seed, figures);
    MeasureBands(rig, models, seed, figures);
  }
  figures["chi2_per_dof"] = predicted.PerFreedom();
  return figures;
}

}  // namespace silhouette::calibration_experiment
