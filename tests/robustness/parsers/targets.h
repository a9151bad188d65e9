// SPDX-License-Identifier: Apache-2.0
// Every parser of bytes that come from outside, as one function each for the fuzzer and for the
// test that replays seeds.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace silhouette {

// `parse` may refuse any bytes, but never ends the process, hangs or takes much memory.
struct FuzzTarget {
  const char* name;  // a file name
  void (*parse)(std::string_view bytes);
  // Bytes that it takes, for the fuzzer to start from.
  std::vector<std::string> (*seeds)();
};

std::span<const FuzzTarget> ApiTargets();       // requests, images and frames of devices
std::span<const FuzzTarget> DatabaseTargets();  // stored values, the database's file
std::span<const FuzzTarget> FileTargets();      // files that people and other programs write

// All of these.
std::vector<FuzzTarget> FuzzTargets();

}  // namespace silhouette
