// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_bundle.h"

#include <ceres/autodiff_cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/rotation.h>
#include <ceres/solver.h>
#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

namespace silhouette {
namespace {

// The residuals, for Ceres to derive. A pose is sought as reference * motion, the motion a rotation
// vector and a translation.

// Of a board's size factor about 1.
constexpr double kSizeSigma = 0.2;

struct Frame {
  Eigen::Quaterniond rotation;
  Eigen::Vector3d translation;
};

Frame FrameOf(const Eigen::Isometry3d& pose) {
  return {Eigen::Quaterniond(pose.linear()).normalized(), pose.translation()};
}

template <typename T>
using Vector3 = Eigen::Matrix<T, 3, 1>;

// reference * motion * point
template <typename T>
Vector3<T> Apply(const Frame& reference, const T* motion, const Vector3<T>& point) {
  Vector3<T> moved;
  ceres::AngleAxisRotatePoint(motion, point.data(), moved.data());
  moved += Eigen::Map<const Vector3<T>>(motion + 3);
  return reference.rotation.cast<T>() * moved + reference.translation.cast<T>();
}

// (reference * motion)^-1 * point
template <typename T>
Vector3<T> ApplyInverse(const Frame& reference, const T* motion, const Vector3<T>& point) {
  const Vector3<T> moved =
      reference.rotation.conjugate().cast<T>() * (point - reference.translation.cast<T>()) -
      Eigen::Map<const Vector3<T>>(motion + 3);
  const T back[3] = {-motion[0], -motion[1], -motion[2]};
  Vector3<T> result;
  ceres::AngleAxisRotatePoint(back, moved.data(), result.data());
  return result;
}

// Of r^2 at z = 1: further out (85 degrees) no lens of this model sees.
constexpr double kLargestRadius2 = 144;

// As CameraModel::Project, for the camera's frame. False behind the camera and far aside.
template <typename T>
bool Project(const CameraIntrinsics& lens, const Vector3<T>& point, T* pixel) {
  if (!(point.z() > T(1e-6))) return false;
  const T x = point.x() / point.z();
  const T y = point.y() / point.z();
  if (!(x * x + y * y < T(kLargestRadius2))) return false;
  const Eigen::Matrix<T, 2, 1> distorted = Distort(lens, x, y);
  pixel[0] = lens.fx * distorted.x() + lens.cx;
  pixel[1] = lens.fy * distorted.y() + lens.cy;
  return true;
}

// The residual of a corner, in sigmas. What is constant of a corner's chain.
struct CornerCost {
  const CameraIntrinsics& lens;
  const BundleCorner& corner;
  Frame camera;
  Frame flange;
  Frame board;

  // Blocks: camera, board, size.
  template <typename T>
  bool operator()(const T* camera_motion, const T* board_motion, const T* size, T* residual) const {
    return Finish(camera_motion, InWorld(board_motion, size), residual);
  }

  // Blocks: camera, board, size, flange.
  template <typename T>
  bool operator()(const T* camera_motion, const T* board_motion, const T* size,
                  const T* flange_motion, T* residual) const {
    const Vector3<T> point = InWorld(board_motion, size);
    return Finish(camera_motion,
                  corner.camera_on_flange ? ApplyInverse(flange, flange_motion, point)
                                          : Apply(flange, flange_motion, point),
                  residual);
  }

 private:
  template <typename T>
  Vector3<T> InWorld(const T* board_motion, const T* size) const {
    return Apply<T>(board, board_motion, corner.point.cast<T>() * size[0]);
  }
  template <typename T>
  bool Finish(const T* camera_motion, const Vector3<T>& point, T* residual) const {
    if (!Project(lens, Apply(camera, camera_motion, point), residual)) return false;
    residual[0] = (residual[0] - corner.pixel.x()) / corner.sigma;
    residual[1] = (residual[1] - corner.pixel.y()) / corner.sigma;
    return true;
  }
};

struct MotionPrior {
  double rotation_sigma;
  double position_sigma;

  template <typename T>
  bool operator()(const T* motion, T* residual) const {
    for (int i = 0; i < 3; ++i) {
      residual[i] = motion[i] / rotation_sigma;
      residual[i + 3] = motion[i + 3] / position_sigma;
    }
    return true;
  }
};

struct SizePrior {
  template <typename T>
  bool operator()(const T* size, T* residual) const {
    residual[0] = (size[0] - T(1)) / kSizeSigma;
    return true;
  }
};

// A prior's six residuals count for less and less from here, in sigmas, where corners do.
constexpr double kRobustPrior = 6;

// Rotation vector and translation.
using Motion = std::array<double, 6>;

Eigen::Isometry3d IsometryOf(const Motion& motion) {
  return PoseOf({motion[0], motion[1], motion[2]}, {motion[3], motion[4], motion[5]});
}

Motion MotionOf(const Eigen::Isometry3d& pose) {
  const Eigen::Vector3d r = RotationVectorOf(pose);
  const Eigen::Vector3d t = pose.translation();
  return {r.x(), r.y(), r.z(), t.x(), t.y(), t.z()};
}

// A Bundle as a Ceres problem. Poses with a prior refer to what was measured, others to where they
// are.
class CeresBundle {
 public:
  CeresBundle(Bundle& bundle, double robust)
      : bundle_(bundle), robust_(robust), sizes_(bundle.sizes) {
    for (auto* poses : Kinds()) {
      for (BundlePose& pose : *poses) {
        const Eigen::Isometry3d& reference = pose.has_prior ? pose.measured : pose.pose;
        motions_[&pose] = MotionOf(reference.inverse() * pose.pose);
      }
    }
    for (BundleCorner& corner : bundle.corners) {
      if (corner.used) AddCorner(corner);
    }
    AddPriors();
  }

  bool Solve() {
    if (problem_.NumResidualBlocks() == 0) return false;
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    options.max_num_iterations = 100;
    options.function_tolerance = robust_ > 0 ? 1e-6 : 1e-12;
    options.parameter_tolerance = robust_ > 0 ? 1e-8 : 1e-12;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem_, &summary);
    if (!summary.IsSolutionUsable()) return false;
    for (auto* poses : Kinds()) {
      for (BundlePose& pose : *poses) {
        const Eigen::Isometry3d reference = pose.has_prior ? pose.measured : pose.pose;
        pose.pose = reference * IsometryOf(motions_[&pose]);
        pose.pose.linear() = Eigen::Quaterniond(pose.pose.linear()).normalized().matrix();
      }
    }
    bundle_.sizes = sizes_;
    return true;
  }

  std::optional<BundleJacobian> Jacobian();

 private:
  std::array<std::vector<BundlePose>*, 3> Kinds() {
    return {&bundle_.cameras, &bundle_.flanges, &bundle_.board_poses};
  }

  double* MotionOfPose(BundlePose& pose) {
    double* motion = motions_[&pose].data();
    if (!problem_.HasParameterBlock(motion)) {
      problem_.AddParameterBlock(motion, 6);
      if (pose.constant) problem_.SetParameterBlockConstant(motion);
    }
    return motion;
  }

  static Frame ReferenceOf(const BundlePose& pose) {
    return FrameOf(pose.has_prior ? pose.measured : pose.pose);
  }

  static ceres::LossFunction* LossOf(double robust) {
    return robust > 0 ? new ceres::CauchyLoss(robust) : nullptr;
  }

  void AddCorner(const BundleCorner& corner) {
    BundlePose& camera = bundle_.cameras[corner.camera];
    BundlePose& board = bundle_.board_poses[corner.board_pose];
    BundlePose* flange = corner.flange >= 0 ? &bundle_.flanges[corner.flange] : nullptr;
    auto* cost = new CornerCost{bundle_.lenses[corner.camera], corner, ReferenceOf(camera),
                                flange ? ReferenceOf(*flange) : Frame{}, ReferenceOf(board)};
    double* size = &sizes_[corner.size];
    if (flange) {
      problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<CornerCost, 2, 6, 6, 1, 6>(cost),
                                LossOf(robust_), MotionOfPose(camera), MotionOfPose(board), size,
                                MotionOfPose(*flange));
    } else {
      problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<CornerCost, 2, 6, 6, 1>(cost),
                                LossOf(robust_), MotionOfPose(camera), MotionOfPose(board), size);
    }
    corners_of_size_[corner.size] += 1;
  }

  void AddPriors() {
    for (auto* poses : Kinds()) {
      for (BundlePose& pose : *poses) {
        double* motion = motions_[&pose].data();
        if (!pose.has_prior || pose.left_out || pose.constant ||
            !problem_.HasParameterBlock(motion))
          continue;
        problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<MotionPrior, 6, 6>(
                                      new MotionPrior{pose.rotation_sigma, pose.position_sigma}),
                                  LossOf(robust_ > 0 ? kRobustPrior : 0), motion);
      }
    }
    for (const auto& [size, count] : corners_of_size_) {
      double* value = &sizes_[size];
      if (bundle_.free_sizes) {
        problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<SizePrior, 1, 1>(new SizePrior),
                                  nullptr, value);
      } else {
        problem_.SetParameterBlockConstant(value);
      }
    }
  }

  Bundle& bundle_;
  const double robust_;
  ceres::Problem problem_;
  std::map<const BundlePose*, Motion> motions_;
  std::vector<double> sizes_;
  std::map<int, int> corners_of_size_;
};

std::optional<BundleJacobian> CeresBundle::Jacobian() {
  BundleJacobian result;
  ceres::Problem::EvaluateOptions options;
  options.apply_loss_function = false;
  int columns = 0;
  for (auto* poses : Kinds()) {
    for (BundlePose& pose : *poses) {
      double* motion = motions_[&pose].data();
      if (!problem_.HasParameterBlock(motion) || pose.constant) continue;
      result.blocks.push_back({.pose = &pose, .column = columns});
      options.parameter_blocks.push_back(motion);
      columns += 6;
    }
  }
  for (const auto& [size, count] : corners_of_size_) {
    if (!bundle_.free_sizes) continue;
    result.blocks.push_back({.size = size, .column = columns});
    options.parameter_blocks.push_back(&sizes_[size]);
    columns += 1;
  }
  ceres::CRSMatrix crs;
  double cost = 0;
  if (columns == 0 || !problem_.Evaluate(options, &cost, &result.residuals, nullptr, &crs)) {
    return std::nullopt;
  }
  result.chi2 = 2 * cost;
  result.jacobian = Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>>(
      crs.num_rows, crs.num_cols, static_cast<int>(crs.values.size()), crs.rows.data(),
      crs.cols.data(), crs.values.data());
  return result;
}

}  // namespace

Eigen::Matrix<double, 6, 1> BundlePose::PriorResidual() const {
  const Motion motion = MotionOf(measured.inverse() * pose);
  Eigen::Matrix<double, 6, 1> residual;
  MotionPrior{rotation_sigma, position_sigma}(motion.data(), residual.data());
  return residual;
}

BundlePose MeasuredPose(const Eigen::Isometry3d& measured, double position_sigma,
                        double rotation_sigma) {
  return {.name{},
          .pose = measured,
          .has_prior = true,
          .measured = measured,
          .position_sigma = position_sigma,
          .rotation_sigma = rotation_sigma};
}

Eigen::Isometry3d Bundle::LinkOf(const BundleCorner& corner) const {
  if (corner.flange < 0) return Eigen::Isometry3d::Identity();
  const Eigen::Isometry3d& flange = flanges[corner.flange].pose;
  return corner.camera_on_flange ? flange.inverse() : flange;
}

void FindResiduals(Bundle& bundle) {
  for (BundleCorner& corner : bundle.corners) {
    const Eigen::Vector3d point = bundle.cameras[corner.camera].pose * bundle.LinkOf(corner) *
                                  bundle.board_poses[corner.board_pose].pose *
                                  (bundle.sizes[corner.size] * corner.point);
    Eigen::Vector2d pixel;
    const bool seen = Project(bundle.lenses[corner.camera], Vector3<double>(point), pixel.data());
    corner.residual = seen ? Eigen::Vector2d(pixel - corner.pixel)
                           : Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  }
}

bool Adjust(Bundle& bundle, double robust) {
  FindResiduals(bundle);
  for (BundleCorner& corner : bundle.corners) {
    corner.used = corner.used && corner.residual.allFinite();
  }
  const bool solved = CeresBundle(bundle, robust).Solve();
  FindResiduals(bundle);
  return solved;
}

std::optional<BundleJacobian> JacobianOf(Bundle& bundle) {
  return CeresBundle(bundle, 0).Jacobian();
}

}  // namespace silhouette
