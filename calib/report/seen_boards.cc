#include "calib/report/seen_boards.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <string>

namespace silhouette {
namespace {

std::map<std::string, Eigen::Isometry3d> BoardsByName(const PoseSolution& solution) {
  std::map<std::string, Eigen::Isometry3d> poses;
  for (const SolvedBoard& board : solution.boards) poses.emplace(board.name, board.pose);
  return poses;
}

const std::string& SeenBoardsNameOf(const PoseNetwork& network, const Look& look) {
  return network.boards[network.board_poses[look.board_pose].board].board.description().name;
}

// How far a flange is from another, metres; a radian counts as half a metre.
double Distance(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  const Eigen::Isometry3d motion = a.inverse() * b;
  return motion.translation().norm() + 0.5 * Eigen::AngleAxisd(motion.linear()).angle();
}

}  // namespace

std::vector<Eigen::Vector3d> SpaceOfBoards(const PoseNetwork& network, const PoseSolution& solution,
                                           bool on_flange) {
  constexpr int kSteps = 6;
  const std::map<std::string, Eigen::Isometry3d> boards = BoardsByName(solution);
  Eigen::AlignedBox3d box;
  for (const Look& look : network.looks) {
    const auto board = boards.find(SeenBoardsNameOf(network, look));
    if (network.views[look.view].on_flange != on_flange || board == boards.end()) continue;
    for (const LookCorner& corner : look.corners) {
      box.extend(network.LinkOf(look) * board->second * corner.point);
    }
  }
  std::vector<Eigen::Vector3d> points;
  if (box.isEmpty()) return points;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      for (int k = 0; k <= kSteps; ++k) {
        const Eigen::Vector3d share = Eigen::Vector3d(i, j, k) / kSteps;
        points.push_back(box.min() + share.cwiseProduct(box.sizes()));
      }
    }
  }
  return points;
}

std::optional<double> TiltOf(const PoseNetwork& network, int view) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> normals;
  for (const Look& look : network.looks) {
    if (look.view != view || look.flange < 0 || look.candidates.empty()) continue;
    normals.emplace_back(look.candidates.front().linear().col(2));
    mean += normals.back();
  }
  if (normals.size() < 3) return std::nullopt;
  mean /= static_cast<double>(normals.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& normal : normals) {
    spread += (normal - mean) * (normal - mean).transpose() / static_cast<double>(normals.size());
  }
  // Normals lie on a sphere: of the three, the first is what its curvature leaves.
  const Eigen::Vector3d values =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvalues();
  return std::sqrt(std::max(0.0, values[1])) * 180 / std::numbers::pi;
}

std::vector<std::string> FramesThatFitAnother(const PoseNetwork& network,
                                              const PoseSolution& solution, int by) {
  constexpr double kFarBetter = 0.2;
  constexpr double kAtLeast = 5e-3;  // that the frame's own pose is off
  std::set<std::string> wrong;
  for (const SolvedFrame& frame : solution.frames) {
    if (frame.robot_outlier) wrong.insert(frame.name);
  }
  const std::map<std::string, Eigen::Isometry3d> boards = BoardsByName(solution);
  std::set<std::string> found;
  for (const Look& look : network.looks) {
    const auto board = boards.find(SeenBoardsNameOf(network, look));
    const int other = look.flange + by;
    if (look.flange < 0 || other < 0 || other >= static_cast<int>(network.robot_poses.size()) ||
        board == boards.end() || look.candidates.empty() || !wrong.contains(look.frame)) {
      continue;
    }
    const Eigen::Isometry3d link = solution.views[look.view].camera_pose.inverse() *
                                   look.candidates.front() * board->second.inverse();
    const Eigen::Isometry3d flange = network.views[look.view].on_flange ? link.inverse() : link;
    const double own = Distance(flange, network.robot_poses[look.flange].base_from_flange);
    if (own < kAtLeast) continue;
    if (Distance(flange, network.robot_poses[other].base_from_flange) < kFarBetter * own) {
      found.insert(look.frame);
    }
  }
  return {found.begin(), found.end()};
}

}  // namespace silhouette
