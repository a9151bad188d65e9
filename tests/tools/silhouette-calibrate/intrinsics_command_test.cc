// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate intrinsics, as a user runs it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <random>

#include "calib/boards/board.h"
#include "calib/boards/sighting_file.h"
#include "calib/files/camera_file.h"
#include "tests/calib/intrinsics/synthetic_boards.h"
#include "tests/folders.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class IntrinsicsCommand : public testing::Test {
 protected:
  // Writes corners.csv and boards.yaml of a session of two cameras.
  void Session(const BoardMotion& motion, PixelSize image = {}) {
    std::mt19937 random(41);
    const Board board = LatticeBoard("wall");
    const Board single({.name = "flange", .tag_size = 0.04, .first_id = 100});
    std::vector<TagSighting> sightings = SightingsOf(CamerasOnAnArc(2), board, motion, random);
    for (TagSighting& sighting : sightings) sighting.image = image;
    WriteFile(folder_ / "corners.csv", SightingFileText(sightings));
    WriteFile(folder_ / "boards.yaml", BoardFileText(std::vector<Board>{board, single}));
  }
  // Both outputs are in `out`.
  Ended Calibrate(const std::string& arguments) const {
    return shell_.Run(ProgramFolder() + "/silhouette-calibrate intrinsics " + arguments + " 2>&1");
  }
  Ended Run(const std::string& more) const {
    const std::string in = folder_.string();
    return Calibrate("--corners " + in + "/corners.csv --boards " + in + "/boards.yaml --out " +
                     in + "/cameras " + more);
  }

  const Shell shell_;
  const fs::path folder_ = shell_.folder();
};

TEST_F(IntrinsicsCommand, WritesCamerasAndPicturesAndSaysHowWellTheyAreKnown) {
  Session({.frames = 30});
  const std::string draw = " --draw " + (folder_ / "pictures").string();
  const Ended outcome =
      Run("--image-size cam0=1280x960 --image-size 1280x960 --format json" + draw);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  const auto json = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(json["cameras"].size(), 2u);
  EXPECT_EQ(json["cameras"][1]["view"], "cam1");
  EXPECT_NEAR(json["cameras"][1]["rms_px"].get<double>(), 0.1, 0.01);
  EXPECT_LT(json["cameras"][1]["edge_sigma_px"].get<double>(), 1);
  EXPECT_EQ(json["groups"].size(), 1u);
  const auto camera = CameraFromText(ContentOf(folder_ / "cameras" / "cam1.cameramodel"), "cam1");
  ASSERT_TRUE(camera.ok()) << camera.status();
  EXPECT_NEAR(camera->intrinsics().fx, 917, 2);
  EXPECT_TRUE(fs::exists(folder_ / "pictures" / "cam1-residuals.png"));
  const auto known = LensRegionFromText(ContentOf(folder_ / "cameras" / "cam1.cameramodel"), "");
  ASSERT_TRUE(known.ok() && known->has_value()) << known.status();
  EXPECT_TRUE((*known)->Contains({640, 480}));

  // Given lenses stay as they are.
  const Ended fixed = Run("--fix-intrinsics " + (folder_ / "cameras").string());
  ASSERT_EQ(fixed.exit_code, 0) << fixed.out;
  EXPECT_THAT(fixed.out, HasSubstr("given"));
  const auto kept = CameraFromText(ContentOf(folder_ / "cameras" / "cam1.cameramodel"), "cam1");
  EXPECT_EQ(kept->intrinsics().fx, camera->intrinsics().fx);
  const std::string from = "--from " + (folder_ / "cameras" / "cam1.cameramodel").string();
  ASSERT_EQ(Calibrate(from + " --view left --out " + folder_.string()).exit_code, 0);
  for (const fs::path& file :
       {folder_ / "cameras/cam1.cameramodel", folder_ / "left.cameramodel"}) {
    const auto of_copy = LensRegionFromText(ContentOf(file), file.string());
    ASSERT_TRUE(of_copy.ok() && of_copy->has_value()) << file;
    EXPECT_EQ((*of_copy)->contour, (*known)->contour) << file;
  }
}

TEST_F(IntrinsicsCommand, RefusesWeakDataWithOneAndMistakesWithTwo) {
  Session({.frames = 5});
  const Ended weak = Run("--image-size 1280x960");
  EXPECT_EQ(weak.exit_code, 1);
  EXPECT_THAT(weak.out, HasSubstr("only 5 images"));
  EXPECT_FALSE(fs::exists(folder_ / "cameras"));
  const Ended without = Run("--image-size cam0=1280x960");
  EXPECT_EQ(without.exit_code, 2);
  EXPECT_THAT(without.out, HasSubstr("--image-size cam1=1280x960"));
  const Ended small = Run("--image-size 640x480");
  EXPECT_EQ(small.exit_code, 2);
  EXPECT_THAT(small.out, HasSubstr("outside the image of 640 x 480"));
  EXPECT_THAT(Run("--image-size 1280x960 --view top").out,
              HasSubstr("no corner of the view 'top'"));
  EXPECT_THAT(Run("--image-size 1280x960 --board door").out, HasSubstr("no board 'door'"));
}

TEST_F(IntrinsicsCommand, SizesThatDetectWroteNeedNotBeStatedAndAreNotContradicted) {
  Session({.frames = 30}, {1280, 960});
  const Ended outcome = Run("");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  const auto camera = CameraFromText(ContentOf(folder_ / "cameras" / "cam0.cameramodel"), "cam0");
  ASSERT_TRUE(camera.ok()) << camera.status();
  EXPECT_EQ(camera->intrinsics().width, 1280);
  EXPECT_EQ(camera->intrinsics().height, 960);
  const Ended other = Run("--image-size cam0=1280x960 --image-size cam1=1920x1080");
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.out, HasSubstr("view 'cam1': the stated image size is 1920x1080, but its "
                                   "corners were found in images of 1280x960"));
}

TEST_F(IntrinsicsCommand, ImagesOfABoardHeldByHandGiveLensesOnRequestOnly) {
  // The second camera's images are of another moment.
  std::mt19937 random(42);
  std::normal_distribution<double> shake(0, 0.001);
  const auto cameras = CamerasOnAnArc(2);
  std::vector<TagSighting> sightings;
  for (int frame = 0; frame < 30; ++frame) {
    Eigen::Isometry3d pose = RandomBoardPose(random, LatticeBoard("wall"), {});
    for (const char* view : {"cam0", "cam1"}) {
      std::vector<TagSighting> seen;
      AddSightings(cameras, LatticeBoard("wall"), pose, FrameName(frame), 0.1, random, seen);
      std::erase_if(seen, [&](const TagSighting& sighting) { return sighting.view != view; });
      sightings.insert(sightings.end(), seen.begin(), seen.end());
      pose.pretranslate(Eigen::Vector3d(shake(random), shake(random), shake(random)));
    }
  }
  Session({.frames = 1});
  WriteFile(folder_ / "corners.csv", SightingFileText(sightings));
  const Ended together = Run("--image-size 1280x960");
  EXPECT_EQ(together.exit_code, 1);
  EXPECT_THAT(together.out, HasSubstr("--not-simultaneous"));
  EXPECT_FALSE(fs::exists(folder_ / "cameras"));
  const Ended apart = Run("--image-size 1280x960 --not-simultaneous");
  EXPECT_EQ(apart.exit_code, 0) << apart.out;
  EXPECT_THAT(apart.out, HasSubstr("how the cameras stand to each other is not known"));
}

TEST_F(IntrinsicsCommand, ReadsCamerasOfOtherPrograms) {
  WriteFile(folder_ / "info.yaml",
            "image_width: 640\nimage_height: 480\ndistortion_model: plumb_bob\n"
            "camera_matrix: {rows: 3, cols: 3, data: [500, 0, 320, 0, 501, 240, 0, 0, 1]}\n"
            "distortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0, 0, 0, 0]}\n");
  const std::string in = folder_.string();
  const Ended outcome = Calibrate("--from " + in + "/info.yaml --view left --out " + in);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  EXPECT_THAT(outcome.out, HasSubstr("ROS's camera of 640x480 pixels"));
  const auto camera = CameraFromText(ContentOf(folder_ / "left.cameramodel"), "left");
  ASSERT_TRUE(camera.ok()) << camera.status();
  EXPECT_EQ(camera->intrinsics().fy, 501);
  EXPECT_EQ(Calibrate("--from " + in + "/info.yaml --out " + in).exit_code, 2);

  WriteFile(folder_ / "camera.xml", R"(<?xml version="1.0"?>
<opencv_storage>
<calibration_time>"today"</calibration_time>
<image_width>640</image_width> <image_height>480</image_height>
<camera_matrix type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt>
  <data>500. 0. 320. 0. 502.25 240. 0. 0. 1.</data></camera_matrix>
<distortion_coefficients type_id="opencv-matrix"><rows>5</rows><cols>1</cols><dt>d</dt>
  <data>-0.25 0.1 0. 0. 0.0625</data></distortion_coefficients>
</opencv_storage>
)");
  ASSERT_EQ(Calibrate("--from " + in + "/camera.xml --view front --out " + in).exit_code, 0);
  const auto xml = CameraFromText(ContentOf(folder_ / "front.cameramodel"), "front");
  ASSERT_TRUE(xml.ok()) << xml.status();
  EXPECT_EQ(xml->intrinsics().fy, 502.25);
  EXPECT_EQ(xml->intrinsics().distortion[4], 0.0625);
  WriteFile(folder_ / "broken.xml", "<?xml version=\"1.0\"?>\n<opencv_storage><a>");
  EXPECT_EQ(Calibrate("--from " + in + "/broken.xml --view front --out " + in).exit_code, 2);

  WriteFile(folder_ / "chain.yaml",
            "cam0:\n  camera_model: pinhole\n  distortion_model: equidistant\n"
            "  distortion_coeffs: [-0.0033, 0.0007, -0.0021, 0.0002]\n"
            "  intrinsics: [461.6, 460.2, 362.7, 248.1]\n  resolution: [752, 480]\n");
  const Ended fisheye = Calibrate("--from " + in + "/chain.yaml --view wide --out " + in);
  ASSERT_EQ(fisheye.exit_code, 0) << fisheye.out;
  EXPECT_THAT(fisheye.out, HasSubstr("Converted from an equidistant lens: off by at most"));

  const std::string four =
      "--from 461.6,460.2,362.7,248.1,-0.0033,0.0007,-0.0021,0.0002 --image-size 752x480 --view "
      "four --out " +
      in;
  EXPECT_THAT(Calibrate(four).out, HasSubstr("read as k1, k2, p1, p2; if they are of cv2.fisheye"));
  EXPECT_THAT(Calibrate(four + " --fisheye").out, HasSubstr("Converted from an equidistant lens"));
  EXPECT_EQ(ContentOf(folder_ / "four.cameramodel").substr(31),
            ContentOf(folder_ / "wide.cameramodel").substr(31));

  const std::string numbers = "--from 615.5,615.25,319.5,239.5 --view top --out " + in;
  EXPECT_THAT(Calibrate(numbers).out, HasSubstr("does not say the images' size"));
  const Ended undistorted = Calibrate(numbers + " --image-size 640x480");
  ASSERT_EQ(undistorted.exit_code, 0) << undistorted.out;
  EXPECT_THAT(undistorted.out, HasSubstr("has no distortion; if the lens has some"));
  const auto bare = CameraFromText(ContentOf(folder_ / "top.cameramodel"), "top");
  ASSERT_TRUE(bare.ok()) << bare.status();
  EXPECT_EQ(bare->intrinsics().fy, 615.25);
  EXPECT_EQ(bare->intrinsics().cx, 319.5);
  const Ended spaced = Calibrate("--from '615.5, 615.25, 319.5,  239.5' --image-size 640x480 " +
                                 ("--view spaced --out " + in));
  EXPECT_EQ(spaced.exit_code, 0) << spaced.out;
}

}  // namespace
}  // namespace silhouette
