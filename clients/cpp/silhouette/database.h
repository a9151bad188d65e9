// SPDX-License-Identifier: Apache-2.0 What a client needs to know about the served database.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "silhouette/configuration_grid.h"
#include "silhouette/mask.h"
#include "silhouette/policy.h"
#include "silhouette/scene.h"

namespace silhouette::client {

// One stationary camera; sizes in pixels.
struct View {
  std::string name;
  int image_width = 0;
  int image_height = 0;
  MaskSize mask_size;
  // Pixels that the robot covers in every configuration.
  uint32_t permanent_pixels = 0;
  // Safety margin in mask pixels, and number of ignored pixels.
  double margin = 0;
  uint32_t ignored_pixels = 0;
};

struct Database {
  std::string cell_name;
  uint64_t generation = 0;
  ConfigurationGrid grid;
  // Fixed joints (outside the grid), and their values at capture.
  std::vector<JointPosition> fixed_joints;
  std::vector<View> views;
  // Configurations: all, with a robot image, in a region never to enter, with a robot image that
  // fails its checksum. The rest is missing.
  uint64_t configurations = 0;
  uint64_t captured = 0;
  uint64_t excluded = 0;
  uint64_t corrupt = 0;
  // The policy of requests without one.
  Policy default_policy;
  // Whether the views are calibrated, and the presets that requests may name.
  bool calibrated = false;
  std::vector<std::string> presets;
  // The names of the variants, the default one first; empty: the server knows no variants.
  std::vector<std::string> variants = {};
};

}  // namespace silhouette::client
