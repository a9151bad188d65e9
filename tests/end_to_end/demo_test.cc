// The main job as the README's first command does it, on a coarse grid: all programs together.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>

namespace {

namespace fs = std::filesystem;

class Demo : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder() = fs::path(testing::TempDir()) / ("demo_" + std::to_string(getpid()));
    const std::string command = std::string(SILHOUETTE_SOURCE_DIR) +
                                "/tools/demo --quick --programs " + SILHOUETTE_BIN_DIR + " --out " +
                                folder().string() + " >" + folder().string() + ".log 2>&1";
    exit_code() = WEXITSTATUS(std::system(command.c_str()));
  }
  static void TearDownTestSuite() { fs::remove_all(folder()); }

  static fs::path& folder() {
    static fs::path path;
    return path;
  }
  static int& exit_code() {
    static int code = -1;
    return code;
  }

  static std::string Log() {
    std::ifstream in(folder().string() + ".log");
    return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  }
  static nlohmann::json Summary() {
    std::ifstream in(folder() / "summary.json");
    return nlohmann::json::parse(in);
  }
};

TEST_F(Demo, PlansAPathThatTouchesNothing) {
  ASSERT_EQ(exit_code(), 0) << Log();
  const nlohmann::json summary = Summary();
  EXPECT_TRUE(summary.at("path_collision_free_in_truth").get<bool>());
  EXPECT_GE(summary.at("path_waypoints").get<int>(), 3) << "the obstacle is in the way";
}

TEST_F(Demo, NoConfigurationInContactIsReportedFree) {
  ASSERT_EQ(exit_code(), 0) << Log();
  const nlohmann::json summary = Summary();
  EXPECT_GT(summary.at("occupied_in_truth").get<int>(), 0);
  EXPECT_EQ(summary.at("missing").get<int>(), 0);
  EXPECT_LT(summary.at("additional").get<int>(),
            summary.at("configurations").get<int>() - summary.at("occupied_in_truth").get<int>())
      << "not everything is blocked";
}

TEST_F(Demo, SummaryHasTheMeasuredTimes) {
  ASSERT_EQ(exit_code(), 0) << Log();
  const nlohmann::json summary = Summary();
  EXPECT_EQ(summary.at("views").get<int>(), 4);
  EXPECT_GT(summary.at("capture_seconds").get<double>(), 0);
  EXPECT_GT(summary.at("check_p50_us").get<double>(), 0);
  EXPECT_GT(summary.at("space_ms").get<double>(), 0);
}

TEST_F(Demo, PicturesAreThere) {
  ASSERT_EQ(exit_code(), 0) << Log();
  for (const char* name : {"configuration-space.png", "views.png"}) {
    const cv::Mat picture = cv::imread((folder() / name).string());
    EXPECT_GT(picture.cols, 300) << name;
    EXPECT_GT(picture.rows, 200) << name;
  }
}

}  // namespace
