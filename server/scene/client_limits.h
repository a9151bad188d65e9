// SPDX-License-Identifier: Apache-2.0
// What the server's clients may take of it. Honest ones stay far below.
#pragma once

#include <cstdint>

namespace silhouette {

struct ClientLimits {
  int connections = 1000;
  int connections_per_client = 200;
  // Watches, streams of checks and spaces that are asked for.
  int streams = 500;
  int streams_per_client = 100;
  // Of one client; it may save up those of one second.
  double calls_per_second = 100'000;
  // Calls that may wait for a worker thread.
  int waiting = 2000;
  int waiting_per_client = 1000;
  // Bytes of memory for requests that arrive or wait.
  uint64_t request_memory = 1'000'000'000;
};

}  // namespace silhouette
