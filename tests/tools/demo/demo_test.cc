// SPDX-License-Identifier: Apache-2.0
// The main job as the README's first command does it, on a coarse grid: all programs together.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "tests/folders.h"
#include "tests/test_folder.h"

namespace {

namespace fs = std::filesystem;

std::string Read(const fs::path& path) {
  std::ifstream in(path);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

TEST(Demo, PlansAroundTheObstaclesAndReportsNoContactFree) {
  const fs::path folder = silhouette::TestFolder() / "demo";
  const std::string log = folder.string() + ".log";
  const std::string command = silhouette::SourceFolder() + "/tools/demo --quick" + " --programs " +
                              silhouette::ProgramFolder() + " --out " + folder.string() + " >" +
                              log + " 2>&1";
  ASSERT_EQ(std::system(command.c_str()), 0) << Read(log);

  const nlohmann::json summary = nlohmann::json::parse(Read(folder / "summary.json"));
  EXPECT_TRUE(summary.at("path_collision_free_in_truth").get<bool>());
  EXPECT_GE(summary.at("path_waypoints").get<int>(), 3) << "the obstacle is in the way";
  const int configurations = summary.at("configurations").get<int>();
  const int occupied = summary.at("occupied_in_truth").get<int>();
  EXPECT_GT(occupied, 0);
  EXPECT_EQ(summary.at("missing").get<int>(), 0);
  EXPECT_LT(summary.at("additional").get<int>(), configurations - occupied);
  EXPECT_EQ(summary.at("views").get<int>(), 4);
  EXPECT_GT(summary.at("capture_seconds").get<double>(), 0);
  EXPECT_GT(summary.at("check_p50_us").get<double>(), 0);
  EXPECT_GT(summary.at("space_ms").get<double>(), 0);

  const nlohmann::json capture = nlohmann::json::parse(Read(folder / "capture.json"));
  for (const nlohmann::json& view : capture.at("view_quality")) {
    EXPECT_EQ(view.at("touching_border").get<int>(), 0) << view.at("name");
  }
  for (const char* name : {"configuration-space.png", "views.png"}) {
    const cv::Mat picture = cv::imread((folder / name).string());
    EXPECT_GT(picture.cols, 300) << name;
    EXPECT_GT(picture.rows, 200) << name;
  }
}

TEST(Demo, DeletesNothingInAFolderThatIsNotEmpty) {
  const fs::path folder = silhouette::TestFolder() / "mine";
  fs::create_directories(folder);
  std::ofstream(folder / "thesis.txt") << "mine";
  const std::string log = (silhouette::TestFolder() / "refused.log").string();
  const std::string command = "cd " + silhouette::TestFolder().string() + " && " +
                              silhouette::SourceFolder() + "/tools/demo --out mine --programs " +
                              silhouette::ProgramFolder() + " >" + log + " 2>&1";
  const int status = std::system(command.c_str());
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 2) << status;
  EXPECT_EQ(Read(log), "tools/demo: '" + fs::canonical(folder).string() +
                           "' is not empty: name a new folder\n");
  EXPECT_EQ(Read(folder / "thesis.txt"), "mine");
}

TEST(Demo, PlansForSixAxesWithoutContactByAModelThatCapturedImagesVerified) {
  const fs::path folder = silhouette::TestFolder() / "six-axes";
  const std::string log = folder.string() + ".log";
  const std::string command = silhouette::SourceFolder() + "/tools/demo --six-axes" +
                              " --programs " + silhouette::ProgramFolder() + " --out " +
                              folder.string() + " >" + log + " 2>&1";
  ASSERT_EQ(std::system(command.c_str()), 0) << Read(log);
  const nlohmann::json summary = nlohmann::json::parse(Read(folder / "summary.json"));
  EXPECT_TRUE(summary.at("path_collision_free_in_truth").get<bool>());
  EXPECT_GE(summary.at("path_waypoints").get<int>(), 3) << "the obstacles are in the way";
  EXPECT_FALSE(summary.at("unverified_model").get<bool>());
  EXPECT_EQ(summary.at("verified_configurations").get<int>(), 300);
  EXPECT_GT(summary.at("link_growth").at("forearm").get<double>(), 0.03) << "its cable";
  EXPECT_LT(summary.at("link_growth").at("base").get<double>(), 0.02);
  for (const char* name : {"motion.png", "verification.png"}) {
    EXPECT_GT(cv::imread((folder / name).string()).cols, 300) << name;
  }
}

}  // namespace
