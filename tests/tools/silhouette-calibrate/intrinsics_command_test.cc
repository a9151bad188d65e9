// silhouette-calibrate intrinsics, as a user runs it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

#include "calib/boards/board_file.h"
#include "calib/boards/sighting_file.h"
#include "calib/files/calibration_camera_file.h"
#include "tests/calib/intrinsics/synthetic_boards.h"
#include "tests/test_folder.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

struct Outcome {
  int code = -1;
  std::string text;  // stdout and stderr
};

Outcome Calibrate(const std::string& arguments) {
  const std::string command =
      std::string(SILHOUETTE_BIN_DIR) + "/silhouette-calibrate intrinsics " + arguments + " 2>&1";
  Outcome outcome;
  FILE* pipe = popen(command.c_str(), "r");
  char buffer[4096];
  for (size_t n; (n = fread(buffer, 1, sizeof buffer, pipe)) > 0;) outcome.text.append(buffer, n);
  outcome.code = WEXITSTATUS(pclose(pipe));
  return outcome;
}

std::string IntrinsicsCommandTextOf(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

class IntrinsicsCommand : public testing::Test {
 protected:
  // Writes corners.csv and boards.yaml of a session of two cameras.
  void Session(const BoardMotion& motion) {
    std::mt19937 random(41);
    const Board board = LatticeBoard("wall");
    const Board single({.name = "flange", .tag_size = 0.04, .first_id = 100});
    std::vector<TagSighting> sightings = SightingsOf(CamerasOnAnArc(2), board, motion, random);
    std::ofstream(folder_ / "corners.csv") << SightingFileText(sightings);
    std::ofstream(folder_ / "boards.yaml") << BoardFileText(std::vector<Board>{board, single});
  }
  Outcome Run(const std::string& more) {
    const std::string in = folder_.string();
    return Calibrate("--corners " + in + "/corners.csv --boards " + in + "/boards.yaml --out " +
                     in + "/cameras " + more);
  }

  fs::path folder_ = FreshFolder();
};

TEST_F(IntrinsicsCommand, WritesCamerasAndPicturesAndSaysHowWellTheyAreKnown) {
  Session({.frames = 30});
  const std::string draw = " --draw " + (folder_ / "pictures").string();
  const Outcome outcome =
      Run("--image-size cam0=1280x960 --image-size 1280x960 --format json" + draw);
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  const auto json = nlohmann::json::parse(outcome.text);
  EXPECT_EQ(json["cameras"].size(), 2u);
  EXPECT_EQ(json["cameras"][1]["view"], "cam1");
  EXPECT_NEAR(json["cameras"][1]["rms_px"].get<double>(), 0.1, 0.01);
  EXPECT_LT(json["cameras"][1]["edge_sigma_px"].get<double>(), 1);
  EXPECT_EQ(json["groups"].size(), 1u);
  const auto camera =
      CameraFromText(IntrinsicsCommandTextOf(folder_ / "cameras" / "cam1.cameramodel"), "cam1");
  ASSERT_TRUE(camera.ok()) << camera.status();
  EXPECT_NEAR(camera->fx(), 917, 2);
  EXPECT_TRUE(fs::exists(folder_ / "pictures" / "cam1-residuals.png"));

  // Given lenses stay as they are.
  const Outcome fixed = Run("--fix-intrinsics " + (folder_ / "cameras").string());
  ASSERT_EQ(fixed.code, 0) << fixed.text;
  EXPECT_THAT(fixed.text, HasSubstr("given"));
  const auto kept =
      CameraFromText(IntrinsicsCommandTextOf(folder_ / "cameras" / "cam1.cameramodel"), "cam1");
  EXPECT_EQ(kept->fx(), camera->fx());
}

TEST_F(IntrinsicsCommand, RefusesWeakDataWithOneAndMistakesWithTwo) {
  Session({.frames = 5});
  const Outcome weak = Run("--image-size 1280x960");
  EXPECT_EQ(weak.code, 1);
  EXPECT_THAT(weak.text, HasSubstr("only 5 images"));
  EXPECT_FALSE(fs::exists(folder_ / "cameras"));
  const Outcome without = Run("--image-size cam0=1280x960");
  EXPECT_EQ(without.code, 2);
  EXPECT_THAT(without.text, HasSubstr("--image-size cam1=1280x960"));
  const Outcome small = Run("--image-size 640x480");
  EXPECT_EQ(small.code, 2);
  EXPECT_THAT(small.text, HasSubstr("outside the image of 640 x 480"));
  EXPECT_THAT(Run("--image-size 1280x960 --view top").text,
              HasSubstr("no corner of the view 'top'"));
  EXPECT_THAT(Run("--image-size 1280x960 --board door").text, HasSubstr("no board 'door'"));
}

TEST_F(IntrinsicsCommand, ReadsCamerasOfOtherPrograms) {
  std::ofstream(folder_ / "info.yaml")
      << "image_width: 640\nimage_height: 480\ndistortion_model: plumb_bob\n"
         "camera_matrix: {rows: 3, cols: 3, data: [500, 0, 320, 0, 501, 240, 0, 0, 1]}\n"
         "distortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0, 0, 0, 0]}\n";
  const std::string in = folder_.string();
  const Outcome outcome = Calibrate("--from " + in + "/info.yaml --view left --out " + in);
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_THAT(outcome.text, HasSubstr("ROS's camera of 640x480 pixels"));
  const auto camera = CameraFromText(IntrinsicsCommandTextOf(folder_ / "left.cameramodel"), "left");
  ASSERT_TRUE(camera.ok()) << camera.status();
  EXPECT_EQ(camera->fy(), 501);
  EXPECT_EQ(Calibrate("--from " + in + "/info.yaml --out " + in).code, 2);
}

}  // namespace
}  // namespace silhouette
