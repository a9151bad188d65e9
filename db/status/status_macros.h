// SPDX-License-Identifier: Apache-2.0
// RETURN_IF_ERROR and ASSIGN_OR_RETURN: pass an error on to the caller. For functions that return
// absl::Status or absl::StatusOr. InvalidArgument, FailedPrecondition, NotFound: make an error.
#pragma once

#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"

namespace silhouette {

// Errors whose message is the parts joined as absl::StrCat joins them.
template <typename... Parts>
absl::Status InvalidArgument(const Parts&... parts) {
  return absl::InvalidArgumentError(absl::StrCat(parts...));
}
template <typename... Parts>
absl::Status FailedPrecondition(const Parts&... parts) {
  return absl::FailedPreconditionError(absl::StrCat(parts...));
}
template <typename... Parts>
absl::Status NotFound(const Parts&... parts) {
  return absl::NotFoundError(absl::StrCat(parts...));
}

}  // namespace silhouette

// Returns the status of the expression if it is an error.
#define RETURN_IF_ERROR(...)                                              \
  do {                                                                    \
    if (absl::Status error_ = (__VA_ARGS__); !error_.ok()) return error_; \
  } while (false)

// ASSIGN_OR_RETURN(const Mask mask, ReadMask(path)): evaluates an absl::StatusOr; returns its
// status if it is an error, else initialises or assigns the left side with its value.
#define ASSIGN_OR_RETURN(left, ...) \
  SILHOUETTE_ASSIGN_OR_RETURN_(SILHOUETTE_JOIN_(result_at_, __LINE__), left, __VA_ARGS__)

#define SILHOUETTE_ASSIGN_OR_RETURN_(result, left, ...) \
  auto result = (__VA_ARGS__);                          \
  if (!result.ok()) return std::move(result).status();  \
  left = *std::move(result)

#define SILHOUETTE_JOIN_(a, b) SILHOUETTE_JOIN_NOW_(a, b)
#define SILHOUETTE_JOIN_NOW_(a, b) a##b
