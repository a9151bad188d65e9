// SPDX-License-Identifier: Apache-2.0
// tools/benchmark, without its measuring: from what Google Benchmark tells to the rows.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>

#include "tests/folders.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

using Json = nlohmann::json;
using ::testing::HasSubstr;

const std::string kSource = SourceFolder();

Json Table() { return Json::parse(ContentOf(kSource + "/tests/benchmark/rows.json")); }

TEST(BenchmarkScript, ComparesWhatRanAndLeavesOutWhatDidNot) {
  const Shell shell;
  const std::filesystem::path& folder = shell.folder();
  std::ofstream(folder / "results.json") << R"({
    "context": {"date": "today", "num_cpus": 2, "load_avg": [0.1]},
    "benchmarks": [
      {"name": "streaming_all_masks/person/manual_time", "median_ns": 60e6},
      {"name": "scene_to_map_1m/person/manual_time", "median_ns": 0.5e6, "worst_ns": 1e6},
      {"name": "grpc_batch/tcp/iterations:3/real_time", "per_second": 40e6},
      {"name": "lmdb_get/manual_time", "error_occurred": true, "error_message": "no disk"}]})";
  const Ended ended =
      shell.Run(kSource + "/tools/benchmark --results results.json --out figures 2>&1");
  EXPECT_EQ(ended.exit_code, 1);
  EXPECT_THAT(ended.out, HasSubstr("lmdb_get/manual_time: no disk"));

  std::map<std::string, Json> rows;
  for (const Json& row : Json::parse(ContentOf(folder / "figures/ratios.json"))) {
    for (const char* key : {"name", "value", "unit", "baseline", "ratio"}) {
      EXPECT_TRUE(row.contains(key)) << row;
    }
    rows[row["name"]] = row;
  }
  ASSERT_EQ(rows.size(), 3u);
  EXPECT_EQ(rows["scene_to_map_1m"]["value"], 0.5);
  EXPECT_EQ(rows["scene_to_map_1m"]["unit"], "ms");
  EXPECT_EQ(rows["scene_to_map_1m"]["baseline"], "streaming_all_masks");
  EXPECT_EQ(rows["scene_to_map_1m"]["ratio"], 120);
  EXPECT_EQ(rows["scene_to_map_1m"]["met"], true);
  EXPECT_EQ(rows["grpc_batch"]["value"], 40);
  EXPECT_EQ(rows["grpc_batch"]["met"], false);
  EXPECT_TRUE(rows["streaming_all_masks"]["ratio"].is_null());
  EXPECT_THAT(ContentOf(folder / "figures/table.md"), HasSubstr("120 x `streaming_all_masks`"));
}

TEST(BenchmarkScript, EveryRowHasItsBenchmarkAndItsBaseline) {
  const Ended listed = Shell().Run(ProgramFolder() + "/silhouette-bench --benchmark_list_tests");
  ASSERT_EQ(listed.exit_code, 0);
  std::set<std::string> benchmarks;
  std::istringstream lines(listed.out);
  for (std::string line; std::getline(lines, line);) {
    for (const char* added : {"/manual_time", "/real_time", "/iterations:"}) {
      line = line.substr(0, line.find(added));
    }
    benchmarks.insert(line);
  }
  std::set<std::string> names;
  for (const Json& row : Table()) EXPECT_TRUE(names.insert(row["name"]).second) << row["name"];
  for (const Json& row : Table()) {
    for (const Json& benchmark : row["of"]) EXPECT_EQ(benchmarks.count(benchmark), 1u) << benchmark;
    EXPECT_TRUE(!row.contains("baseline") || names.contains(row["baseline"])) << row["name"];
  }
}

TEST(BenchmarkScript, ItsProgramsHaveHelpWithAnExampleAndAVersion) {
  for (const char* program : {"silhouette-bench", "silhouette-bench-load"}) {
    const std::string path = ProgramFolder() + "/" + program;
    const Ended help = Shell().Run(path + " --help");
    EXPECT_EQ(help.exit_code, 0) << program;
    EXPECT_THAT(help.out, HasSubstr(std::string("Example:\n  ") + program));
    const Ended version = Shell().Run(path + " --version");
    EXPECT_EQ(version.exit_code, 0) << program;
    EXPECT_THAT(version.out, HasSubstr(std::string(program) + " "));
  }
  const Ended mistake =
      Shell().Run(ProgramFolder() + "/silhouette-bench-load unix:nowhere 1 guesses 2>&1");
  EXPECT_EQ(mistake.exit_code, 2);
  EXPECT_THAT(mistake.out, HasSubstr("guesses"));
}

TEST(BenchmarkScript, MistakesAreTheUsersAndHelpIsHelp) {
  const Shell shell;
  const auto expect = [&](const std::string& arguments, int exit_code, const char* said) {
    const Ended ended = shell.Run(kSource + "/tools/benchmark " + arguments + " 2>&1");
    EXPECT_EQ(ended.exit_code, exit_code) << arguments;
    EXPECT_THAT(ended.out, HasSubstr(said));
  };
  expect("--fast", 2, "unknown argument '--fast'");
  expect("--results nowhere", 2,
         ("there is no '" + (shell.folder() / "nowhere").string() + "'").c_str());
  expect("--help", 0, "--quick");
}

}  // namespace
}  // namespace silhouette
