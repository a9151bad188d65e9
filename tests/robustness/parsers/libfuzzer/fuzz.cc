// SPDX-License-Identifier: Apache-2.0
// libFuzzer's entry to the target that the environment variable FUZZ_TARGET names. "all": prints
// the names. Writes the target's seeds into the folder FUZZ_SEEDS, if it is named.
#include <cstdlib>
#include <fstream>
#include <iostream>

#include "tests/robustness/parsers/targets.h"

namespace {

silhouette::FuzzTarget ChosenTarget() {
  const char* const name = std::getenv("FUZZ_TARGET");
  for (const silhouette::FuzzTarget& target : silhouette::FuzzTargets()) {
    if (name != nullptr && name == std::string(target.name)) return target;
    std::cout << target.name << "\n";
  }
  std::cout.flush();
  std::_Exit(name != nullptr && name == std::string("all") ? 0 : 2);
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  const silhouette::FuzzTarget target = ChosenTarget();
  const char* const folder = std::getenv("FUZZ_SEEDS");
  if (folder == nullptr) return 0;
  int count = 0;
  for (const std::string& seed : target.seeds()) {
    std::ofstream(std::string(folder) + "/seed" + std::to_string(count++), std::ios::binary)
        << seed;
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const char* data, size_t size) {
  static const silhouette::FuzzTarget target = ChosenTarget();
  target.parse({data, size});
  return 0;
}
