#include "calib/intrinsics/lens_projection.h"

extern "C" {
#include <mrcal/mrcal.h>
}

#include <array>
#include <cmath>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace silhouette {
namespace {

bool ModelOf(const std::string& name, mrcal_lensmodel_t* model) {
  return mrcal_lensmodel_from_name(model, name.c_str()) &&
         mrcal_lensmodel_type_is_valid(model->type);
}

}  // namespace

absl::StatusOr<int> LensParameters(const std::string& lens_model) {
  mrcal_lensmodel_t model;
  if (!ModelOf(lens_model, &model)) {
    std::string known;
    for (const char* const* name = mrcal_supported_lensmodel_names(); *name != nullptr; ++name) {
      absl::StrAppend(&known, known.empty() ? "" : ", ", *name);
    }
    return absl::InvalidArgumentError(
        absl::StrCat("no lens model is called '", lens_model, "'; there are ", known));
  }
  if (!mrcal_lensmodel_metadata(&model).has_gradients) {
    return absl::InvalidArgumentError(absl::StrCat("the lens model ", lens_model,
                                                   " cannot be solved for; use LENSMODEL_OPENCV8"));
  }
  return mrcal_lensmodel_num_params(&model);
}

bool IsSplined(const std::string& lens_model) {
  return lens_model.starts_with("LENSMODEL_SPLINED_STEREOGRAPHIC");
}

std::optional<Eigen::Vector2d> ProjectByLens(const std::string& lens_model,
                                             const std::vector<double>& intrinsics,
                                             const Eigen::Vector3d& point,
                                             LensDerivatives* derivatives) {
  mrcal_lensmodel_t model;
  if (!ModelOf(lens_model, &model)) return std::nullopt;
  if (!(point.z() > 0) && !mrcal_lensmodel_metadata(&model).can_project_behind_camera) {
    return std::nullopt;
  }
  const mrcal_point3_t p{.xyz = {point.x(), point.y(), point.z()}};
  mrcal_point2_t q;
  std::array<mrcal_point3_t, 2> by_point;
  const auto parameters = static_cast<Eigen::Index>(intrinsics.size());
  Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor> by_intrinsics(2, parameters);
  const bool wanted = derivatives != nullptr;
  if (!mrcal_project(&q, wanted ? by_point.data() : nullptr,
                     wanted ? by_intrinsics.data() : nullptr, &p, 1, &model, intrinsics.data()) ||
      !std::isfinite(q.x) || !std::isfinite(q.y)) {
    return std::nullopt;
  }
  if (wanted) {
    for (int row = 0; row < 2; ++row) {
      for (int i = 0; i < 3; ++i) {
        derivatives->by_point(row, i) = by_point[static_cast<size_t>(row)].xyz[i];
      }
    }
    derivatives->by_intrinsics = by_intrinsics;
  }
  return Eigen::Vector2d(q.x, q.y);
}

std::optional<Eigen::Vector3d> UnprojectByLens(const std::string& lens_model,
                                               const std::vector<double>& intrinsics,
                                               const Eigen::Vector2d& pixel) {
  mrcal_lensmodel_t model;
  const mrcal_point2_t q{.xy = {pixel.x(), pixel.y()}};
  mrcal_point3_t v;
  if (!ModelOf(lens_model, &model) || !mrcal_unproject(&v, &q, 1, &model, intrinsics.data()) ||
      !std::isfinite(v.x) || !std::isfinite(v.y) || !std::isfinite(v.z)) {
    return std::nullopt;
  }
  return Eigen::Vector3d(v.x, v.y, v.z).normalized();
}

Eigen::Matrix<double, 3, 6> DerivativeByPose(const Eigen::Isometry3d& pose,
                                             const Eigen::Vector3d& point) {
  Eigen::Matrix<double, 6, 1> values;
  values << RotationVectorOf(pose), pose.translation();
  std::array<double, 3> out;
  Eigen::Matrix<double, 3, 6, Eigen::RowMajor> derivative;
  mrcal_transform_point_rt(out.data(), derivative.data(), nullptr, values.data(), point.data());
  return derivative;
}

Eigen::Isometry3d PoseOf(const Eigen::Vector3d& rotation_vector,
                         const Eigen::Vector3d& translation) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  if (const double angle = rotation_vector.norm(); angle > 0) {
    pose.linear() = Eigen::AngleAxisd(angle, rotation_vector / angle).toRotationMatrix();
  }
  pose.translation() = translation;
  return pose;
}

Eigen::Vector3d RotationVectorOf(const Eigen::Isometry3d& pose) {
  const Eigen::AngleAxisd turn(pose.linear());
  return turn.angle() * turn.axis();
}

}  // namespace silhouette
