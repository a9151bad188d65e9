// SPDX-License-Identifier: Apache-2.0
// The operator's page in the browser (docs/page.md), of the cell or of a recording, over HTTP.
// Read-only, unless it has a role.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "server/gate/roles.h"
#include "server/page/replay.h"
#include "server/service/serving.h"

namespace silhouette {

// Serves in threads of its own, at a lower priority than all others. Requests must name a numeric
// address or localhost as their host, against DNS rebinding. Changes are asked for by POST, with
// the page's own origin and with a type that forms cannot send. Without an open event stream it
// makes no snapshots.
class CellPage {
 public:
  // The most event streams at a time. Each has at most ten events a second.
  static constexpr int kMostStreams = 4;
  // Further connections wait. More than kMostStreams, for the files of the page.
  static constexpr int kMostConnections = 12;
  // Most bytes of a request's body: masks of all views, such as ten of 1024 x 1024 pixels.
  static constexpr size_t kMostBody = size_t{2} << 20;

  // Answers at http://ADDRESS/ until it is gone. `address`: "host:port"; errors are those of
  // CheckListenAddress, and FailedPrecondition, if other machines reach it and `insecure` is not
  // set. `role`: what everyone who reaches the page may do; nothing: look. FailedPrecondition: it
  // has one, and other machines reach it, whether `insecure` is set or not. Unavailable: it does
  // not begin to serve. `serving` must outlive it, and Server::Stop must not come before its end.
  static absl::StatusOr<std::unique_ptr<CellPage>> Start(const std::string& address, bool insecure,
                                                         Serving& serving,
                                                         std::optional<Role> role = std::nullopt);
  // The same of a recording, which must outlive it. The position in the recording is the browser's:
  // each request names its time, and nothing here changes.
  static absl::StatusOr<std::unique_ptr<CellPage>> Start(const std::string& address, bool insecure,
                                                         const Replay& replay);
  ~CellPage();

  // The address that is listened on, with the port that was chosen.
  const std::string& address() const { return address_; }

  // How many snapshots of the cell were made.
  uint64_t snapshots() const;

 private:
  struct Http;
  CellPage(std::unique_ptr<Http> http, std::string address);
  static absl::StatusOr<std::unique_ptr<CellPage>> Listen(const std::string& address, bool insecure,
                                                          std::unique_ptr<Http> http);

  std::unique_ptr<Http> http_;
  std::string address_;
};

}  // namespace silhouette
