// silhouette-experiments cell as its users meet it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <set>

#include "tests/capture/program_cell.h"

namespace silhouette {
namespace {

using testing::HasSubstr;

class CellExperimentProgram : public testing::Test {
 protected:
  Outcome Run(const std::string& more) const {
    const std::string line =
        absl::StrCat("'", SILHOUETTE_BIN_DIR, "/silhouette-experiments' cell --cell '",
                     files_.cell(), "' --database '", files_.database(), "' ", more, " >'",
                     files_ / "o", "' 2>'", files_ / "e", "'");
    const int status = std::system(line.c_str());
    return {.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1,
            .out = ReadText(files_ / "o"),
            .err = ReadText(files_ / "e")};
  }

  ProgramCell files_;
};

TEST_F(CellExperimentProgram, CapturesMeasuresExplainsAndDraws) {
  const std::string options = "--scenes 3 --hidden 0 --off-grid 20 --seed 7 --format json";
  const Outcome first = Run(options + " --pictures 2 --out '" + files_ / "out" + "'");
  ASSERT_EQ(first.exit_code, 0) << first.err;
  const auto rows = nlohmann::json::parse(first.out);
  std::set<std::string> presets;
  for (const auto& row : rows) {
    presets.insert(row["preset"]);
    uint64_t causes = 0;
    for (const auto& [name, count] : row["causes"].items()) causes += count.get<uint64_t>();
    EXPECT_EQ(causes, row["missing_count"]) << "every missing configuration has its cause";
    EXPECT_EQ(row["seed"], 7);
  }
  for (const char* preset : {"uncalibrated", "paper", "calibrated", "paper-calibrated"}) {
    EXPECT_TRUE(presets.count(preset)) << preset;
  }
  for (const char* file : {"table.csv", "random-scenes.csv", "random-missing.csv"}) {
    EXPECT_FALSE(ReadText(files_ / "out/" + file).empty()) << file;
  }
  EXPECT_EQ(Run(options).out, first.out) << "the same seed, the same answer";
}

TEST_F(CellExperimentProgram, MistakesAreOneSentenceAndExitCodeTwo) {
  const auto expect_mistake = [&](const std::string& options, const std::string& message) {
    const Outcome outcome = Run(options);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.err, HasSubstr(message));
  };
  expect_mistake("--presets fast", "fast");
  expect_mistake("--margin -1", "margin");
  files_.WriteCell({{"simulation: simulation.yaml\n", ""}, {"driver: sim", "driver: none"}});
  expect_mistake("--scenes 1", "cell.yaml");
}

}  // namespace
}  // namespace silhouette
