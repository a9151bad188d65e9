// SPDX-License-Identifier: Apache-2.0
#include "server/page/page_calls.h"

#include <google/protobuf/message.h>
#include <google/protobuf/util/json_util.h>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "server/service/calls.h"
#include "server/service/regions.h"
#include "silhouette/v1/scene_service.pb.h"

namespace silhouette {
namespace {

absl::Status FromJson(const std::string& json, google::protobuf::Message& message) {
  const auto parsed = google::protobuf::util::JsonStringToMessage(json, &message);
  if (parsed.ok()) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("the body is no ", message.GetDescriptor()->name(),
                                                 " in JSON: ", std::string(parsed.message())));
}

}  // namespace

absl::Status AnswerPageCall(Serving& serving, std::optional<Role> role, const std::string& call,
                            const std::string& json, const std::string& client) {
  const Moment arrived = serving.settings.clock();
  const std::string who = absl::StrCat("page ", client);
  if (!role || !MayCall(*role, call)) {
    serving.AuditFirst(who, "call.denied", call);
    return absl::PermissionDeniedError(
        "this page is read-only; to change that, start the server with --page-role operator");
  }
  RETURN_IF_ERROR(serving.clients.Call(client));
  return Guarded([&]() -> absl::Status {
    if (call == kPageCalls[0]) {
      v1::AllowRegionRequest request;
      RETURN_IF_ERROR(FromJson(json, request));
      v1::AllowRegionResponse response;
      return Answer(serving, who, request, arrived, &response);
    }
    v1::RevokeRegionRequest request;
    RETURN_IF_ERROR(FromJson(json, request));
    v1::RevokeRegionResponse response;
    return Answer(serving, who, request, &response);
  });
}

}  // namespace silhouette
