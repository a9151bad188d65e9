#include "calib/intrinsics/lens_file.h"

#include "calib/files/calibration_camera_file.h"

namespace silhouette {

std::string LensFileText(const SolvedCamera& camera) {
  const Eigen::Vector3d rotation = RotationVectorOf(camera.camera_from_reference);
  const Eigen::Vector3d translation = camera.camera_from_reference.translation();
  return CameraFileText(CameraFileFields{.lens_model = camera.lens_model,
                                         .intrinsics = camera.intrinsics,
                                         .rotation = {rotation.begin(), rotation.end()},
                                         .translation = {translation.begin(), translation.end()},
                                         .image_width = camera.width,
                                         .image_height = camera.height},
                        camera.name);
}

}  // namespace silhouette
