// SPDX-License-Identifier: Apache-2.0
// GrowthFit: how far links must grow so that all pixels are reached, at few additional pixels.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

namespace silhouette {

// For one thread.
class GrowthFit {
 public:
  // By link: the least number of steps at which it reaches the pixel; above most_steps: none.
  using Needs = std::vector<uint8_t>;
  // By link, then steps 0 to most_steps: the pixels that the link grown so far adds.
  using Costs = std::vector<std::vector<double>>;

  GrowthFit(int most_steps, Costs costs) : most_steps_(most_steps), costs_(std::move(costs)) {}

  bool Reached(const Needs& needs) const;
  // A pixel that some link reaches.
  void Add(const Needs& needs) { ++pixels_[needs]; }

  // By link, no fewer than `from`: for every pixel there is a link that reaches it. Takes the link
  // and the steps that reach most pixels for what they add, again and again; then as few of all as
  // still do.
  std::vector<int> Steps(std::vector<int> from) const;

 private:
  bool Take(std::vector<int>& steps, std::vector<bool>& done) const;

  int most_steps_;
  Costs costs_;
  std::map<Needs, uint64_t> pixels_;  // how many need the same
};

}  // namespace silhouette
