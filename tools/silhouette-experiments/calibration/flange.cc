#include <cmath>
#include <numbers>

#include "calib/poses/pose_calibration.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-experiments/calibration/rig.h"
#include "tools/silhouette-experiments/calibration/trials.h"

namespace silhouette::calibration_experiment {
namespace {

constexpr size_t kRobotPoses = 30;
constexpr double kFlangeCornerNoise = 0.05;  // pixels per axis

Eigen::Isometry3d SmallMotion(const RobotNoise& noise, Chance& chance) {
  const Eigen::Vector3d turn = noise.rotation_sigma * chance.NormalVector();
  Eigen::Isometry3d motion(Eigen::Translation3d(noise.position_sigma * chance.NormalVector()));
  motion.rotate(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
  return motion;
}

PoseProblem DrawProblem(const Rig& rig, uint64_t seed) {
  Chance chance(seed);
  const Board tag({.name = "flange", .tag_size = 0.12});
  const BoardFrames frames = DrawBoardFrames(rig.cameras, tag, PlacesOf(rig), kRobotPoses,
                                             {.sigma = kFlangeCornerNoise, .least_size = 15}, seed);
  Eigen::Isometry3d flange_from_board(Eigen::Translation3d(0.02, -0.05, 0.06));
  flange_from_board.rotate(Eigen::AngleAxisd(chance.Uniform(-3, 3), chance.Direction()));
  PoseProblem problem;
  for (const NamedCamera& camera : rig.cameras) {
    problem.views.push_back({.name = camera.view, .lens = camera.model.intrinsics()});
  }
  problem.boards.push_back({.board = tag, .place = BoardPlace::kFlange});
  problem.sightings = frames.sightings;
  for (size_t f = 0; f < frames.frames.size(); ++f) {
    const Eigen::Isometry3d base_from_flange =
        frames.world_from_board[f] * flange_from_board.inverse();
    problem.robot_poses.push_back(
        {.frame = frames.frames[f],
         .base_from_flange = base_from_flange * SmallMotion(problem.robot_noise, chance)});
  }
  return problem;
}

}  // namespace

absl::StatusOr<Figures> MeasureFlange(uint64_t seed) {
  const Rig rig = DrawRig(seed);
  ASSIGN_OR_RETURN(const auto solution, CalibratePoses(DrawProblem(rig, seed)));
  RootMeanSquare places;
  RootMeanSquare directions;
  RootMeanSquare points;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const CameraModel& truth = rig.cameras[c].model;
    const Eigen::Isometry3d base_from_camera = solution.views[c].camera_pose.inverse();
    // Where the camera, taken to be there, has points that are elsewhere in truth.
    const Eigen::Isometry3d error = base_from_camera * truth.camera_from_world();
    places.Add((base_from_camera.translation() - truth.Centre()).squaredNorm(), 1);
    const double angle = Eigen::AngleAxisd(error.linear()).angle() * 180 / std::numbers::pi;
    directions.Add(angle * angle, 1);
    for (const Eigen::Vector3d& point : PointsOfWorkspace(rig)) {
      points.Add((error * point - point).squaredNorm(), 1);
    }
  }
  return Figures{{"flange_mm", 1000 * places.Result()},
                 {"flange_deg", directions.Result()},
                 {"workspace_mm", 1000 * points.Result()}};
}

}  // namespace silhouette::calibration_experiment
