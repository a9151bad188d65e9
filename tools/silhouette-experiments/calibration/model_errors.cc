// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/calibration/model_errors.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <string>
#include <utility>

#include "capture/sim/chance.h"

namespace silhouette::calibration_experiment {
namespace {

// Of a board that is not at rest.
constexpr double kSpeed = 0.05;  // m/s
constexpr double kTurn = 0.1;    // rad/s
constexpr double kWaves = 1.5;   // from side to side of the image

constexpr double kFlangeCornerNoise = 0.05;  // pixels per axis

// A motion of `metres` and `radians` in directions of chance.
Eigen::Isometry3d MotionBy(double metres, double radians, Chance& chance) {
  Eigen::Isometry3d motion(Eigen::Translation3d(metres * chance.Direction()));
  motion.rotate(Eigen::AngleAxisd(radians, chance.Direction()));
  return motion;
}

Eigen::Isometry3d SmallMotion(const RobotNoise& noise, Chance& chance) {
  const Eigen::Vector3d turn = noise.rotation_sigma * chance.NormalVector();
  Eigen::Isometry3d motion(Eigen::Translation3d(noise.position_sigma * chance.NormalVector()));
  motion.rotate(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
  return motion;
}

// Where a point of the described board is on the printed one, in the board's frame.
Eigen::Vector3d Printed(const Eigen::Vector3d& point, const Board& board,
                        const ModelErrors& errors) {
  const Eigen::Vector2d extent = board.extent();
  const Eigen::Vector2d share = point.head<2>().cwiseQuotient(extent);
  const Eigen::Vector2d out = 2 * share - Eigen::Vector2d::Ones();  // -1 to 1
  Eigen::Vector3d printed = point * (1 + errors.scale / extent.maxCoeff());
  printed.x() += errors.shear * share.y();
  printed.z() += errors.bend * (1 - out.squaredNorm() / 2);
  return printed;
}

// What all corners of an image and of its tags have in common.
class MotionBlur {
 public:
  MotionBlur(double sigma, Chance& chance) : sigma_(sigma), chance_(&chance) {
    const double angle = chance.Uniform(0, 2 * std::numbers::pi);
    along_ = {std::cos(angle), std::sin(angle)};
    image_ = sigma * chance.Normal();
  }
  Eigen::Vector2d OfTag() { return (image_ + sigma_ * chance_->Normal()) * along_; }

 private:
  double sigma_;
  Chance* chance_;
  Eigen::Vector2d along_;
  double image_ = 0;
};

}  // namespace

const std::vector<ErrorLine>& ErrorLines() {
  static const std::vector<ErrorLine> lines = {
      {"none", "no model error"},
      {"scaled", "board printed 0.3 mm too long", {.scale = 0.3e-3}},
      {"sheared", "lower side of the board shifted by 0.3 mm", {.shear = 0.3e-3}},
      {"bent", "middle of the board 0.5 mm out of its plane", {.bend = 0.5e-3}},
      {"lens", "waves of 0.1 px in the image that no lens model has", {.lens = 0.1}},
      {"late", "every second camera 3 ms late, board at 50 mm/s", {.lag = 3e-3}},
      {"blur", "corner errors of 0.1 px in common per image and per tag", {.blur = 0.1}},
      {.name = "few",
       .meaning = "30 boards; 10 robot poses",
       .boards = 30,
       .robot_poses = 10,
       .most_refused = 0.25},
      {.name = "wrong", .meaning = "2 of 30 robot poses off by 10 mm and 1 deg", .wrong_poses = 2},
  };
  return lines;
}

std::optional<Eigen::Vector2d> SeenAt(const CameraModel& camera, const ModelErrors& errors,
                                      const Eigen::Vector3d& point_in_world) {
  auto pixel = camera.Project(point_in_world);
  if (!pixel) return pixel;
  const Eigen::Vector2d size(camera.intrinsics().width, camera.intrinsics().height);
  const Eigen::Vector2d phase = 2 * std::numbers::pi * kWaves * pixel->cwiseQuotient(size);
  *pixel += errors.lens * Eigen::Vector2d(std::sin(phase.y()), std::sin(phase.x()));
  return pixel;
}

void Disturb(std::span<const NamedCamera> cameras, const Board& board, const ModelErrors& errors,
             uint64_t seed, BoardFrames& frames) {
  Chance chance(seed);
  std::map<std::string, std::pair<Eigen::Isometry3d, Eigen::Isometry3d>> poses;  // in time, late
  for (size_t f = 0; f < frames.frames.size(); ++f) {
    const Eigen::Isometry3d& pose = frames.world_from_board[f];
    poses[frames.frames[f]] = {pose,
                               pose * MotionBy(kSpeed * errors.lag, kTurn * errors.lag, chance)};
  }
  std::map<std::pair<std::string, std::string>, MotionBlur> blurs;
  for (TagSighting& sighting : frames.sightings) {
    const auto camera = std::ranges::find(cameras, sighting.view, &NamedCamera::view);
    const bool late = (camera - cameras.begin()) % 2 != 0;
    const auto& [described, moved] = poses.at(sighting.frame);
    MotionBlur& blur =
        blurs.try_emplace({sighting.frame, sighting.view}, errors.blur, chance).first->second;
    const Eigen::Vector2d common = blur.OfTag();
    const MarkCorners corners = board.CornersOf(sighting.tag);
    for (size_t i = 0; i < corners.size(); ++i) {
      const auto before = camera->model.Project(described * corners[i]);
      const auto after = SeenAt(camera->model, errors,
                                (late ? moved : described) * Printed(corners[i], board, errors));
      if (before && after) sighting.corners[i] += *after - *before + common;
    }
  }
}

PoseProblem DrawFlangeSession(const Rig& rig, const Board& board, const ErrorLine& line,
                              uint64_t seed) {
  Chance chance(seed);
  BoardFrames frames = DrawBoardFrames(rig.cameras, board, PlacesOf(rig), line.robot_poses,
                                       {.sigma = kFlangeCornerNoise, .least_size = 15}, seed);
  Disturb(rig.cameras, board, line.errors, seed, frames);
  Eigen::Isometry3d flange_from_board(Eigen::Translation3d(0.02, -0.05, 0.06));
  flange_from_board.rotate(Eigen::AngleAxisd(chance.Uniform(-3, 3), chance.Direction()));
  PoseProblem problem;
  for (const NamedCamera& camera : rig.cameras) {
    problem.views.push_back({.name = camera.view, .lens = camera.model.intrinsics()});
  }
  problem.boards.push_back({.board = board, .place = BoardPlace::kFlange});
  problem.sightings = frames.sightings;
  for (size_t f = 0; f < frames.frames.size(); ++f) {
    Eigen::Isometry3d base_from_flange = frames.world_from_board[f] * flange_from_board.inverse() *
                                         SmallMotion(problem.robot_noise, chance);
    // Not one after the other.
    if (f % 7 == 3 && f / 7 < line.wrong_poses)
      base_from_flange = base_from_flange * MotionBy(0.01, kDegree, chance);
    problem.robot_poses.push_back(
        {.frame = frames.frames[f], .base_from_flange = base_from_flange});
  }
  return problem;
}

}  // namespace silhouette::calibration_experiment
