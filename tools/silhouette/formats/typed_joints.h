// SPDX-License-Identifier: Apache-2.0
// Joint values as people type them, in the units of a database's joints.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "silhouette/configuration_grid.h"
#include "silhouette/v1/database_service.pb.h"
#include "tools/program/joint_values.h"

namespace silhouette {

// Refuses an angle for a joint that slides and a length for one that turns. Not thread-safe.
class TypedJoints {
 public:
  // `unit`: of values without one, where the joint does not slide. `database` tells which joints
  // slide; it is called once, for the first value whose unit matters.
  TypedJoints(AngleUnit unit, std::function<absl::StatusOr<v1::GetDatabaseResponse>()> database);

  // One value per joint of the grid, separated by commas: "0.5,-30deg,0.2m". InvalidArgument,
  // naming what is wrong, after `place`; an error of `database`.
  absl::StatusOr<Configuration> Parse(absl::string_view text);
  absl::StatusOr<Configuration> Parse(const std::vector<std::string>& values,
                                      absl::string_view place = "");

  // "joint_1=0.5". As Parse; the unit of a joint that is not in the grid is believed.
  absl::StatusOr<std::pair<std::string, double>> ParseNamed(const std::string& text);

  // Of each joint of the grid, whether it slides; asks the database if Parse did not. Nothing where
  // that is not known.
  std::vector<std::optional<bool>> Slides();

  // What Parse took, each value with its unit where one was stated or `unit` is degrees.
  std::string Spoken(absl::string_view text) const;

 private:
  absl::Status AskIfItMatters(absl::string_view text);
  absl::Status Ask();
  // Of the joint at this place of the grid; nothing if that is not known.
  std::optional<bool> Slides(size_t joint) const;

  AngleUnit unit_;
  std::function<absl::StatusOr<v1::GetDatabaseResponse>()> database_;
  std::optional<v1::Grid> grid_;  // once it was asked for
};

}  // namespace silhouette
