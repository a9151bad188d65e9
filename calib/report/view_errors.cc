// SPDX-License-Identifier: Apache-2.0
#include "calib/report/view_errors.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

namespace silhouette {
namespace {

// The standard error of the mean of what was found without a group each, a column each: of the
// length.
double StandardError(const Eigen::MatrixXd& found) {
  const Eigen::MatrixXd off = found.colwise() - found.rowwise().mean();
  const double groups = static_cast<double>(found.cols());
  return std::sqrt((groups - 1) / groups * off.squaredNorm());
}

constexpr int kColumns = 16;  // of the longer side

size_t CellOf(const ReportView& view, const Eigen::Vector2d& pixel) {
  const ImageMap& map = view.map;
  const auto place = [](double share, int count) {
    return std::clamp(static_cast<int>(std::floor(share * count)), 0, count - 1);
  };
  const int column = place((pixel.x() + 0.5) / view.width, map.columns);
  const int row = place((pixel.y() + 0.5) / view.height, map.rows);
  return static_cast<size_t>(row) * static_cast<size_t>(map.columns) + static_cast<size_t>(column);
}

// Whether a field or one beside it has corners.
bool Reached(const ImageMap& map, size_t cell) {
  const int row = static_cast<int>(cell) / map.columns;
  const int column = static_cast<int>(cell) % map.columns;
  for (int r = std::max(0, row - 1); r <= std::min(map.rows - 1, row + 1); ++r) {
    for (int c = std::max(0, column - 1); c <= std::min(map.columns - 1, column + 1); ++c) {
      if (map.cells[static_cast<size_t>(r * map.columns + c)].corners > 0) return true;
    }
  }
  return false;
}

void FillCorners(ReportView& view) {
  Eigen::AlignedBox2d box;
  std::vector<PixelSum> sums(view.map.cells.size());
  for (const ReportCorner& corner : view.points) {
    if (corner.outlier) continue;
    box.extend(corner.pixel);
    const size_t place = CellOf(view, corner.pixel);
    MapCell& cell = view.map.cells[place];
    ++cell.corners;
    cell.mean += (corner.fit - cell.mean) / cell.corners;
    sums[place].Add(corner.fit);
  }
  int covered = 0;
  for (size_t i = 0; i < sums.size(); ++i) {
    view.map.cells[i].fit_px = sums[i].Rms();
    covered += view.map.cells[i].corners > 0 ? 1 : 0;
  }
  view.coverage = static_cast<double>(covered) / static_cast<double>(sums.size());
  if (box.isEmpty()) return;
  view.span_x = box.sizes().x() / view.width;
  view.span_y = box.sizes().y() / view.height;
}

std::map<std::string, Eigen::Isometry3d> BoardsByName(const PoseSolution& solution) {
  std::map<std::string, Eigen::Isometry3d> poses;
  for (const SolvedBoard& board : solution.boards) poses.emplace(board.name, board.pose);
  return poses;
}

const std::string& BoardNameOf(const PoseNetwork& network, const Look& look) {
  return network.boards[network.board_poses[look.board_pose].board].board.description().name;
}

// How far a flange is from another, metres; a radian counts as half a metre.
double Distance(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  const Eigen::Isometry3d motion = a.inverse() * b;
  return motion.translation().norm() + 0.5 * Eigen::AngleAxisd(motion.linear()).angle();
}

}  // namespace

std::optional<Eigen::Matrix<double, 2, 6>> PixelByMotion(const CameraModel& lens,
                                                         const Eigen::Isometry3d& before,
                                                         const Eigen::Isometry3d& pose,
                                                         const Eigen::Vector3d& point) {
  constexpr double kStep = 1e-6;  // metres
  const Eigen::Vector3d in_camera = before * pose * point;
  Eigen::Matrix<double, 2, 3> by_point;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(axis);
    const auto more = lens.Project(in_camera + step);
    const auto less = lens.Project(in_camera - step);
    if (!more || !less) return std::nullopt;
    by_point.col(axis) = (*more - *less) / (2 * kStep);
  }
  return by_point * (before.linear() * pose.linear()) * DerivativeByMotion(point);
}

std::optional<double> PixelVariance(const CameraModel& lens, const SolvedView& view,
                                    const Eigen::Vector3d& point) {
  const auto by_motion =
      PixelByMotion(lens, Eigen::Isometry3d::Identity(), view.camera_pose, point);
  if (!by_motion) return std::nullopt;
  return (*by_motion * view.covariance * by_motion->transpose()).trace() / 2;
}

std::vector<Eigen::Vector3d> PointsInImage(const CameraModel& lens, const SolvedView& view,
                                           std::span<const Eigen::Vector3d> points) {
  std::vector<Eigen::Vector3d> in_image;
  for (const Eigen::Vector3d& point : points) {
    const auto pixel = lens.Project(view.camera_pose * point);
    if (pixel && lens.Contains(*pixel)) in_image.push_back(point);
  }
  return in_image;
}

Repeatability JackknifeOf(const PoseProblem& problem, size_t view,
                          const std::vector<Eigen::Vector3d>& points,
                          const std::vector<PoseSolution>& parts) {
  const CameraModel lens(problem.views[view].lens, Eigen::Isometry3d::Identity());
  const auto groups = static_cast<Eigen::Index>(parts.size());
  Eigen::Matrix3Xd centres(3, groups);
  Eigen::Matrix3Xd turns(3, groups);
  const Eigen::Isometry3d& first = parts.front().views[view].camera_pose;
  for (Eigen::Index i = 0; i < groups; ++i) {
    const Eigen::Isometry3d& pose = parts[static_cast<size_t>(i)].views[view].camera_pose;
    centres.col(i) = pose.inverse().translation();
    turns.col(i) = RotationVectorOf(first.inverse() * pose);
  }
  PixelSum sum;
  for (const Eigen::Vector3d& point : points) {
    Eigen::Matrix2Xd pixels(2, groups);
    bool seen = true;
    for (Eigen::Index i = 0; i < groups && seen; ++i) {
      const auto pixel =
          lens.Project(parts[static_cast<size_t>(i)].views[view].camera_pose * point);
      seen = pixel.has_value();
      if (seen) pixels.col(i) = *pixel;
    }
    if (!seen) continue;
    const double error = StandardError(pixels);
    sum.Add(error * error / 2);
  }
  return {.px = sum.Rms(),
          .mm = 1000 * StandardError(centres),
          .deg = StandardError(turns) * 180 / std::numbers::pi};
}

HalvesDifference DifferenceOf(const PoseProblem& problem, size_t view,
                              const std::vector<Eigen::Vector3d>& points, const PoseSolution& a,
                              const PoseSolution& b) {
  const CameraModel lens(problem.views[view].lens, Eigen::Isometry3d::Identity());
  PixelSum difference;
  PixelSum expected;
  for (const Eigen::Vector3d& point : points) {
    const auto by_a = lens.Project(a.views[view].camera_pose * point);
    const auto by_b = lens.Project(b.views[view].camera_pose * point);
    const auto variance_a = PixelVariance(lens, a.views[view], point);
    const auto variance_b = PixelVariance(lens, b.views[view], point);
    if (!by_a || !by_b || !variance_a || !variance_b) continue;
    difference.Add(Eigen::Vector2d(*by_a - *by_b));
    expected.Add(*variance_a + *variance_b);
  }
  return {.px = difference.Rms(), .expected_px = expected.Rms()};
}

void FillMap(const CameraModel& lens, const SolvedView* solved,
             const std::vector<Eigen::Vector3d>& workspace, ReportView& view) {
  const int longer = std::max(view.width, view.height);
  const auto fields = [&](int side) {
    return std::max(1, static_cast<int>(std::lround(1.0 * kColumns * side / longer)));
  };
  view.map.columns = fields(view.width);
  view.map.rows = fields(view.height);
  view.map.cells.resize(static_cast<size_t>(view.map.columns) * static_cast<size_t>(view.map.rows));
  FillCorners(view);
  if (solved == nullptr) return;
  std::vector<PixelSum> sums(view.map.cells.size());
  int reached = 0;
  for (const Eigen::Vector3d& point : workspace) {
    const auto pixel = lens.Project(solved->camera_pose * point);
    if (!pixel) continue;
    const size_t cell = CellOf(view, *pixel);
    sums[cell].Add(PixelVariance(lens, *solved, point).value_or(0));
    reached += Reached(view.map, cell) ? 1 : 0;
  }
  for (size_t i = 0; i < sums.size(); ++i) {
    view.map.cells[i].points = sums[i].count();
    view.map.cells[i].predicted_px = sums[i].Rms();
  }
  if (!workspace.empty()) {
    view.reached = static_cast<double>(reached) / static_cast<double>(workspace.size());
  }
}

std::vector<Eigen::Vector3d> SpaceOfBoards(const PoseNetwork& network, const PoseSolution& solution,
                                           bool on_flange) {
  constexpr int kSteps = 6;
  const std::map<std::string, Eigen::Isometry3d> boards = BoardsByName(solution);
  Eigen::AlignedBox3d box;
  for (const Look& look : network.looks) {
    const auto board = boards.find(BoardNameOf(network, look));
    if (network.views[look.view].on_flange != on_flange || board == boards.end()) continue;
    for (const LookCorner& corner : look.corners) {
      box.extend(network.LinkOf(look) * board->second * corner.point);
    }
  }
  return box.isEmpty() ? std::vector<Eigen::Vector3d>() : PointsOf(box, kSteps);
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
    const auto board = boards.find(BoardNameOf(network, look));
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
