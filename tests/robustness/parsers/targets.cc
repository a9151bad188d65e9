// SPDX-License-Identifier: Apache-2.0
#include "tests/robustness/parsers/targets.h"

namespace silhouette {

std::vector<FuzzTarget> FuzzTargets() {
  std::vector<FuzzTarget> targets;
  for (const auto& some : {ApiTargets(), DatabaseTargets(), FileTargets()}) {
    targets.insert(targets.end(), some.begin(), some.end());
  }
  return targets;
}

}  // namespace silhouette
