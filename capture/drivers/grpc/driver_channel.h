// SPDX-License-Identifier: Apache-2.0
// The connection to a driver behind gRPC.
#pragma once

#include <grpcpp/grpcpp.h>

#include <memory>
#include <string>

namespace silhouette {

// Directly, whatever proxy the environment names. A driver that was started again is found again
// within about a second, one on a machine that was switched off within about 5 s. Messages may have
// a gigabyte.
inline std::shared_ptr<grpc::Channel> DriverChannel(
    const std::string& address, const std::shared_ptr<grpc::ChannelCredentials>& credentials) {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(1 << 30);
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 5000);  // the time for one attempt
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 100);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 1000);
  return grpc::CreateCustomChannel(address, credentials, arguments);
}

}  // namespace silhouette
