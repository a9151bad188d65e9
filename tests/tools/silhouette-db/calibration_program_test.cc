// SPDX-License-Identifier: Apache-2.0
// silhouette-db calibration as a user runs it, on a cell whose cameras are known: a ball that two
// cameras see.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "absl/strings/str_cat.h"
#include "calib/camera/camera_model.h"
#include "calib/files/calibration_message.h"
#include "calib/files/camera_file.h"
#include "common/picture/files.h"
#include "tests/db/store/test_cell.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

using Json = nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;

CameraModel LookingAt(const CameraIntrinsics& intrinsics, const Eigen::Vector3d& from,
                      const Eigen::Vector3d& at, const Eigen::Vector3d& up) {
  Eigen::Isometry3d camera_from_world = Eigen::Isometry3d::Identity();
  const Eigen::Vector3d ahead = (at - from).normalized();
  const Eigen::Vector3d right = ahead.cross(up).normalized();
  camera_from_world.linear().row(0) = right;
  camera_from_world.linear().row(1) = ahead.cross(right);
  camera_from_world.linear().row(2) = ahead;
  camera_from_world.translation() = -camera_from_world.linear() * from;
  return CameraModel(intrinsics, camera_from_world);
}

// The cameras of TestCell's views "left", whose images it knows, and "top", whose it does not.
std::vector<CameraModel> TrueCameras() {
  const CameraIntrinsics left{
      .width = 640, .height = 480, .fx = 600, .fy = 600, .cx = 315, .cy = 244};
  const CameraIntrinsics top{
      .width = 330, .height = 200, .fx = 280, .fy = 280, .cx = 164.5, .cy = 99.5};
  const Eigen::Vector3d middle(0, 0, 0.5);
  return {LookingAt(left, {0.3, -3, 0.8}, middle, {0, 0, 1}),
          LookingAt(top, {0, 0.2, 4}, middle, {0, 1, 0})};
}

// A ball at `centre`, any-touch but for gaps between its points that are far below a pixel.
Mask BallMask(const CameraModel& camera, MaskSize size, const Eigen::Vector3d& centre) {
  constexpr double kRadius = 0.2;
  constexpr int kSteps = 16;
  const CameraModel scaled = camera.ScaledTo(size.width, size.height);
  std::vector<bool> set(size.pixels());
  for (int i = 0; i <= kSteps * kSteps * kSteps; ++i) {
    const Eigen::Vector3d share =
        Eigen::Vector3d(i % kSteps, i / kSteps % kSteps, i / kSteps / kSteps) * 2.0 / (kSteps - 1) -
        Eigen::Vector3d::Ones();
    if (share.norm() > 1) continue;
    const auto pixel = scaled.Project(centre + kRadius * share);
    if (!pixel) continue;
    const int x = static_cast<int>(std::lround(pixel->x()));
    const int y = static_cast<int>(std::lround(pixel->y()));
    if (x < 0 || x >= size.width || y < 0 || y >= size.height) continue;
    set[static_cast<size_t>(y * size.width + x)] = true;
  }
  return Mask::FromPredicate(
      size, [&](int x, int y) { return set[static_cast<size_t>(y * size.width + x)]; });
}

class CalibrationProgram : public ProgramTest {
 protected:
  CalibrationProgram() : ProgramTest("silhouette-db calibration") {}

  void SetUp() override {
    const auto database = Database::Create(folder_ / "db", TestCell(6, 5));
    ASSERT_TRUE(database.ok()) << database.status();
    PutBalls(**database, AllNumbers((*database)->grid()));
    WriteCameras("cameras", TrueCameras());
    std::vector<CameraModel> moved = TrueCameras();
    Eigen::Isometry3d pose = moved[0].camera_from_world();
    pose.translation().x() += 0.5;
    moved[0] = CameraModel(moved[0].intrinsics(), pose);
    WriteCameras("moved", moved);
  }

  // Stores what the cameras see of the ball.
  static void PutBalls(Database& database, const std::vector<ConfigurationNumber>& numbers) {
    auto writer = database.Write("test");
    const std::vector<CameraModel> cameras = TrueCameras();
    for (const ConfigurationNumber number : numbers) {
      const Configuration q = database.grid().At(number);
      RobotImage image;
      image.number = number;
      for (size_t i = 0; i < cameras.size(); ++i) {
        image.masks.push_back(BallMask(cameras[i], database.mask_sizes()[i],
                                       {0.3 * q[0], 0.1 * (q[1] - q[0]), 0.4 + 0.3 * q[1]}));
      }
      ASSERT_TRUE(writer->Put(image).ok());
    }
    ASSERT_TRUE(writer->Commit().ok());
  }

  void WriteCameras(const std::string& name, const std::vector<CameraModel>& cameras) const {
    std::filesystem::create_directories(folder_ / name);
    const storage::v1::CellDescription cell = TestCell(6, 5);
    for (int i = 0; i < cell.views_size(); ++i) {
      Write(name + "/" + CameraFileName(cell.views(i).name()),
            CameraFileText(MessageOf(cameras[static_cast<size_t>(i)]), cell.views(i).name()));
    }
  }

  uint64_t Generation() const {
    return (*Database::Open(folder_ / "db", Database::Access::kRead))->Read()->generation();
  }

  Json Shown() const { return Json::parse(Run("show db --format json").out); }

  // The matrix that `show` tells, as a file of matrices from view_b to view_a: the transpose.
  std::string MatrixFile(const Json& pair) const {
    const Json& f = pair["F"];
    Json turned = Json::array();
    for (size_t row = 0; row < 3; ++row) turned.push_back({f[0][row], f[1][row], f[2][row]});
    return Json{{{"view_a", pair["view_b"]}, {"view_b", pair["view_a"]}, {"F", turned}}}.dump();
  }
};

TEST_F(CalibrationProgram, ImportMakesTheDatabaseOfACellWhoseImagesAreDrawn) {
  Write("robot.urdf",
        "<robot name='r'><link name='a'/><link name='b'><visual><geometry><sphere radius='0.2'/>"
        "</geometry></visual></link><joint name='axis_1' type='revolute'><parent link='a'/>"
        "<child link='b'/><limit lower='-1' upper='1'/></joint></robot>");
  const auto cell = [&](const std::string& images) {
    Write("cell.yaml", "name: drawn\nrobot: {urdf: robot.urdf, images: " + images +
                           ", joints: [{name: axis_1}]}\ngrid: {steps: {axis_1: 3}}\nviews:\n"
                           "  - {name: left, image_size: [640, 480], mask_size: [64, 64]}\n"
                           "  - {name: top, image_size: [330, 200], mask_size: [33, 20]}\n");
  };
  const auto refused = [&](const std::string& cameras) {
    const Ended ended = Run("import new " + cameras + " --cell cell.yaml");
    EXPECT_EQ(ended.exit_code, 2) << ended.out;
    EXPECT_FALSE(std::filesystem::exists(folder_ / "new"));
    return ended.err;
  };
  cell("captured");
  EXPECT_THAT(refused("cameras"), HasSubstr("are captured: make it with"));
  cell("drawn");
  EXPECT_THAT(refused("nowhere"), HasSubstr("nowhere"));
  WriteCameras("twice", {TrueCameras()[0], TrueCameras()[0]});
  EXPECT_THAT(refused("twice"), HasSubstr("top"));

  const Ended ended = Run("import new cameras --cell cell.yaml");
  ASSERT_EQ(ended.exit_code, 0) << ended.err;
  EXPECT_THAT(ended.out, AllOf(HasSubstr("2 camera models imported"),
                               HasSubstr("there are no captured robot images to test")));
  EXPECT_EQ(ended.err, "") << "of no robot images there is no progress";
  const auto database = Database::Open(folder_ / "new", Database::Access::kRead);
  ASSERT_TRUE(database.ok()) << database.status();
  EXPECT_EQ((*database)->cell().name(), "drawn");
  EXPECT_EQ((*database)->Read()->Calibration()->value().cameras_size(), 2);
  // A database of another cell is refused, with or without this option's own.
  const Ended other = Run("import db cameras --cell cell.yaml");
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, HasSubstr("is not that of cell file"));
}

TEST_F(CalibrationProgram, CamerasGoInAndComeOutAsTheyWere) {
  const uint64_t before = Generation();
  Ended outcome = Run("import db cameras");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("2 camera models imported"), HasSubstr("SIGHUP")));
  EXPECT_EQ(Generation(), before + 1);
  ASSERT_EQ(Run("export db out").exit_code, 0);
  for (const char* file : {"left.cameramodel", "top.cameramodel"}) {
    EXPECT_EQ(Read(absl::StrCat("out/", file)), Read(absl::StrCat("cameras/", file)));
  }
  // The same again, said in other ways, is no change.
  std::filesystem::rename(folder_ / "out/top.cameramodel", folder_ / "a file");
  for (const char* same :
       {"out/left.cameramodel 'top=a file'", "cameras/top.cameramodel left=out/left.cameramodel"}) {
    outcome = Run(absl::StrCat("import db ", same));
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_THAT(outcome.out, HasSubstr("already"));
    EXPECT_EQ(Generation(), before + 1);
  }
  outcome = Run("export db out");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("'out/left.cameramodel' is there already"));
}

TEST_F(CalibrationProgram, ScriptsReadWhatImportStoredAndCheckedAndWhatExportWrote) {
  const uint64_t before = Generation();
  const Json imported = Json::parse(Run("import db cameras --format json").out);
  EXPECT_EQ(imported["generation"], before + 1);
  EXPECT_EQ(imported["kind"], "cameras");
  EXPECT_EQ(imported["cameras"], 2);
  EXPECT_EQ(imported["changed"], true);
  EXPECT_EQ(imported["configurations"], 30);
  EXPECT_EQ(imported["worst_contradicting_share"], 0);
  EXPECT_EQ(Json::parse(Run("import db cameras --format json").out)["changed"], false);
  const Json exported = Json::parse(Run("export db out --format json").out);
  EXPECT_EQ(exported["files"], Json({"out/left.cameramodel", "out/top.cameramodel"}));
}

TEST_F(CalibrationProgram, ImportRepeatsTheWarningsOfTheCalibration) {
  Write("cameras/calibration.yaml",
        "calibration: 1\nviews:\n  - {name: left, camera: left.cameramodel}\n"
        "  - {name: top, camera: top.cameramodel}\nwarnings: [view left is not stable]\n");
  for (const char* outcome : {"imported", "already"}) {
    EXPECT_THAT(Run("import db cameras").out,
                AllOf(HasSubstr(outcome), HasSubstr("warning: view left is not stable\n")));
  }
  EXPECT_EQ(Json::parse(Run("import db cameras --format json").out)["warnings"],
            Json({"view left is not stable"}));
}

TEST_F(CalibrationProgram, TheMatricesThatItShowsServeAsWellAsTheCameras) {
  ASSERT_EQ(Run("import db cameras").exit_code, 0);
  const Json cameras = Shown();
  ASSERT_EQ(cameras["pairs"].size(), 1);
  EXPECT_EQ(cameras["pairs"][0]["F_without_distortion"], false);
  Write("matrices.yaml", MatrixFile(cameras["pairs"][0]));
  const Ended outcome = Run("import db matrices.yaml");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("1 fundamental matrices imported"));
  const Json matrices = Shown();
  EXPECT_EQ(matrices["kind"], "fundamental matrices");
  EXPECT_EQ(matrices["pairs"][0]["F"], cameras["pairs"][0]["F"]);
  EXPECT_EQ(matrices["worst_contradicting_share"], 0);
  // Out and in again.
  ASSERT_EQ(Run("export db again.yaml").exit_code, 0);
  EXPECT_THAT(Run("import db again.yaml").out, HasSubstr("already"));
}

TEST_F(CalibrationProgram, ACalibrationThatTheRobotImagesContradictIsTakenOnlyByForce) {
  const uint64_t before = Generation();
  const Ended refused = Run("import db moved");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("contradicts the robot images: "), HasSubstr(" % of "),
                                 HasSubstr("robot pixels of '"), HasSubstr("--force")));
  EXPECT_EQ(Generation(), before);
  EXPECT_EQ(Run("show db").exit_code, 1);

  EXPECT_EQ(Run("import db moved --force").exit_code, 0);
  const Json shown = Shown();
  EXPECT_GT(shown["worst_contradicting_share"], 0.05);
  EXPECT_GT(shown["pairs"][0]["a_in_b"]["worst"]["contradicting"], 0);
  // The true one is let in again.
  EXPECT_EQ(Run("import db cameras").exit_code, 0);
  EXPECT_EQ(Shown()["worst_contradicting_share"], 0);
}

TEST_F(CalibrationProgram, DrawnRobotImagesDoNotTestTheCalibrationAndMustBeDrawnAgain) {
  {
    const auto database = Database::Create(folder_ / "drawn cell", TestCell(6, 5)).value();
    storage::v1::DrawnImages drawn;
    drawn.set_digest("00ff");
    drawn.set_shards(1);
    ASSERT_TRUE(database->SetDrawnImages(drawn, "test").ok());
    PutBalls(*database, AllNumbers(database->grid()));
  }
  ASSERT_EQ(Run("import 'drawn cell' cameras").exit_code, 0);
  const Ended again = Run("import 'drawn cell' moved");
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_THAT(again.out,
              AllOf(HasSubstr("there are no captured robot images to test the calibration with"),
                    HasSubstr("the server uses only robot images that were drawn from this "
                              "calibration; verify the model again, then draw them: "
                              "silhouette-capture draw --cell CELL --database NEW --from 'drawn "
                              "cell'\n")));
  EXPECT_EQ(Json::parse(Run("show 'drawn cell' --format json").out)["configurations"], 0);
  EXPECT_EQ(Run("show 'drawn cell' --picture bands.png").exit_code, 0);
  EXPECT_EQ(Json::parse(Run("import 'drawn cell' cameras --format json").out)["next"],
            "silhouette-capture draw --cell CELL --database NEW --from 'drawn cell'");
  EXPECT_EQ(Json::parse(Run("import db cameras --format json").out)["next"], "");
}

TEST_F(CalibrationProgram, FewRobotImagesInALargeGridAreFoundAtOnce) {
  const auto number = [&](int place) {
    return GridOf(TestCell(1 << 20, 1 << 20))->NumberOf({place * 100'000, 500'000});
  };
  ASSERT_TRUE(Database::Create(folder_ / "large", TestCell(1 << 20, 1 << 20)).ok());
  ASSERT_EQ(Run("import large cameras").exit_code, 0);
  {
    const auto database = Database::Open(folder_ / "large", Database::Access::kWrite).value();
    PutBalls(*database, {number(1), number(5), number(9)});
  }
  EXPECT_EQ(Json::parse(Run("show large --format json").out)["configurations"], 3);
  EXPECT_EQ(Run("import large moved").exit_code, 2);
}

TEST_F(CalibrationProgram, ShowTellsCamerasResolutionAndPairs) {
  ASSERT_EQ(Run("import db cameras").exit_code, 0);
  const Json shown = Shown();
  EXPECT_EQ(shown["kind"], "cameras");
  EXPECT_EQ(shown["configurations"], 30);
  const Json& left = shown["views"][0];
  EXPECT_NEAR(left["camera"]["position"][1].get<double>(), -3, 1e-9);
  // 3.03 m away, and 10 image pixels of 1/600 each to a mask pixel across, 7.5 downward.
  EXPECT_NEAR(left["metres_per_mask_pixel"].get<double>(), 3.03 * 10 / 600, 1e-3);
  EXPECT_NEAR(shown["pairs"][0]["baseline"].get<double>(), std::sqrt(0.09 + 3.2 * 3.2 * 2), 1e-9);
  const Ended text = Run("show db");
  EXPECT_EQ(text.exit_code, 0);
  EXPECT_THAT(text.out, AllOf(HasSubstr("(0.300, -3.000, 0.800)"), HasSubstr("mm per pixel"),
                              HasSubstr("views left and top"), HasSubstr("baseline"),
                              HasSubstr("at worst 0 % of ")));
}

TEST_F(CalibrationProgram, ShowDrawsTheBandsOfPixels) {
  ASSERT_EQ(Run("import db cameras").exit_code, 0);
  EXPECT_EQ(Run("show db --picture bands.png").exit_code, 0);
  EXPECT_FALSE(cv::imread(folder_ / "bands.png").empty());
  EXPECT_EQ(
      Run("show db --view top --pixel 3,4 --pixel 32,19 --number 0 --picture two.png").exit_code,
      0);
  EXPECT_FALSE(cv::imread(folder_ / "two.png").empty());
  const auto refusal = [&](const std::string& options) {
    const Ended outcome = Run("show db --picture p.png " + options);
    EXPECT_EQ(outcome.exit_code, 2);
    return outcome.err;
  };
  EXPECT_THAT(refusal("--view back"), HasSubstr("no view 'back'; the views are left, top"));
  EXPECT_THAT(refusal("--pixel 64,0"), HasSubstr("'64,0' is not X,Y of a mask of 64x64 pixels"));
  EXPECT_THAT(refusal("--number 4095"), HasSubstr("configuration 4095 has no robot images"));
  EXPECT_THAT(refusal("--pixel 1,1 --pixel 1,2 --pixel 1,3 --pixel 1,4 --pixel 1,5"),
              HasSubstr("at most 4 pixels"));
  for (const std::string option : {"--view top", "--pixel 3,4", "--number 0"}) {
    const Ended outcome = Run("show db " + option);
    EXPECT_EQ(outcome.exit_code, 2) << option;
    EXPECT_THAT(outcome.err, HasSubstr("requires --picture")) << option;
  }
}

TEST_F(CalibrationProgram, RemovedItIsGone) {
  EXPECT_EQ(Run("remove db").exit_code, 2);
  ASSERT_EQ(Run("import db cameras").exit_code, 0);
  EXPECT_EQ(Run("remove db").exit_code, 0);
  const Ended none = Run("export db out");
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_THAT(none.err, HasSubstr("'db' has no calibration; import one"));
}

TEST_F(CalibrationProgram, EveryMistakeIsOneSentenceAndChangesNothing) {
  const uint64_t before = Generation();
  const auto refusal = [&](const std::string& arguments) {
    const Ended outcome = Run(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << arguments;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    return outcome.err;
  };
  EXPECT_THAT(refusal("import none cameras"), HasSubstr("there is no database in 'none'"));
  EXPECT_THAT(refusal("import db cameras/top.cameramodel"),
              HasSubstr("view 'left' has no camera model; give left.cameramodel, too"));
  EXPECT_THAT(refusal("import db cameras/top.cameramodel top=cameras/left.cameramodel"),
              HasSubstr("view 'top' has two files"));
  EXPECT_THAT(refusal("import db back=cameras/top.cameramodel cameras/left.cameramodel"),
              AllOf(HasSubstr("'back=cameras/top.cameramodel'"), HasSubstr("left, top")));
  std::filesystem::create_directories(folder_ / "empty");
  EXPECT_THAT(refusal("import db empty"),
              HasSubstr("view 'left' has no camera model in the folder 'empty'; add "
                        "left.cameramodel, too"));
  const std::string whole = Read("cameras/left.cameramodel");
  Write("cut.cameramodel", whole.substr(0, whole.size() / 2));
  EXPECT_THAT(refusal("import db left=cut.cameramodel cameras/top.cameramodel"),
              AllOf(HasSubstr("view 'left': cut.cameramodel:"),
                    HasSubstr("the file is cut off, copy or write it again")));
  // A model for images that the view does not have.
  EXPECT_THAT(
      refusal("import db left=cameras/top.cameramodel top=cameras/top.cameramodel"),
      AllOf(HasSubstr("view 'left'"), HasSubstr("images of 330x200"), HasSubstr("640x480")));
  WriteCameras("one_place", {TrueCameras()[0], TrueCameras()[0]});
  EXPECT_THAT(refusal("import db one_place"),
              HasSubstr("views 'left' and 'top': two cameras stand at the same place"));
  const auto matrix = [&](const std::string& views, const std::string& f) {
    Write("m.yaml", absl::StrCat("- {", views, ", F: ", f, "}\n"));
    return refusal("import db m.yaml");
  };
  EXPECT_THAT(matrix("view_a: left, view_b: top", "[[1, 1, 1], [1, 1, 1], [1, 1, 1]]"),
              HasSubstr("views 'left' and 'top': a fundamental matrix must be of rank 2"));
  EXPECT_THAT(matrix("view_a: left, view_b: back", "[[0, 0, 1], [0, 0, 1], [1, 1, 1]]"),
              AllOf(HasSubstr("m.yaml:1"), HasSubstr("no view 'back'")));
  EXPECT_THAT(matrix("view_a: left, view_b: top", "[[0, 0, 1], [0, 0, 1]]"), HasSubstr("m.yaml:1"));
  EXPECT_THAT(refusal("import db cameras --margin -1"), HasSubstr("--margin"));
  EXPECT_EQ(Generation(), before);
  EXPECT_EQ(Run("").exit_code, 2);
}

}  // namespace
}  // namespace silhouette
