// Reference images of a cell that the robot cannot leave.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "capture/devices/devices.h"
#include "capture/session/capture_observer.h"
#include "capture/session/capture_settings.h"
#include "capture/session/travel.h"
#include "db/store/store.h"

namespace silhouette {

// `count` different configurations of the grid, spread evenly over it, none of them forbidden;
// fewer if there are not so many.
std::vector<ConfigurationNumber> SpreadConfigurations(const Travel& travel, int count);

// Drives the robot to `count` such configurations, one image set at each, and makes references of
// what is seen where the robot is not: where the database has the robot images, by these, with a
// mask pixel around; else by the median (Reference::FromImagesWithRobot). Errors are those of the
// devices; FailedPrecondition if there are fewer than Reference::kFewestUncovered configurations
// that the robot reached; Cancelled if a stop was requested.
absl::StatusOr<storage::v1::References> TakeReferencesWithRobot(
    Database& database, const Travel& travel, Robot& robot, CameraRig& rig,
    const CaptureSettings& settings, int count, const CaptureObserver& observer = {});

}  // namespace silhouette
