// SPDX-License-Identifier: Apache-2.0
// Changes that the page asks for: calls of the API, as far as the page's role permits them.
#pragma once

#include <optional>
#include <string>

#include "absl/status/status.h"
#include "server/gate/roles.h"
#include "server/service/serving.h"

namespace silhouette {

inline constexpr const char* kPageCalls[] = {"/silhouette.v1.SceneService/AllowRegion",
                                             "/silhouette.v1.SceneService/RevokeRegion"};

// Makes one of kPageCalls. `json`: the request in the API's JSON. `client`: the browser's address.
// PermissionDenied: the page has no role that may do so. InvalidArgument: the text is no such
// request. ResourceExhausted: the client calls too often. Further errors: those of the call.
absl::Status AnswerPageCall(Serving& serving, std::optional<Role> role, const std::string& call,
                            const std::string& json, const std::string& client);

}  // namespace silhouette
