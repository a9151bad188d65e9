// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/placement/trials.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "tests/random.h"

namespace silhouette {
namespace {

// What a set leaves uncovered of 64 things, each camera covering some.
Measures Uncovered(const CameraSet& cameras, const std::vector<uint64_t>& covers) {
  uint64_t covered = 0;
  for (int camera : cameras) covered |= covers[static_cast<size_t>(camera)];
  return {.tested = 64, .occupied = 0, .missing = 64 - __builtin_popcountll(covered)};
}

Evaluate EvaluateBy(const std::vector<uint64_t>& covers) {
  return [covers](const std::vector<CameraSet>& sets) {
    std::vector<Measures> measures;
    for (const CameraSet& set : sets) measures.push_back(Uncovered(set, covers));
    return measures;
  };
}

bool Never() { return false; }

// Camera 0 covers most, but 1 and 2 together cover all, and no pair with 0 does.
TEST(Select, ExchangesWhatGreedyChoiceGotWrong) {
  const uint64_t left = 0x00000000ffffffff;
  const std::vector<uint64_t> covers = {0x0000ffffffff0000 | 0x3, left, ~left};
  const std::vector<Selection> selections = Select(3, 2, EvaluateBy(covers), Never);
  ASSERT_EQ(selections.size(), 2u);
  EXPECT_EQ(selections[0].cameras, CameraSet{0});
  EXPECT_EQ(std::set<int>(selections[1].cameras.begin(), selections[1].cameras.end()),
            (std::set<int>{1, 2}));
  EXPECT_EQ(selections[1].measures.missing, 0);
}

TEST(Select, NoExchangeOfOneCameraImprovesWhatIsChosen) {
  Random random;
  for (int round = 0; round < 20; ++round) {
    std::vector<uint64_t> covers;
    for (int camera = 0; camera < 12; ++camera) covers.push_back(random() & random());
    const std::vector<Selection> selections = Select(12, 4, EvaluateBy(covers), Never);
    ASSERT_EQ(selections.size(), 4u);
    for (const Selection& selection : selections) {
      EXPECT_EQ(std::set<int>(selection.cameras.begin(), selection.cameras.end()).size(),
                selection.cameras.size());
      EXPECT_EQ(selection.measures.missing, Uncovered(selection.cameras, covers).missing);
      for (size_t place = 0; place < selection.cameras.size(); ++place) {
        for (int camera = 0; camera < 12; ++camera) {
          CameraSet other = selection.cameras;
          other[place] = camera;
          EXPECT_FALSE(Uncovered(other, covers).BetterThan(selection.measures));
        }
      }
    }
  }
}

TEST(Select, FewerMissingWinOverFewerAdditional) {
  const Evaluate evaluate = [](const std::vector<CameraSet>& sets) {
    std::vector<Measures> measures;
    for (const CameraSet& set : sets) {
      measures.push_back(set[0] == 1 ? Measures{.missing = 1, .additional = 900}
                                     : Measures{.missing = 2, .additional = set[0]});
    }
    return measures;
  };
  EXPECT_EQ(Select(5, 1, evaluate, Never)[0].cameras, CameraSet{1});
}

TEST(Select, TakesNoMoreThanThereAre) {
  EXPECT_EQ(Select(2, 5, EvaluateBy({1, 2}), Never).size(), 2u);
}

TEST(Select, StopsWithWhatIsFinished) {
  int asked = 0;
  const auto stop = [&] { return ++asked > 2; };
  EXPECT_EQ(Select(3, 3, EvaluateBy({1, 2, 4}), stop).size(), 1u);
}

}  // namespace
}  // namespace silhouette
