// SPDX-License-Identifier: Apache-2.0
#include "capture/verification/growth_fit.h"

#include <algorithm>

namespace silhouette {
namespace {

bool Reaches(const GrowthFit::Needs& needs, const std::vector<int>& steps) {
  for (size_t link = 0; link < steps.size(); ++link) {
    if (needs[link] <= steps[link]) return true;
  }
  return false;
}

}  // namespace

bool GrowthFit::Reached(const Needs& needs) const {
  return std::ranges::any_of(needs, [&](uint8_t need) { return need <= most_steps_; });
}

// Whether there was a pixel left.
bool GrowthFit::Take(std::vector<int>& steps, std::vector<bool>& done) const {
  const size_t links = steps.size();
  // By link and steps: pixels that are reached at last there.
  std::vector<std::vector<uint64_t>> reached(
      links, std::vector<uint64_t>(static_cast<size_t>(most_steps_) + 1));
  size_t i = 0;
  for (const auto& [needs, count] : pixels_) {
    const bool before = done[i];
    done[i] = before || Reaches(needs, steps);
    if (done[i++]) continue;
    for (size_t link = 0; link < links; ++link) {
      if (needs[link] <= most_steps_) reached[link][needs[link]] += count;
    }
  }
  double best = 0;
  size_t best_link = 0;
  int best_steps = 0;
  for (size_t link = 0; link < links; ++link) {
    uint64_t gain = 0;
    for (int k = 0; k <= most_steps_; ++k) {
      gain += reached[link][static_cast<size_t>(k)];
      if (k <= steps[link] || gain == 0) continue;
      const std::vector<double>& cost = costs_[link];
      const double adds = cost[static_cast<size_t>(k)] - cost[static_cast<size_t>(steps[link])];
      const double worth = static_cast<double>(gain) / (1 + std::max(0.0, adds));
      if (worth <= best) continue;
      best = worth;
      best_link = link;
      best_steps = k;
    }
  }
  if (best == 0) return false;
  steps[best_link] = best_steps;
  return true;
}

std::vector<int> GrowthFit::Steps(std::vector<int> from) const {
  std::vector<int> steps = from;
  std::vector<bool> done(pixels_.size());
  while (Take(steps, done)) {
  }
  for (size_t link = 0; link < steps.size(); ++link) {
    std::vector<int> others = steps;
    others[link] = from[link];
    int least = from[link];
    for (const auto& [needs, count] : pixels_) {
      if (!Reaches(needs, others)) least = std::max(least, static_cast<int>(needs[link]));
    }
    steps[link] = least;
  }
  return steps;
}

}  // namespace silhouette
