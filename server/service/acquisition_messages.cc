#include "server/service/messages.h"

namespace silhouette {
namespace {

void LatencyToMessage(const LatencyFigures& figures, v1::AcquisitionLatency* message) {
  message->set_count(figures.count);
  ToMessage(figures.median, message->mutable_median());
  ToMessage(figures.p99, message->mutable_p99());
  ToMessage(figures.longest, message->mutable_longest());
}

// What both messages have.
template <typename Message>
void ErrorsToMessage(const DeviceStatus& device, Message* message) {
  message->set_serving(device.serving);
  message->set_errors(device.errors);
  message->set_fault(device.fault);
  message->set_last_error(device.last_error);
  if (!device.last_error.empty()) {
    ToMessage(device.last_error_time, message->mutable_last_error_time());
  }
}

}  // namespace

void ToMessage(const LiveStatus& status, v1::Acquisition* message) {
  message->set_serving(status.serving);
  ToMessage(status.started, message->mutable_start_time());
  message->set_scenes(status.scenes);
  message->set_lost_sets(status.lost_sets);
  message->set_fault(status.fault);
  for (const DeviceStatus& camera : status.cameras) {
    v1::AcquiredCamera& added = *message->add_cameras();
    added.set_view(camera.name);
    added.set_images(camera.good);
    ErrorsToMessage(camera, &added);
    if (camera.last) ToMessage(*camera.last, added.mutable_last_image_time());
    if (camera.age) ToMessage(*camera.age, added.mutable_last_image_age());
  }
  v1::AcquiredRobot& robot = *message->mutable_robot();
  robot.set_samples(status.robot.good);
  ErrorsToMessage(status.robot, &robot);
  if (status.robot.age) ToMessage(*status.robot.age, robot.mutable_last_sample_age());
  LatencyToMessage(status.to_scene, message->mutable_to_scene());
  LatencyToMessage(status.to_map, message->mutable_to_map());
}

void ToMessage(const KnownVariant& known, const std::vector<std::string>& variants,
               v1::RobotVariant* message) {
  const absl::StatusOr<std::string> variant = known.OfLaterImages(variants);
  if (variant.ok()) {
    message->set_variant(*variant);
  } else {
    message->set_unknown(std::string(variant.status().message()));
  }
  message->set_changing(known.changing());
}

}  // namespace silhouette
