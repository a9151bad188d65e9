// SPDX-License-Identifier: Apache-2.0
// The bundle: all poses of a network at once, by least squares over the corners' residuals. Ceres
// is known to its source file only.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/SparseCore>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "calib/camera/camera_model.h"
#include "calib/poses/pose_calibration.h"

namespace silhouette {

// A pose to be found. With sigmas it was measured, and is drawn to `measured`.
struct BundlePose {
  std::string name;  // for messages
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  bool has_prior = false;
  Eigen::Isometry3d measured = Eigen::Isometry3d::Identity();
  double position_sigma = 0;
  double rotation_sigma = 0;
  bool left_out = false;  // the measurement is wrong and does not count
  bool constant = false;
  PoseCovariance covariance = PoseCovariance::Zero();  // see FindCovariances

  // measured^-1 * pose as rotation vector and translation, each in its sigma.
  Eigen::Matrix<double, 6, 1> PriorResidual() const;
};

// A pose that a measurement gives, with these standard deviations per axis.
BundlePose MeasuredPose(const Eigen::Isometry3d& measured, double position_sigma,
                        double rotation_sigma);

struct BundleCorner {
  int camera = 0;
  int flange = -1;                // none
  bool camera_on_flange = false;  // the flange's pose is taken inverted
  int board_pose = 0;
  int size = 0;           // index of the board's size factor
  Eigen::Vector3d point;  // in the board's frame
  Eigen::Vector2d pixel;
  double sigma = 1;     // pixels
  double stated = 1;    // sigma by the sightings' file, pixels
  int part = 0;         // in Bundle::parts
  size_t sighting = 0;  // in the problem: the corners of one tag are used or left out together
  size_t look = 0;      // in the network
  size_t place = 0;     // in the look
  bool used = true;
  Eigen::Vector2d residual = Eigen::Vector2d::Zero();  // pixels, after Adjust
};

// The corners of one board in one view: they share what print, paper and lens add to the errors of
// detection.
struct BundlePart {
  int camera = 0;
  int size = 0;       // the board's
  double stated = 0;  // root mean square of the stated sigmas, pixels
  double sigma = 0;   // the same of the sigmas that count, see NoiseModel
};

struct Bundle {
  std::vector<CameraIntrinsics> lenses;  // one per camera
  std::vector<BundlePose> cameras;
  std::vector<BundlePose> flanges;
  std::vector<BundlePose> board_poses;
  std::vector<double> sizes;        // factors on the boards' points
  std::vector<double> size_sigmas;  // see FindCovariances
  bool free_sizes = false;          // find them too; drawn to 1 by a sigma of 20 %
  std::vector<BundleCorner> corners;
  std::vector<BundlePart> parts;  // none: sigmas are as they are

  // Between the corner's camera and its board: the identity, the flange's pose or its inverse.
  Eigen::Isometry3d LinkOf(const BundleCorner& corner) const;
};

// Moves the poses to the least sum of squares over the used corners and the priors. `robust`: the
// residual, in sigmas, from which a corner counts for less and less, as priors then do from six
// sigmas; 0: all count fully. Returns false if no corner can be evaluated or the solver fails.
bool Adjust(Bundle& bundle, double robust);

// Fills the residuals of all corners, used or not; infinite behind the camera.
void FindResiduals(Bundle& bundle);

// What the data determine, at a minimum that Adjust found.
struct BundleStatistics {
  std::string undetermined;  // what the data do not determine; empty: all is
  double chi2 = 0;
  int dof = 0;
  // Sums of squares and their expectation, of each part's corners and of the priors of flanges and
  // boards.
  std::vector<double> part_chi2;
  std::vector<double> part_redundancy;
  double flange_chi2 = 0;
  double flange_redundancy = 0;
  double survey_chi2 = 0;
  double survey_redundancy = 0;
};

// Fills the covariances of cameras, of flanges and board poses, and the size sigmas.
BundleStatistics FindCovariances(Bundle& bundle);

// The derivatives of a bundle's residuals, for its statistics.

// A pose (six columns: rotation, translation) or a size factor (one) that is sought.
struct BundleBlock {
  BundlePose* pose = nullptr;
  int size = -1;
  int column = 0;
  int width() const { return pose != nullptr ? 6 : 1; }
};

struct BundleJacobian {
  std::vector<BundleBlock> blocks;
  // A row per residual (in sigmas) of the used corners and the priors.
  Eigen::SparseMatrix<double> jacobian;
  std::vector<double> residuals;  // of the rows
  double chi2 = 0;                // the residuals' sum of squares
};

// At the poses as they are. Nothing if a used corner lies behind its camera or nothing is sought.
std::optional<BundleJacobian> JacobianOf(Bundle& bundle);

}  // namespace silhouette
