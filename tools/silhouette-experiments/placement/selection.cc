// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/placement/selection.h"

#include <algorithm>

namespace silhouette {
namespace {

bool Has(const CameraSet& set, int camera) {
  return std::find(set.begin(), set.end(), camera) != set.end();
}

// Replaces `best` by the best of `sets` if that is better; whether it was.
bool Improve(const std::vector<CameraSet>& sets, const Evaluate& evaluate, Selection& best) {
  const std::vector<Measures> measures = evaluate(sets);
  bool improved = false;
  for (size_t i = 0; i < sets.size(); ++i) {
    if (!best.cameras.empty() && !measures[i].BetterThan(best.measures)) continue;
    best = {sets[i], measures[i]};
    improved = true;
  }
  return improved;
}

}  // namespace

std::vector<Selection> Select(int candidates, int count, const Evaluate& evaluate,
                              const std::function<bool()>& stop) {
  std::vector<Selection> selections;
  CameraSet before;
  while (static_cast<int>(selections.size()) < std::min(count, candidates)) {
    std::vector<CameraSet> larger;
    for (int camera = 0; camera < candidates; ++camera) {
      if (Has(before, camera)) continue;
      larger.push_back(before);
      larger.back().push_back(camera);
    }
    if (stop()) return selections;
    Selection best;
    Improve(larger, evaluate, best);
    // The camera just added was compared with all others already, if it was the only one.
    for (bool better = best.cameras.size() > 1; better;) {
      std::vector<CameraSet> exchanged;
      for (size_t place = 0; place < best.cameras.size(); ++place) {
        for (int camera = 0; camera < candidates; ++camera) {
          if (Has(best.cameras, camera)) continue;
          exchanged.push_back(best.cameras);
          exchanged.back()[place] = camera;
        }
      }
      if (stop()) return selections;
      better = !exchanged.empty() && Improve(exchanged, evaluate, best);
    }
    before = best.cameras;
    selections.push_back(std::move(best));
  }
  return selections;
}

}  // namespace silhouette
