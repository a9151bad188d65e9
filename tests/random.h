// SPDX-License-Identifier: Apache-2.0
// Random numbers for tests.
#pragma once

#include <gtest/gtest.h>

#include <random>

namespace silhouette {

// The same numbers in every run, so that a failure comes again; others with --gtest_shuffle, which
// prints its seed and takes it back by --gtest_random_seed.
class Random : public std::mt19937_64 {
 public:
  // Without shuffling GoogleTest 1.12 takes its seed from the time.
  Random()
      : std::mt19937_64(
            GTEST_FLAG_GET(shuffle)
                ? static_cast<result_type>(testing::UnitTest::GetInstance()->random_seed())
                : result_type{0}) {}
};

// How many random samples a test draws: `count`, a tenth of it with a sanitizer, which is as slow
// and looks at how results come about. What they are is tested without.
constexpr int SampleCount(int count) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  return (count + 9) / 10;
#else
  return count;
#endif
}

}  // namespace silhouette
