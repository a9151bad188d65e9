// SPDX-License-Identifier: Apache-2.0
// What a call of a driver behind gRPC ended with, in words for its user.
#pragma once

#include <grpcpp/support/status.h>

#include <string>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"

namespace silhouette {

// `driver`: "camera driver", say; `address`: as the cell's file states it. The code is that of
// `status`.
inline absl::Status DriverStatus(const std::string& driver, const std::string& address,
                                 const grpc::Status& status) {
  const auto code = static_cast<absl::StatusCode>(status.error_code());
  // gRPC's own words; a driver that answers has others.
  if (status.error_message().starts_with("failed to connect")) {
    return absl::Status(code, absl::StrCat("no ", driver, " answers at ", address,
                                           "; start it, or correct its address in the cell file"));
  }
  return absl::Status(code,
                      absl::StrCat("the ", driver, " at ", address, ": ", status.error_message()));
}

}  // namespace silhouette
