// SPDX-License-Identifier: Apache-2.0
// GrpcRobotServer: a simulated controller behind the RobotDriverService of
// proto/silhouette/v1/robot_driver.proto.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "capture/sim/served/simulated_controller.h"

namespace silhouette {

class GrpcRobotServer {
 public:
  // `controller` must outlive it. `address`: host:port, port 0 a free one. Unavailable: it cannot
  // be listened on.
  static absl::StatusOr<std::unique_ptr<GrpcRobotServer>> Start(SimulatedController& controller,
                                                                const std::string& address);
  ~GrpcRobotServer();

  // host:port
  std::string address() const;

 private:
  struct Impl;  // keeps gRPC out of this header

  explicit GrpcRobotServer(std::unique_ptr<Impl> impl);

  std::unique_ptr<Impl> impl_;
};

}  // namespace silhouette
