// SPDX-License-Identifier: Apache-2.0
// silhouette-experiments still as its users meet it.
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/capture/session/program_cell.h"
#include "tests/folders.h"

namespace silhouette {
namespace {

TEST(StillExperimentProgram, WithoutNoiseNoVerdictChanges) {
  const ProgramCell files;
  const std::string line =
      absl::StrCat("'", ProgramFolder(), "/silhouette-experiments' still --cell '", files.cell(),
                   "' --database '", files.database(), "' --scenes 5 --robots 2 --format json >'",
                   files / "o", "' 2>'", files / "e", "'");
  ASSERT_EQ(std::system(line.c_str()), 0) << ReadText(files / "e");
  const auto rows = nlohmann::json::parse(ReadText(files / "o"));
  ASSERT_EQ(rows.size(), 4u) << "each robot without and with a person";
  for (const auto& row : rows) {
    EXPECT_EQ(row["scenes"], 5);
    EXPECT_EQ(row["configurations"], 45);
    EXPECT_EQ(row["median_changed"], 0);
    EXPECT_EQ(row["least_occupied"], row["most_occupied"]);
  }
  for (const size_t robot : {0u, 1u}) {
    EXPECT_EQ(rows[robot]["robot"], rows[robot + 2]["robot"]);
    EXPECT_LT(rows[robot]["median_occupied"], rows[robot + 2]["median_occupied"]) << "a person";
  }
}

}  // namespace
}  // namespace silhouette
