// SPDX-License-Identifier: Apache-2.0
// What is really free, to judge verdicts by: written by `silhouette-sim truth`.
#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>

#include "absl/status/statusor.h"
#include "db/mask/configuration_grid.h"
#include "silhouette/configuration_space.h"

namespace silhouette {

// Whether the robot touches an obstacle, for every configuration of a grid.
class Truth {
 public:
  // Reads CSV: a header with `number`, the names of the grid's joints and `contact` among others,
  // then a row for every configuration of the grid, contact 0 or 1. InvalidArgument, naming file
  // and line, if it is not that, or of another grid.
  static absl::StatusOr<Truth> Read(const std::string& file, const ConfigurationGrid& grid);

  // `number` is that of a configuration of the grid.
  bool Contact(ConfigurationNumber number) const { return contacts_.at(number); }

 private:
  std::unordered_map<ConfigurationNumber, bool> contacts_;
};

// Counts of configurations.
struct Judgement {
  uint64_t configurations = 0;
  uint64_t occupied_in_truth = 0;
  uint64_t missing = 0;     // reported free, really occupied
  uint64_t additional = 0;  // reported occupied, really free
  uint64_t unknown = 0;     // reported unknown, whatever they really are
};

// `truth` is of the grid of `space`.
Judgement Judge(const client::ConfigurationSpace& space, const Truth& truth);

}  // namespace silhouette
