// SPDX-License-Identifier: Apache-2.0
// SolveLenses: the lenses of cameras from what they saw of boards, and how cameras and boards
// stood.
//
// All cameras that saw boards together are solved for in one bundle adjustment by mrcal; their
// common frame, the `reference`, is the frame of the first of them. What does not determine the
// lenses well enough is refused, with the reason and the mend. Pixels (integers at pixel centres)
// and metres. mrcal keeps state of its own: one call at a time.
#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/boards/board.h"
#include "calib/boards/sighting_file.h"
#include "calib/camera/camera_model.h"
#include "calib/camera/lens_region.h"
#include "calib/intrinsics/lens_problem.h"

namespace silhouette {

struct LensCamera {
  std::string name;  // TagSighting::view
  int width = 0;     // of its images, pixels
  int height = 0;
  // Known already: held fixed, only poses are found. Either of all cameras or of none.
  std::optional<CameraIntrinsics> fixed = std::nullopt;
  std::optional<LensRegion> known = std::nullopt;  // where it is, of `fixed`
};

struct LensSettings {
  std::string lens_model = "LENSMODEL_OPENCV8";  // by mrcal's name
  // Whether the board may be bent. Of several boards none is: they would share one bend.
  bool board_warp = true;
  // Whether the images of a frame were taken at one instant. If not, each camera is solved by
  // itself, and how the cameras stand to each other stays unknown.
  bool simultaneous = true;
  int least_images = 6;  // of each camera
  // A place of the image is known if projections there are predicted no worse: their standard
  // deviation as a share of the image's width.
  double most_uncertain = 0.0015;
  // The share of the image that must be known.
  double least_known = 0.5;
  // The share of the focal length that its standard deviation may be.
  double most_uncertain_focal_length = 0.01;
  // Called before each step of long work, with its name.
  std::function<void(const std::string&)> step = [](const std::string&) {};
};

// How well a lens is known over its image: at places on a regular grid from rim to rim, row by row.
struct LensMap {
  int columns = 0;
  int rows = 0;
  std::vector<double> sigmas;  // as SolvedCamera::centre_sigma; infinity where nothing is seen
  double limit = 0;            // pixels: up to here a place is known

  bool Known(size_t place) const { return sigmas[place] <= limit; }
  double KnownShare() const;
  // What is known around the best known place, of an image of this size: all that no unknown place
  // lies before, as seen from there.
  LensRegion Region(int width, int height) const;
};

struct SolvedCamera {
  std::string name;
  int width = 0;
  int height = 0;
  std::string lens_model;
  std::vector<double> intrinsics;  // as mrcal has them for the lens model
  size_t group = 0;                // which of LensSolution::groups
  Eigen::Isometry3d camera_from_reference = Eigen::Isometry3d::Identity();
  // The same for LENSMODEL_PINHOLE and OPENCV4 to OPENCV8; the world is the reference.
  std::optional<CameraModel> model = std::nullopt;
  int images = 0;
  int corners = 0;  // without the outliers
  int outliers = 0;
  double rms = 0;       // of the residuals per axis, without outliers
  double covered = 0;   // share of the image's 8 x 6 fields in which a corner was seen
  double distance = 0;  // median of its boards' distances
  // Standard deviations; 0 where the lens is held fixed.
  double focal_length_sigma = 0;  // as a share of the focal length; 0 too if the model has none
  double centre_sigma = 0;  // of the projection of a point at `distance`, in the worst direction
  double edge_sigma = 0;    // the largest of those along the rim of the image
  LensMap map = {};         // empty where the lens is held fixed
  // Of the map, or as stated for a lens that is held fixed.
  std::optional<LensRegion> known = std::nullopt;
};

struct LensGroup {
  std::vector<size_t> cameras;  // the first one's frame is the reference
  // The bend of the board along its width and height, metres; nothing if it was taken for flat.
  std::optional<Eigen::Vector2d> warp = std::nullopt;
  double noise = 1;  // residuals' standard deviation over that which the sightings state
  // Of boards that several cameras saw, the residuals' standard deviation per axis, pixels: in this
  // solve, and in one of each camera by itself. 0 if there are too few to compare.
  double together = 0;
  double apart = 0;
  LensCovariance covariance = {};
};

struct LensBoard {
  std::string frame;
  std::string board;
  size_t group = 0;
  Eigen::Isometry3d reference_from_board = Eigen::Isometry3d::Identity();
};

struct LensResidual {
  std::string frame;
  size_t camera = 0;
  std::string board;
  int tag = 0;
  int corner = 0;
  Eigen::Vector2d seen = Eigen::Vector2d::Zero();      // pixels
  Eigen::Vector2d residual = Eigen::Vector2d::Zero();  // projected minus seen
  bool outlier = false;
};

struct LensSolution {
  std::vector<SolvedCamera> cameras;  // in the order given
  std::vector<LensGroup> groups;      // more than one: nothing ties those cameras together
  std::vector<LensBoard> boards;
  std::vector<LensResidual> residuals;
  std::vector<std::string> warnings;  // one sentence each
};

// InvalidArgument: the input contradicts itself or is not what it says (messages name the thing and
// the mend). FailedPrecondition: the sightings do not determine the lenses, or images of one frame
// were not taken at one instant. Internal: mrcal failed.
absl::StatusOr<LensSolution> SolveLenses(const std::vector<LensCamera>& cameras,
                                         const std::vector<Board>& boards,
                                         const std::vector<TagSighting>& sightings,
                                         const LensSettings& settings = {});

// The covariance of where a camera sees a point of the reference, pixels. The frame is held by the
// boards, not by the first camera: what would move cameras and boards alike is no error. Nothing if
// the camera cannot see the point.
std::optional<Eigen::Matrix2d> ProjectionCovariance(const LensSolution& solution, size_t camera,
                                                    const Eigen::Vector3d& point_in_reference);
// How that projection moves with the state of LensGroup::covariance, of the camera's group: with it
// the errors of many points, which have the same causes, can be judged together.
std::optional<Eigen::Matrix<double, 2, Eigen::Dynamic>> ProjectionDerivative(
    const LensSolution& solution, size_t camera, const Eigen::Vector3d& point_in_reference);
// The standard deviation in the worst direction, for the point that a pixel sees at `distance`.
std::optional<double> ProjectionSigma(const LensSolution& solution, size_t camera,
                                      const Eigen::Vector2d& pixel, double distance);

// What SolveLenses found as .cameramodel files.

// The pose is that before the group's reference, the first camera of the group. Models that
// CameraModel holds are written so that all of this project's programs read them, others as mrcal
// does.
std::string LensFileText(const SolvedCamera& camera);

}  // namespace silhouette
