// SPDX-License-Identifier: Apache-2.0
// How calls are admitted, read and answered: each passes the limits of its client, and its request
// is read here and nowhere else, so that no handler sees one that is too large or cannot be parsed.
#pragma once

#include <google/protobuf/message.h>
#include <grpcpp/server_context.h>
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/server_callback.h>
#include <grpcpp/support/status.h>

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "db/status/status_macros.h"
#include "server/service/clients.h"
#include "server/service/serving.h"
#include "server/service/worker_pool.h"
#include "silhouette/v1/collision_service.pb.h"
#include "silhouette/v1/scene_service.pb.h"

namespace silhouette {

// Most bytes of a text in a request: names of views, joints, variants, regions and presets.
inline constexpr size_t kLongestText = 256;

// Most bytes of a request, by its type.
template <typename Request>
inline constexpr size_t kMostBytes = size_t{1} << 20;
// Camera images of all views.
template <>
inline constexpr size_t kMostBytes<v1::PublishSceneRequest> = size_t{64} << 20;
// Masks of all views.
template <>
inline constexpr size_t kMostBytes<v1::AllowRegionRequest> = size_t{8} << 20;
// kMaxNumbers.
template <>
inline constexpr size_t kMostBytes<v1::CheckConfigurationsRequest> = size_t{32} << 20;
template <>
inline constexpr size_t kMostBytes<v1::StreamChecksRequest> = size_t{32} << 20;

// InvalidArgument that names the field. ToGrpc makes a google.rpc.BadRequest of it.
absl::Status FieldError(const std::string& field, const std::string& message);

// Parses a request. ResourceExhausted: it has more than `most` bytes. InvalidArgument: it cannot
// be parsed, and `request` is empty, or has a text of more than kLongestText bytes.
absl::Status ReadRequest(const grpc::ByteBuffer& bytes, size_t most,
                         google::protobuf::Message& request);
template <typename Request>
absl::Status ReadRequest(const grpc::ByteBuffer& bytes, Request& request) {
  return ReadRequest(bytes, kMostBytes<Request>, request);
}

// Replaces what is in `bytes`.
void WriteMessage(const google::protobuf::Message& message, grpc::ByteBuffer* bytes);

// The work of a call as work on its bytes: `work(request, response)` is called with a Request,
// valid during the call, and a Response*. `request` and `response` must outlive it.
template <typename Request, typename Response, typename Typed>
std::function<absl::Status()> OnBytes(const grpc::ByteBuffer* request, grpc::ByteBuffer* response,
                                      Typed work) {
  return [=]() -> absl::Status {
    Request typed;
    RETURN_IF_ERROR(ReadRequest(*request, typed));
    Response answer;
    RETURN_IF_ERROR(work(std::as_const(typed), &answer));
    WriteMessage(answer, response);
    return absl::OkStatus();
  };
}

// Who calls, as Clients counts it: by its name (QuotedNameOf), or else its address.
std::string ClientOf(grpc::CallbackServerContext& context);

// Finishes a call with what `work` returns, at once.
grpc::ServerUnaryReactor* AnswerHere(Serving& serving, grpc::CallbackServerContext* context,
                                     const std::function<absl::Status()>& work);

// The same on a thread of `workers`: for work that takes longer than a look-up. RESOURCE_EXHAUSTED
// if too much waits already.
grpc::ServerUnaryReactor* AnswerOn(WorkerPool& workers, Serving& serving,
                                   grpc::CallbackServerContext* context,
                                   const grpc::ByteBuffer& request,
                                   std::function<absl::Status()> work);

// Admits a call that lasts; to be kept until its end.
absl::StatusOr<Clients::Place> AdmitStream(Serving& serving, grpc::CallbackServerContext& context);

// A call that is refused before its work begins.
template <typename Reactor>
class Refusal final : public Reactor {
 public:
  explicit Refusal(const absl::Status& status);
  void OnDone() override { delete this; }
};

// What `work` returns; an exception that leaves it is Internal.
absl::Status Guarded(const std::function<absl::Status()>& work);

grpc::Status ToGrpc(const absl::Status& status);

template <typename Reactor>
Refusal<Reactor>::Refusal(const absl::Status& status) {
  this->Finish(ToGrpc(status));
}

}  // namespace silhouette
