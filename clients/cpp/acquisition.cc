// SPDX-License-Identifier: Apache-2.0
#include "silhouette/acquisition.h"

#include "clients/cpp/connection.h"
#include "clients/cpp/messages.h"
#include "silhouette/client.h"

namespace silhouette::client {
namespace {

AcquisitionLatency LatencyFrom(const v1::AcquisitionLatency& message) {
  return {.count = message.count(),
          .median = FromMessage(message.median()),
          .p99 = FromMessage(message.p99()),
          .longest = FromMessage(message.longest())};
}

// What both messages have.
template <typename Message>
AcquiredDevice DeviceFrom(const Message& message) {
  AcquiredDevice device;
  device.serving = message.serving();
  device.errors = message.errors();
  device.fault = message.fault();
  device.last_error = message.last_error();
  if (message.has_last_error_time())
    device.last_error_time = FromMessage(message.last_error_time());
  return device;
}

RobotVariant RobotVariantFrom(const v1::RobotVariant& message) {
  return {
      .variant = message.variant(), .changing = message.changing(), .unknown = message.unknown()};
}

absl::StatusOr<VariantChange> Change(const Connection& connection,
                                     const v1::ChangeVariantRequest& request,
                                     absl::Duration timeout) {
  const auto response = connection.Call(connection.scenes(), &v1::SceneService::Stub::ChangeVariant,
                                        request, timeout);
  if (!response.ok()) return response.status();
  return VariantChange{.robot_variant = RobotVariantFrom(response->robot_variant()),
                       .last_scene_before = response->last_scene_before()};
}

}  // namespace

absl::StatusOr<VariantChange> Client::BeginVariantChange() const {
  v1::ChangeVariantRequest request;
  request.set_changing(true);
  return Change(*connection_, request, timeout_);
}

absl::StatusOr<VariantChange> Client::ChangeVariant(const std::string& variant) const {
  v1::ChangeVariantRequest request;
  request.set_variant(variant);
  return Change(*connection_, request, timeout_);
}

absl::StatusOr<Acquisition> Client::GetAcquisition() const {
  const auto response =
      connection_->Call(connection_->scenes(), &v1::SceneService::Stub::GetAcquisition,
                        v1::GetAcquisitionRequest(), timeout_);
  if (!response.ok()) return response.status();
  const v1::Acquisition& message = response->acquisition();
  Acquisition acquisition{.serving = message.serving(),
                          .started = FromMessage(message.start_time()),
                          .scenes = message.scenes(),
                          .lost_sets = message.lost_sets(),
                          .fault = message.fault(),
                          .cameras = {},
                          .robot = DeviceFrom(message.robot()),
                          .to_scene = LatencyFrom(message.to_scene()),
                          .to_map = LatencyFrom(message.to_map()),
                          .robot_variant = RobotVariantFrom(message.robot_variant())};
  for (const v1::AcquiredCamera& camera : message.cameras()) {
    AcquiredDevice& added = acquisition.cameras.emplace_back(DeviceFrom(camera));
    added.view = camera.view();
    added.good = camera.images();
    if (camera.has_last_image_age()) added.age = FromMessage(camera.last_image_age());
  }
  acquisition.robot.good = message.robot().samples();
  if (message.robot().has_last_sample_age()) {
    acquisition.robot.age = FromMessage(message.robot().last_sample_age());
  }
  return acquisition;
}

}  // namespace silhouette::client
