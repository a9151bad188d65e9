// SPDX-License-Identifier: Apache-2.0
// GrpcRobotLink: a robot behind the RobotDriverService of proto/silhouette/v1/robot_driver.proto.
#pragma once

#include <memory>

#include "absl/status/statusor.h"
#include "capture/drivers/robots/feedback_robot.h"
#include "capture/drivers/robots/robot_driver_settings.h"

namespace silhouette {

// Connects and asks for the joints; feedback is what GetState says. Unavailable, DeadlineExceeded:
// no server answers at the address; InvalidArgument, NotFound: settings.tls, as
// ChannelCredentialsFor; otherwise the driver's error.
absl::StatusOr<std::unique_ptr<ControllerLink>> ConnectGrpcRobot(const GrpcRobotSettings& settings);

}  // namespace silhouette
