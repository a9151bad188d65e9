// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate detect, as its users meet it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "absl/strings/str_replace.h"
#include "calib/boards/board.h"
#include "calib/boards/sighting_file.h"
#include "tests/calib/detection/rendered_board.h"
#include "tests/folders.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

class DetectProgram : public testing::Test {
 protected:
  DetectProgram()
      : board_({.name = "wall", .rows = 1, .columns = 2, .tag_size = 0.05, .gap = 0.05}) {
    for (const char* view : {"left", "right"}) fs::create_directories(folder_ / view);
    WriteFile(folder_ / "boards.yaml", BoardFileText(std::vector{board_}));
  }

  // The board as `seed` has it.
  RenderedBoard Rendered(int seed, const RenderSettings& settings = {}, int width = 240) const {
    std::mt19937_64 random(seed);
    const Eigen::Isometry3d pose = RandomPose(board_, 0.35, 0.3, random);
    return RenderedBoard(board_, Intrinsics(width, 180, 300, -0.2), pose, settings, random);
  }

  void WriteImage(const std::string& name, const cv::Mat& image) const {
    ASSERT_TRUE(cv::imwrite((folder_ / name).string(), image));
  }

  // Of silhouette-calibrate detect in the folder; its output is then in out_ and err_.
  int Run(const std::string& arguments) {
    const Ended ended =
        shell_.Run(ProgramFolder() + "/silhouette-calibrate detect --out corners.csv " + arguments);
    out_ = ended.out;
    err_ = ended.err;
    return ended.exit_code;
  }

  const Board board_;
  const Shell shell_;
  const fs::path folder_ = shell_.folder();
  std::string out_;
  std::string err_;
};

TEST_F(DetectProgram, WritesTheCornersOfAllViewsAndPictures) {
  const RenderedBoard first = Rendered(1);
  const RenderedBoard second = Rendered(2);
  WriteImage("left/a_7.png", first.image());
  WriteImage("right/a_7.png", second.image());
  ASSERT_EQ(Run("--images 'left=left/a_*.png' --images right=right --boards boards.yaml "
                "--draw seen --format json"),
            0)
      << err_;
  const auto sightings = SightingsFromText(ContentOf(folder_ / "corners.csv"), "corners.csv");
  ASSERT_TRUE(sightings.ok()) << sightings.status();
  ASSERT_EQ(sightings->size(), 4u);
  for (const TagSighting& sighting : *sightings) {
    EXPECT_EQ(sighting.frame, sighting.view == "left" ? "7" : "a_7");
    EXPECT_EQ(sighting.image, (PixelSize{240, 180}));
    const RenderedBoard& rendered = sighting.view == "left" ? first : second;
    for (int i = 0; i < 4; ++i) {
      EXPECT_LT((sighting.corners[i] - rendered.Corner(sighting.tag, i)).norm(),
                6 * sighting.sigma);
    }
  }
  const auto json = nlohmann::json::parse(out_);
  EXPECT_EQ(json["sightings"], 4);
  EXPECT_EQ(json["images"][0]["expected"], 2);
  EXPECT_EQ(json["images"][0]["fitted"], 2);
  EXPECT_EQ(json["views"][1]["view"], "right");
  for (const char* picture : {"seen/left/7.png", "seen/right/a_7.png", "seen/coverage-left.png"}) {
    EXPECT_FALSE(cv::imread((folder_ / picture).string()).empty()) << picture;
  }
}

TEST_F(DetectProgram, CopiesAreLeftOutAndWhatDidNotMoveIsTold) {
  WriteImage("left/1.png", Rendered(1).image());
  WriteImage("left/2.png", Rendered(1).image());
  WriteImage("left/3.png", Rendered(1, {.noise = 3}).image());
  WriteImage("left/4.png", Rendered(4, {.blur = 2}).image());
  ASSERT_EQ(Run("--images left=left --boards boards.yaml"), 0) << err_;
  EXPECT_THAT(out_, AllOf(HasSubstr("a copy of another and left out: left/2.png (as frame '1')\n"),
                          HasSubstr("adds no information: left/3.png (as frame '1')\n"),
                          HasSubstr("in 1 of 4 images edges are blurred"),
                          HasSubstr("light): left/4.png (by ")));
  const auto sightings = SightingsFromText(ContentOf(folder_ / "corners.csv"), "corners.csv");
  ASSERT_TRUE(sightings.ok()) << sightings.status();
  EXPECT_EQ(sightings->size(), 6u);
}

TEST_F(DetectProgram, AWarningThatManyImagesShareIsOneLine) {
  WriteImage("left/0.png", Rendered(1).image());
  for (int image = 1; image <= 8; ++image) {
    WriteImage("left/" + std::to_string(image) + ".png", cv::Mat(180, 240, CV_8U, cv::Scalar(90)));
  }
  ASSERT_EQ(Run("--images left=left --boards boards.yaml"), 0) << err_;
  EXPECT_THAT(out_, HasSubstr("warning: in 8 of 9 images none of the boards is seen: left/1.png, "
                              "left/2.png, left/3.png, left/4.png, left/5.png, ...\n"));
}

TEST_F(DetectProgram, LiveSetsAreKeptAndNotOverwritten) {
  const std::string demo = SourceFolder() + "/capture/sim/cells/demo/";
  const std::string live = "--cell " + demo + "cell.yaml --boards " + demo +
                           "boards.yaml --count 2 --interval 0 --save images --format json";
  ASSERT_EQ(Run(live), 0) << err_;
  EXPECT_THAT(err_, HasSubstr("set 2: "));
  const auto json = nlohmann::json::parse(out_);
  EXPECT_EQ(json["images"].size(), 8u);
  EXPECT_GE(json["sightings"], 8);
  const auto sightings = SightingsFromText(ContentOf(folder_ / "corners.csv"), "corners.csv");
  ASSERT_TRUE(sightings.ok()) << sightings.status();
  EXPECT_EQ(sightings->back().frame, "0002");
  EXPECT_FALSE(cv::imread((folder_ / "images/top/0002.png").string()).empty());
  EXPECT_EQ(Run(live), 2);
  EXPECT_THAT(err_, HasSubstr("--overwrite"));
}

TEST_F(DetectProgram, ImagesOfAnotherLiveSessionAreNotReplaced) {
  const std::string demo = SourceFolder() + "/capture/sim/cells/demo/";
  const std::string live = "--cell " + demo + "cell.yaml --boards " + demo +
                           "boards.yaml --count 1 --interval 0 --save images";
  WriteFile(folder_ / "images/top/0001.png", "of another session");
  WriteFile(folder_ / "images/top/0002.png", "of another session");
  EXPECT_EQ(Run(live), 2);
  EXPECT_THAT(err_, HasSubstr("'images/top' has files already; take another --save"));
  EXPECT_EQ(ContentOf(folder_ / "images/top/0001.png"), "of another session");
  EXPECT_EQ(Run(live + " --overwrite"), 0) << err_;
  EXPECT_NE(ContentOf(folder_ / "images/top/0001.png"), "of another session");
  EXPECT_FALSE(fs::exists(folder_ / "images/top/0002.png")) << "the folder is of one session";
}

TEST_F(DetectProgram, LiveImageThatAFrozenCameraRepeatsIsNotKept) {
  const std::string demo = SourceFolder() + "/capture/sim/cells/demo/";
  // Without noise and drift the simulation repeats its images.
  WriteFile(folder_ / "simulation.yaml",
            absl::StrReplaceAll(ContentOf(demo + "simulation.yaml"),
                                {{"noise: 1.5", "noise: 0"},
                                 {"amplitude: 0.02", "amplitude: 0"},
                                 {"file: boards.yaml", "file: " + demo + "boards.yaml"}}));
  WriteFile(folder_ / "cell.yaml",
            absl::StrReplaceAll(ContentOf(demo + "cell.yaml"),
                                {{"../../robots", SourceFolder() + "/capture/sim/robots"}}));
  EXPECT_EQ(Run("--cell cell.yaml --boards " + demo + "boards.yaml --count 2 --interval 0"), 3);
  EXPECT_THAT(err_, HasSubstr("is frozen: it repeats an image byte for byte"));
}

TEST_F(DetectProgram, CtrlCBeforeTheLastLiveSetIsANoWithTheResultOfTheSetsBefore) {
  const std::string demo = SourceFolder() + "/capture/sim/cells/demo/";
  const Ended ended = shell_.Run(
      ProgramFolder() + "/silhouette-calibrate detect --out corners.csv --cell " + demo +
      "cell.yaml --boards " + demo + "boards.yaml --count 100000 --interval 0.1 --format json " +
      "& p=$!; while kill -0 $p && [ ! -e corners.csv ]; do sleep 0.1; done; kill -INT "
      "$p; wait $p");
  EXPECT_EQ(ended.exit_code, 1) << ended.err;
  EXPECT_THAT(ended.err, AllOf(HasSubstr("stopped after "), HasSubstr(" of 100000 sets; what they "
                                                                      "show is in corners.csv")));
  EXPECT_THAT(ContentOf(folder_ / "corners.csv"), HasSubstr("0001"));
  EXPECT_GE(nlohmann::json::parse(ended.out)["sightings"], 1);
}

TEST_F(DetectProgram, CtrlCLeavesAnEarlierCornersFileAsItWas) {
  WriteFile(folder_ / "corners.csv", "complete");
  cv::Mat noise(600, 800, CV_8U);
  cv::randu(noise, 0, 255);
  WriteImage("left/0.png", noise);
  for (int image = 1; image < 1000; ++image) {
    fs::create_hard_link(folder_ / "left/0.png",
                         folder_ / "left" / (std::to_string(image) + ".png"));
  }
  // The first picture is drawn long before the last image is looked at.
  const Ended ended = shell_.Run(
      ProgramFolder() +
      "/silhouette-calibrate detect --out corners.csv --images left=left --boards boards.yaml "
      "--draw seen & p=$!; while kill -0 $p && [ -z \"$(ls seen/left)\" ]; do sleep 0.02; done; "
      "kill -INT $p; wait $p");
  EXPECT_EQ(ended.exit_code, 1) << ended.err;
  EXPECT_THAT(ended.err, HasSubstr(" of 1000 images; corners.csv is left as it was"));
  EXPECT_EQ(ContentOf(folder_ / "corners.csv"), "complete");
}

TEST_F(DetectProgram, AFolderMayHaveTheCharactersOfPatternsInItsName) {
  WriteImage("left/1.png", Rendered(1).image());
  fs::rename(folder_ / "left", folder_ / "s [1]*");
  EXPECT_EQ(Run("--images 'left=s [1]*' --boards boards.yaml"), 0) << err_;
}

TEST_F(DetectProgram, KnownLensesMakeCornersBetter) {
  const RenderedBoard rendered = Rendered(1);
  const CameraIntrinsics& k = rendered.intrinsics();
  std::ostringstream camera;
  camera.precision(17);
  camera << "{ 'lensmodel': 'LENSMODEL_OPENCV4', 'intrinsics': [" << k.fx << ", " << k.fy << ", "
         << k.cx << ", " << k.cy << ", " << k.distortion[0] << ", 0, 0, 0],\n"
         << "'extrinsics': [0, 0, 0, 0, 0, 0], 'imagersize': [" << k.width << ", " << k.height
         << "] }\n";
  WriteFile(folder_ / "left.cameramodel", camera.str());
  WriteImage("left/1.png", rendered.image());
  ASSERT_EQ(Run("--images left=left --boards boards.yaml --cameras . --format json"), 0) << err_;
  const double with = nlohmann::json::parse(out_)["images"][0]["sigma"];
  ASSERT_EQ(Run("--images left=left --boards boards.yaml --format json"), 0) << err_;
  const double without = nlohmann::json::parse(out_)["images"][0]["sigma"];
  EXPECT_LT(with, 0.85 * without);
  WriteImage("left/1.png", Rendered(1, {}, 260).image());
  EXPECT_EQ(Run("--images left=left --boards boards.yaml --cameras ."), 2);
  EXPECT_THAT(err_, HasSubstr("its camera model is for 240x180"));
}

TEST_F(DetectProgram, CornersAreAsOldAsTheOldestImage) {
  WriteImage("left/1.png", Rendered(1).image());
  WriteImage("left/2.png", Rendered(2).image());
  const fs::file_time_type taken =
      fs::last_write_time(folder_ / "left/1.png") - std::chrono::hours(30);
  fs::last_write_time(folder_ / "left/1.png", taken);
  ASSERT_EQ(Run("--images left=left --boards boards.yaml --vnl corners.vnl"), 0) << err_;
  EXPECT_EQ(fs::last_write_time(folder_ / "corners.csv"), taken);
  fs::last_write_time(folder_ / "corners.vnl", taken);
  ASSERT_EQ(Run("--images 'left=left/*.png' --boards boards.yaml --corners corners.vnl"), 0)
      << err_;
  EXPECT_EQ(fs::last_write_time(folder_ / "corners.csv"), taken);
}

TEST_F(DetectProgram, MixedSizesAreRefused) {
  WriteImage("left/1.png", Rendered(1).image());
  WriteImage("left/2.png", Rendered(2, {}, 260).image());
  EXPECT_EQ(Run("--images left=left --boards boards.yaml"), 2);
  EXPECT_THAT(err_, AllOf(HasSubstr("240x180"), HasSubstr("260x180")));
  EXPECT_FALSE(fs::exists(folder_ / "corners.csv"));
}

TEST_F(DetectProgram, OnePictureInTwoViewsIsRefused) {
  WriteImage("left/1.png", Rendered(1).image());
  WriteImage("right/1.png", Rendered(1).image());
  EXPECT_EQ(Run("--images left=left --images right=right --boards boards.yaml"), 2);
  EXPECT_THAT(err_, HasSubstr("are the same picture"));
  EXPECT_EQ(Run("--images left=left --images right=left --boards boards.yaml"), 2);
  EXPECT_THAT(err_, HasSubstr("is an image of view 'left' and of view 'right'"));
}

TEST_F(DetectProgram, MirroredOrForeignBoardsAreRefusedWithTheReason) {
  WriteImage("left/1.png", Rendered(1, {.mirrored = true}).image());
  EXPECT_EQ(Run("--images left=left --boards boards.yaml"), 2);
  EXPECT_THAT(err_, HasSubstr("if they were mirrored"));
  WriteImage("left/1.png", Rendered(1).image());
  WriteFile(folder_ / "boards.yaml", "- {name: other, tag_size: 0.05, first_id: 70}\n");
  EXPECT_EQ(Run("--images left=left --boards boards.yaml"), 2);
  EXPECT_THAT(err_, HasSubstr("they show tagStandard41h12 0, 1; is --boards the right file?"));
  WriteFile(folder_ / "boards.yaml", "- {name: other, family: tag36h11, tag_size: 0.05}\n");
  EXPECT_EQ(Run("--images left=left --boards boards.yaml"), 2);
  EXPECT_THAT(err_, HasSubstr("they show tags of tagStandard41h12"));
}

TEST_F(DetectProgram, AChessboardThatIsStatedTooSmallIsRefusedWithTheSizeThatIsSeen) {
  const Board seen(
      {.name = "hand", .kind = BoardKind::kChessboard, .rows = 6, .columns = 9, .square = 0.02});
  for (int seed = 1; seed <= 6; ++seed) {
    std::mt19937_64 random(seed);
    const Eigen::Isometry3d pose = RandomPose(seen, 0.35, 0.3, random);
    const RenderedBoard rendered(seen, Intrinsics(320, 240, 400, -0.2), pose, {}, random);
    WriteImage("left/" + std::to_string(seed) + ".png", rendered.image());
  }
  for (const std::string size : {"8x5", "7x6"}) {
    WriteFile(folder_ / "boards.yaml", "- {name: hand, chessboard: " + size + ", square: 0.02}\n");
    EXPECT_EQ(Run("--images left=left --boards boards.yaml"), 2) << size;
    EXPECT_THAT(err_, AllOf(HasSubstr("9x6"), HasSubstr("inner corners"), HasSubstr("--boards")));
    EXPECT_FALSE(fs::exists(folder_ / "corners.csv"));
  }
}

TEST_F(DetectProgram, ImagesOfSixteenBitsKeepTheLevelsOfTheBitsThatTheyUse) {
  const cv::Mat eight = Rendered(1).image();
  WriteImage("left/1.png", eight);
  ASSERT_EQ(Run("--images left=left --boards boards.yaml"), 0) << err_;
  const std::string corners = ContentOf(folder_ / "corners.csv");
  for (const int bits : {10, 12, 14, 16}) {
    cv::Mat sixteen;
    eight.convertTo(sixteen, CV_16U, ((1 << bits) - 1) / 255.0);
    WriteImage("left/1.png", sixteen);
    ASSERT_EQ(Run("--images left=left --boards boards.yaml"), 0) << err_;
    EXPECT_EQ(ContentOf(folder_ / "corners.csv"), corners) << bits << " bits";
  }
}

TEST_F(DetectProgram, AJpegThatIsCutOffIsRefusedByItsName) {
  WriteImage("left/1.jpg", Rendered(1).image());
  ASSERT_EQ(Run("--images left=left --boards boards.yaml"), 0) << err_;
  fs::resize_file(folder_ / "left/1.jpg", fs::file_size(folder_ / "left/1.jpg") * 6 / 10);
  EXPECT_EQ(Run("--images left=left --boards boards.yaml"), 2);
  EXPECT_THAT(err_, HasSubstr("1.jpg' cannot be read as an image, or is cut off"));
}

TEST_F(DetectProgram, MistakesAreOneSentence) {
  WriteImage("left/1.png", Rendered(1).image());
  EXPECT_EQ(Run("--boards boards.yaml"), 2);
  EXPECT_EQ(Run("--images left --boards boards.yaml"), 2);
  EXPECT_THAT(err_, HasSubstr("VIEW=PATTERN"));
  EXPECT_EQ(Run("--images 'left=nowhere/*.png' --boards boards.yaml"), 2);
  EXPECT_THAT(err_, HasSubstr("no image of view 'left' matches 'nowhere/*.png'"));
  EXPECT_EQ(Run("--images left=session.bag --boards boards.yaml"), 2);
  EXPECT_THAT(err_, HasSubstr("rosbag play"));
  EXPECT_EQ(Run("--images left=left --boards none.yaml"), 2);
  EXPECT_EQ(Run("--images left=left --boards boards.yaml boards.yaml"), 2);
  EXPECT_THAT(err_, HasSubstr("two boards 'wall'"));
  EXPECT_EQ(Run("--images left=left --boards boards.yaml --cameras ."), 2);
  EXPECT_THAT(err_, HasSubstr("left.cameramodel"));
  WriteFile(folder_ / "left/2.png", "no picture");
  EXPECT_EQ(Run("--images left=left --boards boards.yaml"), 2);
  EXPECT_THAT(err_, HasSubstr("'left/2.png' cannot be read as an image"));
}

}  // namespace
}  // namespace silhouette
