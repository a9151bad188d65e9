// --preset, --min-views, --max-occluded-views, --epipolar, --errors-convict, --off-grid;
// --clearance.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "silhouette/client.h"
#include "silhouette/policy.h"

namespace silhouette {

struct PolicyOptions {
  std::string preset;
  std::optional<int> min_views;
  std::optional<int> max_occluded_views;
  std::string epipolar;
  int errors_convict = 0;  // above 0 yes, below 0 no, 0 not said
  std::string off_grid;

  client::Policy policy() const;
  // Whether anything is said.
  bool given() const { return *this != PolicyOptions{}; }
  bool operator==(const PolicyOptions&) const = default;
};

void AddPolicyOptions(CLI::App& command, PolicyOptions& options);

// --clearance: it is measured.
void AddClearanceFlag(CLI::App& command, client::Clearance& clearance);

}  // namespace silhouette
