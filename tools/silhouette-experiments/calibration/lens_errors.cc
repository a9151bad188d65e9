// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/calibration/lens_errors.h"

#include <Eigen/Dense>

namespace silhouette::calibration_experiment {

std::vector<SeenPoint> SeenPoints(const Rig& rig, const ModelErrors& errors) {
  std::vector<SeenPoint> points;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const CameraModel& camera = rig.cameras[c].model;
    for (const Eigen::Vector3d& point : PointsOfWorkspace(rig)) {
      const auto pixel = SeenAt(camera, errors, point);
      if (pixel && camera.Contains(*pixel)) points.push_back({c, point, *pixel});
    }
  }
  return points;
}

namespace {

// The errors of all pixels, one after the other. A point that a camera does not see counts as off
// by the image's width.
Eigen::VectorXd PixelErrors(const std::vector<SeenPoint>& points,
                            const std::vector<CameraModel>& cameras,
                            const Similarity& reference_from_world) {
  Eigen::VectorXd errors(2 * std::ssize(points));
  for (size_t i = 0; i < points.size(); ++i) {
    const CameraModel& camera = cameras[points[i].camera];
    const auto pixel = camera.Project(reference_from_world * points[i].point);
    errors.segment<2>(static_cast<Eigen::Index>(2 * i)) =
        pixel ? *pixel - points[i].pixel : Eigen::Vector2d(camera.intrinsics().width, 0);
  }
  return errors;
}

}  // namespace

Aligned Align(const std::vector<SeenPoint>& points, const std::vector<CameraModel>& cameras,
              const Rig& rig) {
  constexpr int kSteps = 10;
  constexpr double kDelta = 1e-6;
  Aligned aligned;
  Similarity& similarity = aligned.reference_from_world;
  similarity.motion =
      cameras[0].camera_from_world().inverse() * rig.cameras[0].model.camera_from_world();
  const Eigen::Index freedom = cameras.size() > 1 ? 7 : 6;
  aligned.derivatives.resize(2 * std::ssize(points), freedom);
  for (int step = 0; step < kSteps; ++step) {
    for (Eigen::Index i = 0; i < freedom; ++i) {
      const Eigen::Matrix<double, 7, 1> by = kDelta * Eigen::Matrix<double, 7, 1>::Unit(i);
      aligned.derivatives.col(i) = (PixelErrors(points, cameras, similarity.Changed(by)) -
                                    PixelErrors(points, cameras, similarity.Changed(-by))) /
                                   (2 * kDelta);
    }
    Eigen::Matrix<double, 7, 1> by = Eigen::Matrix<double, 7, 1>::Zero();
    by.head(freedom) =
        -aligned.derivatives.householderQr().solve(PixelErrors(points, cameras, similarity));
    similarity = similarity.Changed(by);
  }
  aligned.errors = PixelErrors(points, cameras, similarity);
  return aligned;
}

ChiSquared Predicted(const std::vector<SeenPoint>& points, const LensSolution& solution,
                     const Aligned& aligned) {
  const Eigen::MatrixXd& covariance = solution.groups[0].covariance.covariance;
  Eigen::MatrixXd derivatives = Eigen::MatrixXd::Zero(aligned.errors.size(), covariance.cols());
  for (size_t i = 0; i < points.size(); ++i) {
    const auto derivative = ProjectionDerivative(solution, points[i].camera,
                                                 aligned.reference_from_world * points[i].point);
    if (derivative) derivatives.middleRows<2>(static_cast<Eigen::Index>(2 * i)) = *derivative;
  }
  derivatives -= aligned.derivatives * aligned.derivatives.householderQr().solve(derivatives);
  JointErrors joint;
  for (Eigen::Index i = 0; i < aligned.errors.size(); i += 2) {
    joint.Add(derivatives.middleRows<2>(i), aligned.errors.segment<2>(i));
  }
  return joint.Against(covariance);
}

}  // namespace silhouette::calibration_experiment
