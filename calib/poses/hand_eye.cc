// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_network.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <optional>
#include <random>
#include <span>
#include <utility>

#include "absl/status/status.h"
#include "calib/poses/pose_problem.h"
#include "common/numbers/numbers.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr int kSamples = 200;
constexpr int kLeastSamples = 30;
constexpr double kGoodEnough = 2;  // pixels: a seed that needs no further samples
// The turn about the second axis, root mean square over pairs of poses, from which two axes count.
constexpr double kLeastTurn = 1.5 * kDegree;
// Candidates that are turned by more against the solution do not take part in refining it.
constexpr double kLargestMisfit = 10 * kDegree;

// A look with the candidate that is taken for it.
struct Chosen {
  const LinkedLook* linked = nullptr;
  Eigen::Isometry3d seen = Eigen::Isometry3d::Identity();
};

cv::Mat MatOf(const Eigen::Matrix3d& matrix) {
  cv::Mat mat;
  cv::eigen2cv(matrix, mat);
  return mat;
}
cv::Mat MatOf(const Eigen::Vector3d& vector) {
  return (cv::Mat_<double>(3, 1) << vector.x(), vector.y(), vector.z());
}

}  // namespace

// OpenCV's is for a camera in the hand: base_from_gripper is link^-1 here, and camera_pose^-1 what
// it calls gripper_from_camera.
std::optional<Eigen::Isometry3d> CameraPoseByPark(std::span<const Eigen::Isometry3d> links,
                                                  std::span<const Eigen::Isometry3d> seen) {
  std::vector<cv::Mat> gripper_rotations;
  std::vector<cv::Mat> gripper_translations;
  std::vector<cv::Mat> board_rotations;
  std::vector<cv::Mat> board_translations;
  for (size_t i = 0; i < links.size(); ++i) {
    const Eigen::Isometry3d gripper = links[i].inverse();
    gripper_rotations.push_back(MatOf(Eigen::Matrix3d(gripper.linear())));
    gripper_translations.push_back(MatOf(Eigen::Vector3d(gripper.translation())));
    board_rotations.push_back(MatOf(Eigen::Matrix3d(seen[i].linear())));
    board_translations.push_back(MatOf(Eigen::Vector3d(seen[i].translation())));
  }
  cv::Mat rotation;
  cv::Mat translation;
  try {
    cv::calibrateHandEye(gripper_rotations, gripper_translations, board_rotations,
                         board_translations, rotation, translation, cv::CALIB_HAND_EYE_PARK);
  } catch (const cv::Exception&) {
    return std::nullopt;
  }
  Eigen::Matrix3d linear;
  Eigen::Vector3d offset;
  cv::cv2eigen(rotation, linear);
  cv::cv2eigen(translation, offset);
  if (!linear.allFinite() || !offset.allFinite()) return std::nullopt;
  if (!(linear * linear.transpose()).isIdentity(1e-6)) return std::nullopt;
  Eigen::Isometry3d inverse = Eigen::Isometry3d::Identity();
  inverse.linear() = linear;
  inverse.translation() = offset;
  return inverse.inverse();
}

Eigen::Isometry3d BoardPoseBy(const Eigen::Isometry3d& camera_pose,
                              std::span<const Eigen::Isometry3d> links,
                              std::span<const Eigen::Isometry3d> seen) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < links.size(); ++i) {
    const Eigen::Isometry3d pose = links[i].inverse() * camera_pose.inverse() * seen[i];
    sum += pose.linear();
    translation += pose.translation() / static_cast<double>(links.size());
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double turn = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  Eigen::Isometry3d mean = Eigen::Isometry3d::Identity();
  mean.linear() =
      svd.matrixU() * Eigen::Vector3d(1, 1, turn).asDiagonal() * svd.matrixV().transpose();
  mean.translation() = translation;
  return mean;
}

namespace {

double Score(const CameraModel& lens, const std::vector<LinkedLook>& looks,
             const HandEye& solution) {
  std::vector<double> errors;
  for (const LinkedLook& linked : looks) {
    errors.push_back(
        MedianError(lens, *linked.look, solution.camera_pose * linked.link * solution.board_pose));
  }
  return MedianOrInfinity(std::move(errors));
}

// The translations, with the rotations as they are, by least squares; and the board's size if
// `size` is to be found.
void SolveTranslations(const std::vector<Chosen>& chosen, bool size, HandEye& solution) {
  const Eigen::Index rows = 3 * static_cast<Eigen::Index>(chosen.size());
  Eigen::MatrixXd a(rows, size ? 7 : 6);
  Eigen::VectorXd b(rows);
  const Eigen::Matrix3d turn = solution.camera_pose.linear();
  for (size_t i = 0; i < chosen.size(); ++i) {
    const Eigen::Isometry3d& link = chosen[i].linked->link;
    const Eigen::Index row = 3 * static_cast<Eigen::Index>(i);
    a.block<3, 3>(row, 0) = turn * link.linear();
    a.block<3, 3>(row, 3).setIdentity();
    b.segment<3>(row) = -turn * link.translation();
    if (size) {
      a.block<3, 1>(row, 6) = -chosen[i].seen.translation();
    } else {
      b.segment<3>(row) += chosen[i].seen.translation();
    }
  }
  const Eigen::VectorXd x = a.colPivHouseholderQr().solve(b);
  if (!x.allFinite()) return;
  if (size) {
    solution.size = x[6];
    return;
  }
  solution.board_pose.translation() = x.head<3>();
  solution.camera_pose.translation() = x.segment<3>(3);
}

// For each look the candidate that fits best, where one does.
std::vector<Chosen> ChooseBy(const std::vector<LinkedLook>& looks, const HandEye& solution) {
  std::vector<Chosen> chosen;
  for (const LinkedLook& linked : looks) {
    const Eigen::Matrix3d expected =
        (solution.camera_pose * linked.link * solution.board_pose).linear();
    double least = kLargestMisfit;
    const Eigen::Isometry3d* best = nullptr;
    for (const Eigen::Isometry3d& candidate : linked.look->candidates) {
      const Eigen::Matrix3d misfit = expected.transpose() * candidate.linear();
      const double angle = Eigen::AngleAxisd(misfit).angle();
      if (angle < least) {
        least = angle;
        best = &candidate;
      }
    }
    if (best != nullptr) chosen.push_back({&linked, *best});
  }
  return chosen;
}

}  // namespace

absl::Status CheckTurns(std::span<const Eigen::Isometry3d> links) {
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  double pairs = 0;
  for (size_t i = 0; i < links.size(); ++i) {
    for (size_t j = i + 1; j < links.size(); ++j, ++pairs) {
      const Eigen::Vector3d axis = RotationVectorOf(links[i].inverse() * links[j]);
      spread += axis * axis.transpose();
    }
  }
  const Eigen::Vector3d spreads =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread / pairs).eigenvalues();
  if (std::sqrt(std::max(0.0, spreads[2])) < kLeastTurn) {
    return FailedPrecondition(
        "but the flange hardly turned between the frames; turn it by 20 degrees and more about "
        "two axes");
  }
  if (std::sqrt(std::max(0.0, spreads[1])) < kLeastTurn) {
    return FailedPrecondition(
        "but the flange turned about one axis only, so that the position along this axis is not "
        "determined; add poses that turn it about another axis too");
  }
  return absl::OkStatus();
}

namespace {

absl::Status CheckMotion(const std::vector<LinkedLook>& looks) {
  if (looks.size() < 3) {
    return FailedPrecondition(
        "in only ", looks.size(),
        " usable frame(s); three with different orientations are the least, twenty are good");
  }
  std::vector<Eigen::Isometry3d> links;
  for (const LinkedLook& look : looks) links.push_back(look.link);
  return CheckTurns(links);
}

std::optional<HandEye> SolveFrom(const CameraModel& lens, const std::vector<LinkedLook>& looks,
                                 const std::vector<Chosen>& chosen) {
  std::vector<Eigen::Isometry3d> links;
  std::vector<Eigen::Isometry3d> seen;
  for (const Chosen& one : chosen) {
    links.push_back(one.linked->link);
    seen.push_back(one.seen);
  }
  const std::optional<Eigen::Isometry3d> camera_pose = CameraPoseByPark(links, seen);
  if (!camera_pose) return std::nullopt;
  HandEye solution{.camera_pose = *camera_pose,
                   .board_pose = BoardPoseBy(*camera_pose, links, seen)};
  solution.median_px = Score(lens, looks, solution);
  return solution;
}

}  // namespace

absl::StatusOr<HandEye> SolveHandEye(const CameraModel& lens,
                                     const std::vector<LinkedLook>& looks) {
  RETURN_IF_ERROR(CheckMotion(looks));
  std::mt19937 random(1);
  std::uniform_int_distribution<size_t> any(0, looks.size() - 1);
  std::optional<HandEye> best;
  for (int i = 0; i < kSamples; ++i) {
    const std::array<size_t, 3> sample = {any(random), any(random), any(random)};
    const auto draw = random();
    if (sample[0] == sample[1] || sample[0] == sample[2] || sample[1] == sample[2]) continue;
    std::vector<Chosen> chosen;
    for (size_t k = 0; k < 3; ++k) {
      const std::vector<Eigen::Isometry3d>& candidates = looks[sample[k]].look->candidates;
      const size_t which = (draw >> (2 * k)) % 4 == 0 ? candidates.size() - 1 : 0;
      chosen.push_back({&looks[sample[k]], candidates[which]});
    }
    const std::optional<HandEye> solution = SolveFrom(lens, looks, chosen);
    if (solution && (!best || solution->median_px < best->median_px)) best = solution;
    if (best && best->median_px < kGoodEnough && i >= kLeastSamples) break;
  }
  if (!best) {
    return FailedPrecondition("but no pose of the camera explains three of its frames");
  }
  for (int i = 0; i < 2; ++i) {
    const std::vector<Chosen> chosen = ChooseBy(looks, *best);
    if (chosen.size() < 3) break;
    std::optional<HandEye> refined = SolveFrom(lens, looks, chosen);
    if (!refined) break;
    SolveTranslations(chosen, true, *refined);
    best->size = refined->size;
    SolveTranslations(chosen, false, *refined);
    refined->median_px = Score(lens, looks, *refined);
    if (!(refined->median_px < best->median_px)) break;
    best = refined;
  }
  return *best;
}

}  // namespace silhouette
