#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

#include "calib/intrinsics/solve_lenses.h"
#include "tools/silhouette-experiments/calibration/joint_errors.h"
#include "tools/silhouette-experiments/calibration/lines.h"
#include "tools/silhouette-experiments/calibration/rig.h"
#include "tools/silhouette-experiments/calibration/trials.h"

namespace silhouette::calibration_experiment {
namespace {

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
      // A point that the calibrated camera does not see is as wrong as can be.
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
