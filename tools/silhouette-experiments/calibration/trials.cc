// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/calibration/trials.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/detection/tag_detector.h"
#include "calib/files/calibration_message.h"
#include "calib/files/camera_file.h"
#include "calib/poses/pose_calibration.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-experiments/calibration/model_errors.h"
#include "tools/silhouette-experiments/calibration/photographer.h"
#include "tools/silhouette-experiments/calibration/rig.h"

namespace silhouette::calibration_experiment {
namespace {

constexpr size_t kFrames = 6;
constexpr double kLeastSize = 60;  // of a tag's shortest side, pixels

Board LargeTags() {
  return Board({.name = "large", .rows = 2, .columns = 3, .tag_size = 0.15, .gap = 0.15});
}

void AddErrors(const std::vector<TagSighting>& truth, const std::vector<DetectedTag>& found,
               RootMeanSquare& errors) {
  for (const TagSighting& sighting : truth) {
    for (const DetectedTag& tag : found) {
      if (tag.tag != sighting.tag) continue;
      for (size_t i = 0; i < 4; ++i) {
        errors.Add((tag.corners[i] - sighting.corners[i]).squaredNorm(), 2);
      }
    }
  }
}

}  // namespace

Figures MeasureCorners(uint64_t seed) {
  const Rig rig = DrawRig(seed);
  const Board board = LargeTags();
  TagDetector detector({board.description().family});
  RootMeanSquare errors;
  const NamedCamera& camera = rig.cameras[seed % rig.cameras.size()];
  const BoardFrames frames =
      DrawBoardFrames(std::span(&camera, 1), board, {.volume = PlacesOf(rig).volume, .tilt = 0.7},
                      kFrames, {.sigma = 0, .least_size = kLeastSize, .most_tilt = 1}, seed);
  Photographer photographer(camera, board, seed);
  for (size_t f = 0; f < frames.frames.size(); ++f) {
    const cv::Mat image = photographer.Take(frames.world_from_board[f]);
    std::vector<TagSighting> truth;
    for (const TagSighting& sighting : frames.sightings) {
      if (sighting.frame == frames.frames[f]) truth.push_back(sighting);
    }
    AddErrors(truth, detector.Detect(image), errors);
  }
  Figures figures;
  if (errors.count() > 0) figures["corner_px"] = errors.Result();
  return figures;
}

absl::StatusOr<Figures> MeasureRoundTrip(uint64_t seed) {
  const Rig rig = DrawRig(seed);
  double worst = 0;
  for (const NamedCamera& camera : rig.cameras) {
    const std::string text = CameraFileText(camera.model, camera.view);
    ASSIGN_OR_RETURN(const auto read, CameraFromText(text, CameraFileName(camera.view)));
    for (const Eigen::Vector3d& point : PointsOfWorkspace(rig)) {
      const auto before = camera.model.Project(point);
      const auto after = read.Project(point);
      if (before && after) worst = std::max(worst, (*after - *before).norm());
    }
  }
  return Figures{{"roundtrip_px", worst}};
}

absl::StatusOr<Figures> MeasureFlange(uint64_t seed) {
  const Rig rig = DrawRig(seed);
  const Board tag({.name = "flange", .tag_size = 0.12});
  ASSIGN_OR_RETURN(const auto solution, CalibratePoses(DrawFlangeSession(rig, tag, {}, seed)));
  RootMeanSquare places;
  RootMeanSquare directions;
  RootMeanSquare points;
  for (size_t c = 0; c < rig.cameras.size(); ++c) {
    const CameraModel& truth = rig.cameras[c].model;
    const Eigen::Isometry3d base_from_camera = solution.views[c].camera_pose.inverse();
    // Where the camera, taken to be there, has points that are elsewhere in truth.
    const Eigen::Isometry3d error = base_from_camera * truth.camera_from_world();
    places.Add((base_from_camera.translation() - truth.Centre()).squaredNorm(), 1);
    const double angle = Eigen::AngleAxisd(error.linear()).angle() * 180 / std::numbers::pi;
    directions.Add(angle * angle, 1);
    for (const Eigen::Vector3d& point : PointsOfWorkspace(rig)) {
      points.Add((error * point - point).squaredNorm(), 1);
    }
  }
  return Figures{{"flange_mm", 1000 * places.Result()},
                 {"flange_deg", directions.Result()},
                 {"workspace_mm", 1000 * points.Result()}};
}

}  // namespace silhouette::calibration_experiment
