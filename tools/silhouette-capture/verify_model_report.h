// SPDX-License-Identifier: Apache-2.0
// What verify-model compares, and what it says of it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "calib/robot/drawing/drawn_robot.h"
#include "capture/verification/model_comparison.h"
#include "capture/verification/verified_robot.h"
#include "db/store/store.h"
#include "tools/silhouette-capture/opened_cell.h"

namespace silhouette {

struct VerifyModelOptions {
  CellArguments cell;
  uint64_t sample = 300;
  std::string captured;  // empty: the robot is driven
  std::string picture;   // empty: beside the database
  uint64_t seed = 1;
  std::vector<std::pair<std::string, std::string>> not_checked;
};

// What is compared.
struct ModelOfCell {
  std::unique_ptr<Database> database;
  DrawnCell cell;
  DrawnRobot bare;
  std::vector<std::string> links;
  std::vector<std::string> views;
};

// The command with another sample.
std::string Again(const VerifyModelOptions& options, size_t sample);

// How as many configurations as are enough are compared, where `configurations` were.
std::string LargerSample(const VerifyModelOptions& options, const ModelComparison& found,
                         size_t configurations);

std::string ComparisonText(const VerifyModelOptions& options, const ModelOfCell& model,
                           const ModelComparison& found, size_t configurations);

nlohmann::ordered_json ComparisonJson(const ModelOfCell& model, const ModelComparison& found,
                                      size_t configurations);

// The worst masks: what is drawn, what growth adds, what was captured beyond either, and what
// certainly shows the robot by its model but was not captured.
absl::Status WriteWorst(const ModelOfCell& model, const ModelComparison& found,
                        const std::vector<ModelSample>& samples, const std::string& path);

}  // namespace silhouette
