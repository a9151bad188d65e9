// SPDX-License-Identifier: Apache-2.0
// The reference images of a cell: taken by its cameras, kept in its database.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/devices/devices.h"
#include "capture/segmentation/reference.h"
#include "capture/session/capture_observer.h"
#include "capture/session/capture_settings.h"
#include "capture/session/cell_cameras.h"
#include "capture/session/travel.h"
#include "db/store/store.h"

namespace silhouette {

// A view in which something moved while its reference images were taken: a person, or the robot.
struct MovedInView {
  // Least connected share of an image that counts: a hand at arm's length from a person counts, a
  // cable in the wind does not.
  static constexpr double kLeastShare = 0.001;

  size_t view = 0;
  cv::Mat image;  // in which most had moved
  cv::Mat moved;  // 255 where
};

// Takes `count` sets of images of the empty cell, at least two. `moved`: if it is not null, gets
// the views in which some image differs from the first one. Errors are those of the cameras;
// Cancelled if a stop was requested.
absl::StatusOr<storage::v1::References> TakeReferences(CellCameras& cameras, int count,
                                                       const CaptureObserver& observer = {},
                                                       std::vector<MovedInView>* moved = nullptr);

// The database's references as the segmentation wants them, one per view. NotFound if there are
// none. DataLoss, naming the view, if one cannot be read. FailedPrecondition if one has not the
// size of its view's camera image.
absl::StatusOr<std::vector<Reference>> ReadReferences(const Database& database);

// The same of others that a database kept.
absl::StatusOr<std::vector<Reference>> ReferencesIn(const storage::v1::References& stored,
                                                    const storage::v1::CellDescription& cell);

// Reference images of a cell that the robot cannot leave.

// `count` different configurations of the grid, spread evenly over it, none of them forbidden;
// fewer if the grid has fewer.
std::vector<ConfigurationNumber> SpreadConfigurations(const Travel& travel, int count);

// Drives the robot to `count` such configurations, one image set at each, and makes references of
// what is seen where the robot is not: where the database has the robot images, by these, with a
// mask pixel around; else by the median (Reference::FromImagesWithRobot). Suspect robot images are
// not used, nor any if the last check of the sentinels found a change. Errors are those of the
// devices; FailedPrecondition if there are fewer than Reference::kFewestUncovered configurations
// that the robot reached; Cancelled if a stop was requested.
absl::StatusOr<storage::v1::References> TakeReferencesWithRobot(
    Database& database, const Travel& travel, Robot& robot, CameraRig& rig,
    const CaptureSettings& settings, int count, const CaptureObserver& observer = {});

}  // namespace silhouette
