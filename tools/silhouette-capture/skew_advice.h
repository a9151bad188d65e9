// SPDX-License-Identifier: Apache-2.0
// What to do where the images of a set lie further apart than max_skew.
#pragma once

#include <string>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "common/times/times.h"

namespace silhouette {

// Follows "that is", or a time.
inline std::string SkewAdvice(absl::Duration max_skew) {
  return absl::StrCat("more than max_skew, ", SpokenTime(max_skew),
                      ": nothing is free in scenes of such images; trigger the cameras together, "
                      "or raise 'server: max_skew' in the cell file if nothing in the cell moves "
                      "far in that time");
}

}  // namespace silhouette
