// SPDX-License-Identifier: Apache-2.0
// The server's metrics for Prometheus (docs/live.md lists them).
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"

namespace silhouette {

struct Serving;

// A small HTTP server of its own.
class Metrics {
 public:
  // Answers at http://ADDRESS/metrics until it is gone. `address`: "host:port"; errors are those
  // of CheckListenAddress. `serving` must outlive it.
  static absl::StatusOr<std::unique_ptr<Metrics>> Start(const std::string& address,
                                                        const Serving& serving);
  ~Metrics();

  // The address that is listened on, with the port that was chosen.
  const std::string& address() const { return address_; }

 private:
  struct Http;
  Metrics(std::unique_ptr<Http> http, std::string address);

  std::unique_ptr<Http> http_;
  std::string address_;
};

}  // namespace silhouette
