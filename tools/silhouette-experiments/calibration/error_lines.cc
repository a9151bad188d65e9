// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/calibration/error_lines.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "calib/intrinsics/solve_lenses.h"
#include "calib/poses/pose_calibration.h"
#include "tools/silhouette-experiments/calibration/against_others.h"
#include "tools/silhouette-experiments/calibration/lens_errors.h"
#include "tools/silhouette-experiments/calibration/rig.h"

namespace silhouette::calibration_experiment {
namespace {

constexpr double kLensCornerNoise = 0.1;  // pixels per axis

// Without images that show fewer tags.
std::vector<TagSighting> Plain(size_t least_tags, const std::vector<TagSighting>& sightings) {
  std::map<std::pair<std::string, std::string>, size_t> seen;
  for (const TagSighting& sighting : sightings) ++seen[{sighting.frame, sighting.view}];
  std::vector<TagSighting> plain;
  for (const TagSighting& sighting : sightings) {
    if (seen.at({sighting.frame, sighting.view}) >= least_tags) plain.push_back(sighting);
  }
  return plain;
}

// Of workspace points as cameras in these poses see them, metres.
RootMeanSquare PointErrors(const Rig& rig, const std::vector<Eigen::Isometry3d>& cameras) {
  RootMeanSquare errors;
  for (size_t c = 0; c < cameras.size(); ++c) {
    const Eigen::Isometry3d error = cameras[c].inverse() * rig.cameras[c].model.camera_from_world();
    for (const Eigen::Vector3d& point : PointsOfWorkspace(rig)) {
      errors.Add((error * point - point).squaredNorm(), 1);
    }
  }
  return errors;
}

ChiSquared Predicted(const Rig& rig, const PoseSolution& solution) {
  ChiSquared predicted;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const SolvedView& view = solution.views[c];
    const Eigen::Isometry3d error =
        view.camera_pose.inverse() * rig.cameras[c].model.camera_from_world();
    const Eigen::AngleAxisd turn(error.linear());
    Eigen::Matrix<double, 6, 1> motion;
    motion << turn.angle() * turn.axis(), error.translation();
    predicted.Add({.squares = motion.dot(view.covariance.ldlt().solve(motion)), .freedom = 6});
  }
  return predicted;
}

Board FlangeBoard() {
  return Board({.name = "flange", .rows = 3, .columns = 3, .tag_size = 0.04, .gap = 0.04});
}

}  // namespace

void AddRun(const RootMeanSquare& own, const RootMeanSquare& others, LineResult& result) {
  result.error.Add(own);
  if (others.count() == 0) return;
  result.comparable.Add(own);
  result.others.Add(others);
}

bool IsRefusal(const absl::Status& status, LineResult& result) {
  if (status.code() != absl::StatusCode::kFailedPrecondition) return false;
  ++result.refused;
  result.refusal = std::string(status.message());
  return true;
}

absl::Status MeasureLensLine(const ErrorLine& line, uint64_t seed, bool others,
                             LineResult& result) {
  const Rig rig = DrawRig(seed);
  constexpr size_t kLeastTags = 6;
  const Board board = HandBoard();
  BoardFrames frames = DrawSession(rig, line.boards, kLensCornerNoise, seed);
  Disturb(rig.cameras, board, line.errors, seed, frames);
  frames.sightings = Plain(kLeastTags, frames.sightings);
  std::vector<LensCamera> cameras;
  for (const NamedCamera& camera : rig.cameras) {
    const CameraIntrinsics& lens = camera.model.intrinsics();
    cameras.push_back({.name = camera.view, .width = lens.width, .height = lens.height});
  }
  ++result.runs;
  result.most_refused = line.most_refused;
  const auto solution = SolveLenses(cameras, {board}, frames.sightings);
  if (!solution.ok()) {
    return IsRefusal(solution.status(), result) ? absl::OkStatus() : solution.status();
  }
  if (solution->groups.size() != 1) return absl::InternalError("the cameras were not tied");
  std::vector<CameraModel> models;
  for (const SolvedCamera& camera : solution->cameras) models.push_back(*camera.model);
  const std::vector<SeenPoint> points = SeenPoints(rig, line.errors);
  const Aligned aligned = Align(points, models, rig);
  result.predicted.Add(Predicted(points, *solution, aligned));
  RootMeanSquare own;
  own.Add(aligned.errors.squaredNorm(), static_cast<int>(points.size()));
  RootMeanSquare of_others;
  if (others) {
    const auto found = CalibrateByMrcal(rig.cameras, board,
                                        Plain(static_cast<size_t>(board.tags()), frames.sightings));
    if (absl::IsNotFound(found.status()) || absl::IsAborted(found.status())) return found.status();
    if (found.ok()) {
      of_others.Add(Align(points, *found, rig).errors.squaredNorm(),
                    static_cast<int>(points.size()));
    } else {
      ++result.others_failed;
      result.others_failure = std::string(found.status().message());
    }
  }
  AddRun(own, of_others, result);
  return absl::OkStatus();
}

absl::Status MeasurePoseLine(const ErrorLine& line, uint64_t seed, LineResult& result) {
  const Rig rig = DrawRig(seed);
  const PoseProblem problem = DrawFlangeSession(rig, FlangeBoard(), line, seed);
  ++result.runs;
  result.most_refused = line.most_refused;
  const auto solution = CalibratePoses(problem);
  if (!solution.ok()) {
    return IsRefusal(solution.status(), result) ? absl::OkStatus() : solution.status();
  }
  std::vector<Eigen::Isometry3d> own;
  for (const SolvedView& view : solution->views) own.push_back(view.camera_pose);
  RootMeanSquare best;
  for (const auto& poses : CalibrateByOpenCv(problem)) {
    const RootMeanSquare errors = PointErrors(rig, poses);
    if (best.count() == 0 || errors.Result() < best.Result()) best = errors;
  }
  result.predicted.Add(Predicted(rig, *solution));
  AddRun(PointErrors(rig, own), best, result);
  return absl::OkStatus();
}

double WorseThanOthers(const LineResult& result) {
  if (result.others.count() == 0) return 0;
  return result.comparable.Result() / result.others.Result() - 1;
}

bool MeetsGoals(const LineResult& result) {
  const double chi2 = result.predicted.PerFreedom();
  const bool compared = result.others.count() > 0 || result.others_failed == 0;
  const bool answered = result.refused <= result.most_refused * result.runs;
  return answered && compared && WorseThanOthers(result) <= 0.02 && chi2 >= 0.7 && chi2 <= 1.4;
}

}  // namespace silhouette::calibration_experiment
