// SPDX-License-Identifier: Apache-2.0
// How far solved lenses are off: the pixels of workspace points, after the best placing of the
// solution in the world.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "calib/intrinsics/solve_lenses.h"
#include "tools/silhouette-experiments/calibration/figures.h"
#include "tools/silhouette-experiments/calibration/model_errors.h"
#include "tools/silhouette-experiments/calibration/rig.h"

namespace silhouette::calibration_experiment {

// The workspace as cameras see it in truth.
struct SeenPoint {
  size_t camera = 0;
  Eigen::Vector3d point;
  Eigen::Vector2d pixel;
};

std::vector<SeenPoint> SeenPoints(const Rig& rig, const ModelErrors& errors);

// What images alone do not determine: where the reference is, and how large all is.
struct Similarity {
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  double scale = 1;

  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const { return motion * (scale * point); }
  // Rotation vector, translation, share of the scale.
  Similarity Changed(const Eigen::Matrix<double, 7, 1>& by) const {
    Similarity changed = *this;
    const Eigen::Vector3d turn = by.head<3>();
    changed.motion.translation() += by.segment<3>(3);
    changed.motion.rotate(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
    changed.scale *= 1 + by[6];
    return changed;
  }
};

struct Aligned {
  Similarity reference_from_world;
  Eigen::VectorXd errors;       // of the pixels
  Eigen::MatrixXd derivatives;  // of the pixels by the similarity
};

// With the similarity that makes the errors as small as can be; of a single camera the scale stays
// 1, as it moves no pixel.
Aligned Align(const std::vector<SeenPoint>& points, const std::vector<CameraModel>& cameras,
              const Rig& rig);

// The errors against the solution's covariance, both without what the similarity takes up.
ChiSquared Predicted(const std::vector<SeenPoint>& points, const LensSolution& solution,
                     const Aligned& aligned);

}  // namespace silhouette::calibration_experiment
