// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/cell/study.h"

#include <algorithm>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "db/status/status_macros.h"

namespace silhouette::cell_experiment {
namespace {

constexpr int kPicturesPerCause = 2;

// The scenes, those with the most missing configurations first.
std::vector<size_t> WorstFirst(const std::vector<SceneRecord>& records) {
  std::vector<size_t> order(records.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return records[a].missing.size() > records[b].missing.size();
  });
  return order;
}

// The first missing configuration of a scene with a cause.
std::optional<size_t> FirstWith(const SceneRecord& record, Cause cause) {
  for (size_t i = 0; i < record.missing.size(); ++i) {
    for (const Explanation& explanation : record.missing[i].explanations) {
      if (explanation.cause == cause) return i;
    }
  }
  return std::nullopt;
}

}  // namespace

absl::StatusOr<SceneRecord> RunScene(const TrialSetting& setting, Explainer& explainer,
                                     const SceneSource& source, int number) {
  ASSIGN_OR_RETURN(ViewedScene viewed, View(setting, source(number), number));
  TrialResult result = Judge(setting, viewed, number);
  SceneRecord record{.number = number,
                     .robot_on_grid = viewed.truth.robot_on_grid,
                     .blocked = result.blocked,
                     .tallies = std::move(result.tallies),
                     .missing = {}};
  for (MissedConfiguration& missed : result.missed) {
    std::vector<Explanation> explanations = explainer.Explain(viewed, missed);
    record.missing.push_back({std::move(missed), std::move(explanations)});
  }
  return record;
}

std::vector<Chosen> ChooseForPictures(const std::vector<SceneRecord>& records, size_t count) {
  const std::vector<size_t> order = WorstFirst(records);
  std::set<std::pair<size_t, size_t>> taken;
  std::vector<Chosen> chosen;
  const auto take = [&](size_t record, size_t missing) {
    if (chosen.size() == count || !taken.insert({record, missing}).second) return false;
    chosen.push_back({record, missing});
    return true;
  };
  for (size_t cause = 0; cause < kCauses; ++cause) {
    int pictures = 0;
    for (const size_t record : order) {
      if (pictures == kPicturesPerCause) break;
      const auto missing = FirstWith(records[record], static_cast<Cause>(cause));
      if (missing && take(record, *missing)) ++pictures;
    }
  }
  for (size_t round = 0; chosen.size() < count; ++round) {
    bool any = false;
    for (const size_t record : order) {
      if (round >= records[record].missing.size()) continue;
      any = true;
      take(record, round);
    }
    if (!any) break;
  }
  return chosen;
}

}  // namespace silhouette::cell_experiment
