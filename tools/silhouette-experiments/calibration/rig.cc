// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/calibration/rig.h"

#include "absl/strings/str_format.h"
#include "capture/sim/chance.h"
#include "capture/sim/simulation.h"

namespace silhouette::calibration_experiment {

Rig DrawRig(uint64_t seed) {
  Chance chance(seed);
  Rig rig;
  rig.workspace = {Eigen::Vector3d(-0.7, -0.7, 0.1), Eigen::Vector3d(0.7, 0.7, 1.1)};
  for (const Eigen::Vector2d& side : {Eigen::Vector2d(1, 1), {-1, 1}, {-1, -1}, {1, -1}}) {
    CameraIntrinsics lens{.width = 1280, .height = 960};
    lens.fx = chance.Uniform(890, 920);
    lens.fy = lens.fx * chance.Uniform(0.998, 1.002);
    lens.cx = 639.5 + chance.Uniform(-12, 12);
    lens.cy = 479.5 + chance.Uniform(-12, 12);
    lens.distortion = {chance.Uniform(-0.22, -0.18), chance.Uniform(0.04, 0.06),
                       chance.Uniform(-5e-4, 5e-4), chance.Uniform(-5e-4, 5e-4),
                       chance.Uniform(-0.01, 0)};
    const Eigen::Vector3d centre(1.3 * side.x() + chance.Uniform(-0.1, 0.1),
                                 1.3 * side.y() + chance.Uniform(-0.1, 0.1),
                                 chance.Uniform(2.0, 2.3));
    const Eigen::Vector3d aim = Eigen::Vector3d(0, 0, 0.6) + 0.05 * chance.NormalVector();
    rig.cameras.push_back({"camera" + std::to_string(rig.cameras.size() + 1),
                           CameraModel(lens, LookAt(centre, aim, Eigen::Vector3d::UnitZ()))});
  }
  return rig;
}

std::vector<Eigen::Vector3d> PointsOfWorkspace(const Rig& rig) {
  constexpr int kSteps = 6;
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < kSteps * kSteps * kSteps; ++i) {
    const Eigen::Vector3d share(i % kSteps, i / kSteps % kSteps, i / kSteps / kSteps);
    points.push_back(rig.workspace.min() +
                     share.cwiseProduct(rig.workspace.sizes()) / (kSteps - 1));
  }
  return points;
}

Board HandBoard() {
  return Board(
      {.name = "hand", .rows = 4, .columns = 5, .tag_size = 0.06, .gap = 0.06, .first_id = 100});
}

BoardPlaces PlacesOf(const Rig& rig) {
  return {.volume = {rig.workspace.min() - Eigen::Vector3d(0.3, 0.3, 0),
                     rig.workspace.max() + Eigen::Vector3d(0.3, 0.3, 0.3)},
          .least_views = 2};
}

namespace {

// Close before a camera: the board's middle at one of 3 x 3 places of the image, one after the
// other, so that it is seen up to the rim.
BoardPlaces CloseUp(const CameraModel& camera, size_t turn, Chance& chance) {
  const CameraIntrinsics& image = camera.intrinsics();
  const auto share = [&](size_t third) {
    return 0.1 + 0.4 * static_cast<double>(third) + chance.Uniform(-0.02, 0.02);
  };
  const double x = share(turn % 3) * image.width;
  const double y = share(turn / 3 % 3) * image.height;
  const Eigen::Vector3d middle =
      camera.Centre() + chance.Uniform(0.9, 1.5) * camera.Ray({x, y}).value();
  return {.volume = {middle - Eigen::Vector3d::Constant(0.05),
                     middle + Eigen::Vector3d::Constant(0.05)}};
}

}  // namespace

BoardFrames DrawSession(const Rig& rig, size_t boards, double sigma, uint64_t seed) {
  const TagProjectionSettings settings{.sigma = sigma, .least_size = 15};
  const Board board = HandBoard();
  const size_t cameras = rig.cameras.size();
  Chance chance(seed);
  BoardFrames session;
  for (size_t i = 0; i < boards; ++i) {
    std::span<const NamedCamera> shown_to = rig.cameras;
    BoardPlaces places = PlacesOf(rig);
    if (i % 3 != 0) {
      const size_t close_up = i - i / 3 - 1;
      shown_to = shown_to.subspan(close_up % cameras, 1);
      places = CloseUp(shown_to[0].model, close_up / cameras, chance);
    }
    const Eigen::Isometry3d pose =
        DrawBoardFrames(shown_to, board, places, 1, settings, seed + 7919 * (i + 1))
            .world_from_board[0];
    session.frames.push_back(absl::StrFormat("%04d", i + 1));
    session.world_from_board.push_back(pose);
    for (const NamedCamera& camera : rig.cameras) {
      const auto seen = ProjectTags(camera, session.frames.back(), board, pose, settings, chance);
      session.sightings.insert(session.sightings.end(), seen.begin(), seen.end());
    }
  }
  return session;
}

}  // namespace silhouette::calibration_experiment
