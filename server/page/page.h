// SPDX-License-Identifier: Apache-2.0
// The page for whoever stands beside the cell (docs/page.md): read-only, over HTTP.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "server/service/serving.h"

namespace silhouette {

// Has threads of its own, which give way to all others. Requests must name a numeric address or
// localhost as their host, so that no foreign site can be rebound to it. As long as nobody looks it
// makes nothing.
class CellPage {
 public:
  // At most so many see the page at a time, each at most every 0.1 s.
  static constexpr int kMostStreams = 4;
  // Further connections wait. More than kMostStreams, for the files of the page.
  static constexpr int kMostConnections = 12;

  // Answers at http://ADDRESS/ until it is gone. `address`: "host:port"; errors are those of
  // CheckListenAddress, and FailedPrecondition, if other machines reach it and `insecure` is not
  // set. `serving` must outlive it, and Server::Stop must not come before its end.
  static absl::StatusOr<std::unique_ptr<CellPage>> Start(const std::string& address, bool insecure,
                                                         Serving& serving);
  ~CellPage();

  // The address that is listened on, with the port that was chosen.
  const std::string& address() const { return address_; }

  // How many snapshots were made.
  uint64_t snapshots() const;

 private:
  struct Http;
  CellPage(std::unique_ptr<Http> http, std::string address);

  std::unique_ptr<Http> http_;
  std::string address_;
};

}  // namespace silhouette
