// SPDX-License-Identifier: Apache-2.0
// What fuzzing found once is not found again; without clang, too.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <random>

#include "tests/folders.h"
#include "tests/random.h"
#include "tests/robustness/parsers/targets.h"

namespace silhouette {
namespace {

// What was written into corpus/<target> because it did harm, or may.
std::vector<std::string> Corpus(const std::string& target) {
  std::vector<std::string> all;
  const std::filesystem::path folder =
      std::filesystem::path(SourceFolder() + "/tests/robustness/parsers/corpus") / target;
  if (!std::filesystem::exists(folder)) return all;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    std::ifstream in(entry.path(), std::ios::binary);
    all.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  return all;
}

// With bits flipped, bytes taken out or doubled, or the end cut off.
std::string Mutated(std::string bytes, std::mt19937_64& random) {
  for (uint64_t changes = 1 + random() % 3; changes > 0 && !bytes.empty(); --changes) {
    const size_t at = random() % bytes.size();
    const size_t length = std::min(bytes.size() - at, 1 + random() % 8);
    switch (random() % 4) {
      case 0:
        bytes[at] = static_cast<char>(bytes[at] ^ 1 << random() % 8);
        break;
      case 1:
        bytes.erase(at, length);
        break;
      case 2:
        bytes.insert(at, bytes.substr(at, length));
        break;
      default:
        bytes.resize(at);
        break;
    }
  }
  return bytes;
}

class Parser : public testing::TestWithParam<FuzzTarget> {};

TEST_P(Parser, LivesThroughItsSeedsItsCorpusAndWhatIsLikeThem) {
  const FuzzTarget& target = GetParam();
  std::vector<std::string> inputs = target.seeds();
  ASSERT_FALSE(inputs.empty());
  for (std::string& bytes : Corpus(target.name)) inputs.push_back(std::move(bytes));
  for (const std::string& bytes : inputs) target.parse(bytes);
  Random random;
  for (int i = 0; i < SampleCount(100); ++i) {
    target.parse(Mutated(inputs[random() % inputs.size()], random));
  }
}

INSTANTIATE_TEST_SUITE_P(Every, Parser, testing::ValuesIn(FuzzTargets()),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace silhouette
