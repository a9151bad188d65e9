// Robot-world/hand-eye calibration in closed form: camera_pose * link_i * board_pose = seen_i.
#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/camera/camera_model.h"
#include "calib/poses/pose_network.h"

namespace silhouette {

struct HandEye {
  Eigen::Isometry3d camera_pose = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d board_pose = Eigen::Isometry3d::Identity();
  double median_px = 0;  // over the looks: how far corners are from where they were seen
  // The board's size by the robot's motion, as a multiple of what was said.
  double size = 1;
};

struct LinkedLook {
  const Look* look = nullptr;  // with candidates
  Eigen::Isometry3d link = Eigen::Isometry3d::Identity();
};

// By Park's method on samples of three looks, so that wrong candidates and single wrong poses do no
// harm. `lens`: with the identity as pose. The same looks give the same result. FailedPrecondition:
// fewer than three looks, or the flange turned about one axis only; the message is the end of a
// sentence about the view.
absl::StatusOr<HandEye> SolveHandEye(const CameraModel& lens, const std::vector<LinkedLook>& looks);

}  // namespace silhouette
