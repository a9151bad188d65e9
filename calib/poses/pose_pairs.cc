// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_pairs.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/poses/pose_network.h"
#include "calib/poses/pose_notation.h"
#include "common/numbers/numbers.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

using Isometries = std::vector<Eigen::Isometry3d>;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Vector12 = Eigen::Matrix<double, 12, 1>;
using Matrix12 = Eigen::Matrix<double, 12, 12>;

constexpr size_t kLeastPairs = 5;
constexpr double kPairOutlier = 5;  // sigmas per axis, of a length
constexpr double kStep = 1e-6;      // of numeric derivatives, metres and radians
// Pairs that miss each other by more, per axis, determine nothing that is of use.
constexpr double kMostPosition = 0.02;         // metres
constexpr double kMostRotation = 2 * kDegree;  // radians
// The median length of a normally distributed triple over its standard deviation per axis.
constexpr double kMedianOfThree = 1.538;
constexpr double kClearlyBetter = 4;

Eigen::Isometry3d ReadPose(const YamlNode& node, const PoseNotation& notation,
                           const std::vector<double>& values) {
  const absl::StatusOr<Eigen::Isometry3d> pose = notation.Pose(values);
  if (!pose.ok()) node.Fail(std::string(pose.status().message()));
  return *pose;
}

Eigen::Isometry3d ReadMatrix(const YamlNode& node) {
  static const PoseNotation matrix = PoseNotation::Named("matrix", "m").value();
  return ReadPose(node, matrix, node.Values<double>(16));
}

Eigen::Isometry3d ReadTransform(const YamlNode& node) {
  YamlMap map(node);
  std::vector<double> values;
  YamlMap translation(map.Required("translation"));
  for (const char* key : {"x", "y", "z"}) values.push_back(translation.Get<double>(key));
  YamlMap rotation(map.Required("rotation"));
  for (const char* key : {"x", "y", "z", "w"}) values.push_back(rotation.Get<double>(key));
  return ReadPose(node, PoseNotation(), values);
}

// What is to be solved: camera_pose * link_i * board_pose = seen_i.
struct Links {
  Isometries links;
  Isometries seen;
};

Links LinksOf(std::span<const PosePair> pairs, bool on_flange) {
  Links links;
  for (const PosePair& pair : pairs) {
    links.links.push_back(on_flange ? pair.base_from_flange.inverse() : pair.base_from_flange);
    links.seen.push_back(pair.camera_from_board);
  }
  return links;
}

Eigen::Isometry3d Moved(const Eigen::Isometry3d& pose, const Vector6& by) {
  Eigen::Isometry3d motion(Eigen::Translation3d(by.tail<3>()));
  const double angle = by.head<3>().norm();
  if (angle > 0) motion.rotate(Eigen::AngleAxisd(angle, by.head<3>() / angle));
  return pose * motion;
}

// Rotation vector and translation between what is seen and what the poses say.
Vector6 Miss(const Links& links, size_t i, const PairSolution& poses) {
  const Eigen::Isometry3d off =
      links.seen[i].inverse() * poses.camera_pose * links.links[i] * poses.board_pose;
  Vector6 miss;
  miss << RotationVectorOf(off), off.translation();
  return miss;
}

PairSolution Moved(PairSolution poses, const Vector12& by) {
  poses.camera_pose = Moved(poses.camera_pose, by.head<6>());
  poses.board_pose = Moved(poses.board_pose, by.tail<6>());
  return poses;
}

// The normal equations of the pairs that are no outliers, weighted by the sigmas.
void NormalEquationsOf(const Links& links, const PairSolution& poses, Matrix12& matrix,
                       Vector12& gradient) {
  matrix.setZero();
  gradient.setZero();
  Vector6 weights;
  weights << Eigen::Vector3d::Constant(1 / poses.rotation_sigma),
      Eigen::Vector3d::Constant(1 / poses.position_sigma);
  for (size_t i = 0; i < links.links.size(); ++i) {
    if (poses.residuals[i].outlier) continue;
    Eigen::Matrix<double, 6, 12> derivative;
    for (int k = 0; k < 12; ++k) {
      const Vector12 step = kStep * Vector12::Unit(k);
      derivative.col(k) =
          (Miss(links, i, Moved(poses, step)) - Miss(links, i, Moved(poses, -step))) / (2 * kStep);
    }
    derivative = weights.asDiagonal() * derivative;
    matrix += derivative.transpose() * derivative;
    gradient += derivative.transpose() * weights.asDiagonal() * Miss(links, i, poses);
  }
}

// The residuals, and the sigmas by those that are no outliers.
void FindNoise(const Links& links, PairSolution& poses) {
  double rotation = 0;
  double position = 0;
  double count = 0;
  for (size_t i = 0; i < links.links.size(); ++i) {
    const Vector6 miss = Miss(links, i, poses);
    PairResidual& residual = poses.residuals[i];
    residual.rotation = miss.head<3>().norm();
    residual.position = miss.tail<3>().norm();
    if (residual.outlier) continue;
    rotation += miss.head<3>().squaredNorm();
    position += miss.tail<3>().squaredNorm();
    ++count;
  }
  // Each kind of residual determines about half of the twelve unknowns.
  const double freedom = std::max(1.0, 3 * count - 6);
  poses.rotation_sigma = std::max(1e-9, std::sqrt(rotation / freedom));
  poses.position_sigma = std::max(1e-9, std::sqrt(position / freedom));
}

void MarkOutliers(PairSolution& poses) {
  std::vector<double> rotations;
  std::vector<double> positions;
  for (const PairResidual& residual : poses.residuals) {
    rotations.push_back(residual.rotation);
    positions.push_back(residual.position);
  }
  const double rotation = kPairOutlier * Median(rotations) / kMedianOfThree;
  const double position = kPairOutlier * Median(positions) / kMedianOfThree;
  for (PairResidual& residual : poses.residuals) {
    residual.outlier = residual.rotation > std::max(rotation, 1e-6) ||
                       residual.position > std::max(position, 1e-6);
  }
}

void Refine(const Links& links, PairSolution& poses) {
  Matrix12 matrix;
  Vector12 gradient;
  constexpr int kRounds = 30;
  for (int round = 0; round < kRounds; ++round) {
    NormalEquationsOf(links, poses, matrix, gradient);
    const Vector12 step = -matrix.ldlt().solve(gradient);
    if (!step.allFinite()) return;
    poses = Moved(poses, step);
    FindNoise(links, poses);
    if (round < kRounds / 2) MarkOutliers(poses);
    if (round >= kRounds / 2 && step.norm() < 1e-10) break;
  }
  NormalEquationsOf(links, poses, matrix, gradient);
  poses.covariance = matrix.inverse().topLeftCorner<6, 6>();
}

std::optional<PairSolution> SolveLinks(const Links& links) {
  const std::optional<Eigen::Isometry3d> camera_pose = CameraPoseByPark(links.links, links.seen);
  if (!camera_pose) return std::nullopt;
  PairSolution poses;
  poses.camera_pose = *camera_pose;
  poses.board_pose = BoardPoseBy(*camera_pose, links.links, links.seen);
  poses.residuals.resize(links.links.size());
  FindNoise(links, poses);
  Refine(links, poses);
  return poses;
}

// In sigmas of what is of use; infinity if there is no solution.
double Badness(const std::optional<PairSolution>& solution) {
  if (!solution) return std::numeric_limits<double>::infinity();
  return std::max(solution->position_sigma / kMostPosition,
                  solution->rotation_sigma / kMostRotation);
}

// What would explain pairs that contradict each other. Inverted poses of the camera are as those of
// the other mount.
std::string ExplanationOf(std::span<const PosePair> pairs, bool on_flange, double badness) {
  if (kClearlyBetter * Badness(SolveLinks(LinksOf(pairs, !on_flange))) < badness) {
    return absl::StrCat(on_flange ? "with a camera that stands still (without --eye-in-hand)"
                                  : "with the camera on the flange (--eye-in-hand)",
                        ", or with the camera's poses inverted, they fit");
  }
  return "see whether each board pose belongs to its robot pose, and all are in metres";
}

}  // namespace

absl::StatusOr<std::vector<PosePair>> PosePairsFromText(const std::string& text,
                                                        const std::string& file) {
  try {
    const YamlNode root = YamlNode::FromText(text, file);
    std::vector<PosePair> pairs;
    const bool moveit = root.IsSequence();
    const YamlNode samples = moveit ? root : YamlMap(root).Required("samples");
    for (const YamlNode& sample : samples.Items()) {
      YamlMap map(sample);
      if (moveit) {
        pairs.push_back({ReadMatrix(map.Required("effector_wrt_world")),
                         ReadMatrix(map.Required("object_wrt_sensor"))});
      } else {
        pairs.push_back(
            {ReadTransform(map.Required("robot")), ReadTransform(map.Required("tracking"))});
      }
      map.Finish();
    }
    return pairs;
  } catch (const YamlError& error) {
    return InvalidArgument(error.what());
  }
}

absl::StatusOr<PairSolution> SolvePosePairs(std::span<const PosePair> pairs, bool on_flange) {
  if (pairs.size() < kLeastPairs) {
    return FailedPrecondition("has only ", pairs.size(), " pairs of poses; ", kLeastPairs,
                              " are the least, twenty are good");
  }
  const Links links = LinksOf(pairs, on_flange);
  RETURN_IF_ERROR(CheckTurns(links.links));
  const std::optional<PairSolution> solution = SolveLinks(links);
  const double badness = Badness(solution);
  if (badness < 1) return *solution;
  return FailedPrecondition(
      solution
          ? absl::StrFormat("has pairs of poses that miss each other by %.0f mm and %.1f deg; ",
                            1000 * solution->position_sigma, solution->rotation_sigma / kDegree)
          : "has pairs of poses that no pose of the camera explains; ",
      ExplanationOf(pairs, on_flange, badness));
}

}  // namespace silhouette
