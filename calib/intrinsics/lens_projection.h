// What mrcal's lens models do with points and pixels. Pixels (integers at pixel centres) and
// metres; may be used by any number of threads.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace silhouette {

// The number of a lens model's parameters. InvalidArgument: mrcal does not know the name, or cannot
// solve for it.
absl::StatusOr<int> LensParameters(const std::string& lens_model);
// Whether the model is one of splines; its first four parameters cannot be solved for.
bool IsSplined(const std::string& lens_model);

struct LensDerivatives {
  Eigen::Matrix<double, 2, 3> by_point;
  Eigen::MatrixXd by_intrinsics;  // 2 x parameters
};
// The pixel of a point in the camera's frame; nothing if the model has none.
std::optional<Eigen::Vector2d> ProjectByLens(const std::string& lens_model,
                                             const std::vector<double>& intrinsics,
                                             const Eigen::Vector3d& point,
                                             LensDerivatives* derivatives = nullptr);
// The direction, of unit length, that a pixel sees; nothing if the model has none.
std::optional<Eigen::Vector3d> UnprojectByLens(const std::string& lens_model,
                                               const std::vector<double>& intrinsics,
                                               const Eigen::Vector2d& pixel);

// point_out = pose * point, with its derivative by the pose's rotation vector and translation.
Eigen::Matrix<double, 3, 6> DerivativeByPose(const Eigen::Isometry3d& pose,
                                             const Eigen::Vector3d& point);

Eigen::Isometry3d PoseOf(const Eigen::Vector3d& rotation_vector,
                         const Eigen::Vector3d& translation);
Eigen::Vector3d RotationVectorOf(const Eigen::Isometry3d& pose);

}  // namespace silhouette
