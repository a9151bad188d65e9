// SPDX-License-Identifier: Apache-2.0
// Cell files for tests, as text.
#pragma once

#include <gmock/gmock.h>

#include <fstream>
#include <regex>
#include <string>

#include "absl/strings/str_cat.h"
#include "tests/folders.h"
#include "tests/test_folder.h"
#include "tools/cell/cell.h"

namespace silhouette {

inline constexpr char kBareCell[] = R"(name: bare
robot:
  joints:
    - {name: a, lower: 0, upper: 90 deg}
    - {name: b, continuous: true}
  fixed: {c: 0.5}
grid:
  steps: {a: 10, b: 36}
views:
  - {name: top}
  - {name: side, mask_size: [32, 16]}
)";

inline std::string Write(const std::string& text) {
  static int count = 0;
  const std::string path = (TestFolder() / ("cell_" + std::to_string(count++) + ".yaml")).string();
  std::ofstream(path) << text;
  return path;
}

inline absl::StatusOr<Cell> Load(const std::string& text) { return LoadCell(Write(text)); }

// kBareCell with `from` replaced by `to`.
inline std::string Changed(const std::string& from, const std::string& to) {
  std::string text = kBareCell;
  const size_t place = text.find(from);
  EXPECT_NE(place, std::string::npos) << from;
  return text.replace(place, from.size(), to);
}

inline std::string MessageOf(const std::string& text) {
  const absl::StatusOr<Cell> cell = Load(text);
  EXPECT_EQ(cell.status().code(), absl::StatusCode::kInvalidArgument);
  return std::regex_replace(std::string(cell.status().message()), std::regex("^.*/"), "");
}

// The RX130 with all its joints; `robot` are further lines of the section.
inline std::string SixJoints(const std::string& robot, const std::string& rest = "") {
  return absl::StrCat("name: arm\nrobot:\n  urdf: ", SourceFolder(),
                      "/capture/sim/robots/rx130.urdf\n", robot,
                      "  joints: [{name: joint_1}, {name: joint_2}, {name: joint_3}, {name: "
                      "joint_4}, {name: joint_5}, {name: joint_6}]\nviews: [{name: top}]\n",
                      rest);
}

}  // namespace silhouette
