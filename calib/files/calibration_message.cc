// SPDX-License-Identifier: Apache-2.0
#include "calib/files/calibration_message.h"

#include <algorithm>
#include <stdexcept>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"

namespace silhouette {

storage::v1::CameraModel MessageOf(const CameraModel& camera) {
  const CameraIntrinsics& intrinsics = camera.intrinsics();
  storage::v1::CameraModel message;
  message.set_image_width(intrinsics.width);
  message.set_image_height(intrinsics.height);
  message.set_fx(intrinsics.fx);
  message.set_fy(intrinsics.fy);
  message.set_cx(intrinsics.cx);
  message.set_cy(intrinsics.cy);
  for (double k : intrinsics.distortion) message.add_distortion(k);
  for (double value : RotationVectorOf(camera.camera_from_world())) message.add_rotation(value);
  const Eigen::Vector3d translation = camera.camera_from_world().translation();
  for (double value : translation) message.add_translation(value);
  return message;
}

absl::StatusOr<CameraModel> CameraFrom(const storage::v1::CameraModel& message) {
  CameraIntrinsics intrinsics{.width = message.image_width(),
                              .height = message.image_height(),
                              .fx = message.fx(),
                              .fy = message.fy(),
                              .cx = message.cx(),
                              .cy = message.cy()};
  if (message.rotation_size() != 3 || message.translation_size() != 3 ||
      message.distortion_size() > static_cast<int>(intrinsics.distortion.size())) {
    return InvalidArgument("a camera model has too few or too many values");
  }
  std::copy(message.distortion().begin(), message.distortion().end(),
            intrinsics.distortion.begin());
  try {
    return CameraModel(intrinsics, PoseOf(Eigen::Vector3d(message.rotation().data()),
                                          Eigen::Vector3d(message.translation().data())));
  } catch (const std::invalid_argument& error) {
    return InvalidArgument(error.what());
  }
}

std::string FingerprintOf(const storage::v1::Calibration& message) {
  storage::v1::Calibration bare = message;
  bare.clear_record();
  uint64_t hash = 0xcbf29ce484222325;  // FNV-1a
  for (const char c : bare.SerializeAsString()) {
    hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3;
  }
  return absl::StrCat(absl::Hex(hash, absl::kZeroPad16));
}

absl::StatusOr<Calibration> CalibrationFrom(const storage::v1::Calibration& message) {
  Calibration calibration;
  for (int i = 0; i < message.cameras_size(); ++i) {
    absl::StatusOr<CameraModel> camera = CameraFrom(message.cameras(i));
    if (!camera.ok()) {
      return InvalidArgument("camera ", i + 1, ": ", camera.status().message());
    }
    calibration.cameras.push_back(*std::move(camera));
  }
  for (const storage::v1::FundamentalMatrix& stored : message.fundamental_matrices()) {
    if (stored.f_size() != 9) {
      return InvalidArgument("a fundamental matrix has not 9 values");
    }
    using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    calibration.fundamental_matrices.push_back(
        {.view_a = stored.view_a(),
         .view_b = stored.view_b(),
         .f = Eigen::Map<const RowMajor>(stored.f().data())});
  }
  return calibration;
}

}  // namespace silhouette
