// SPDX-License-Identifier: Apache-2.0
// Calls without stubs: the health and reflection services speak gRPC's own protocols, whose
// messages are small enough to be written by hand.
#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>
#include <grpcpp/completion_queue.h>
#include <grpcpp/generic/generic_stub.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>

namespace silhouette {

// `response`: empty if the call fails.
inline grpc::Status RawStatus(const std::shared_ptr<grpc::Channel>& channel,
                              const std::string& method, const std::string& request,
                              std::string* response) {
  grpc::ClientContext context;
  grpc::CompletionQueue queue;
  grpc::GenericStub stub(channel);
  const auto call = stub.PrepareCall(&context, method, &queue);
  void* tag = nullptr;
  bool ok = false;
  call->StartCall(nullptr);
  queue.Next(&tag, &ok);
  const grpc::Slice slice(request);
  call->WriteLast(grpc::ByteBuffer(&slice, 1), {}, nullptr);
  queue.Next(&tag, &ok);
  grpc::ByteBuffer bytes;
  call->Read(&bytes, nullptr);
  queue.Next(&tag, &ok);
  grpc::Status status;
  call->Finish(&status, nullptr);
  queue.Next(&tag, &ok);
  grpc::Slice answer;
  if (bytes.TrySingleSlice(&answer).ok()) {
    response->assign(reinterpret_cast<const char*>(answer.begin()), answer.size());
  }
  return status;
}

inline std::string RawCall(const std::shared_ptr<grpc::Channel>& channel, const std::string& method,
                           const std::string& request) {
  std::string response;
  const grpc::Status status = RawStatus(channel, method, request, &response);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return response;
}

// What the health service says of `name`: "\x08\x01" is SERVING, "\x08\x02" NOT_SERVING.
inline std::string HealthOf(const std::shared_ptr<grpc::Channel>& channel,
                            const std::string& name) {
  const std::string request =
      name.empty() ? "" : std::string("\x0a") + static_cast<char>(name.size()) + name;
  return RawCall(channel, "/grpc.health.v1.Health/Check", request);
}

}  // namespace silhouette
