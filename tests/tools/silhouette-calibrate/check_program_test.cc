// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate check, and what calibration.yaml carries into the database, as a user runs
// them: two cameras that see tags on the floor of the cell.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "calib/boards/board.h"
#include "calib/boards/sighting_file.h"
#include "calib/files/calibration_check_file.h"
#include "calib/files/camera_file.h"
#include "db/store/store.h"
#include "tests/calib/fundamental/seen_cell.h"
#include "tests/folders.h"
#include "tests/shell.h"

namespace silhouette {
namespace {

using Json = nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;

class CheckProgram : public testing::Test {
 protected:
  CheckProgram() {
    const std::vector<NamedCamera> all = CellCameras(-0.2);
    cameras_ = {all[0], all[1]};
    storage::v1::CellDescription cell;
    cell.set_name("cell");
    storage::v1::GridJoint& joint = *cell.add_grid_joints();
    joint.set_name("joint");
    joint.set_upper(1);
    joint.set_steps(3);
    for (const NamedCamera& camera : cameras_) {
      storage::v1::View& view = *cell.add_views();
      view.set_name(camera.view);
      view.set_image_width(640);
      view.set_image_height(480);
      view.set_mask_width(64);
      view.set_mask_height(64);
      WriteFile(shell_.folder() / "cameras" / CameraFileName(camera.view),
                CameraFileText(camera.model, camera.view));
    }
    const auto made = Database::Create((shell_.folder() / "db").string(), cell);
    EXPECT_TRUE(made.ok()) << made.status();
    WriteCorners("then.csv", cameras_, 1);
  }

  // What the cameras see of five tags on the floor, in three frames.
  void WriteCorners(const std::string& file, const std::vector<NamedCamera>& cameras,
                    uint64_t seed) const {
    Chance chance(seed);
    std::vector<TagSighting> sightings;
    for (int frame = 0; frame < 3; ++frame) {
      for (int tag = 0; tag < 5; ++tag) {
        const Board board({.name = "floor", .tag_size = 0.15, .first_id = tag});
        Eigen::Isometry3d pose(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX()));
        pose.translation() = Eigen::Vector3d(0.5 * tag - 1, 0.3 * (tag % 3) - 0.4, 0);
        for (const NamedCamera& camera : cameras) {
          const auto seen = ProjectTags(camera, std::to_string(frame), board, pose,
                                        {.sigma = 0.05, .least_size = 8, .most_tilt = 1.5}, chance);
          sightings.insert(sightings.end(), seen.begin(), seen.end());
        }
      }
    }
    WriteFile(shell_.folder() / file, SightingFileText(sightings));
  }

  // The second camera turned: `yaw` about its vertical, `roll` about its axis; degrees.
  std::vector<NamedCamera> Turned(double yaw, double roll) const {
    const double degree = std::numbers::pi / 180;
    const CameraModel& was = cameras_[1].model;
    Eigen::Isometry3d turn(Eigen::AngleAxisd(yaw * degree, Eigen::Vector3d::UnitY()) *
                           Eigen::AngleAxisd(roll * degree, Eigen::Vector3d::UnitZ()));
    return {cameras_[0],
            {cameras_[1].view, CameraModel(was.intrinsics(), turn * was.camera_from_world())}};
  }

  // Moves the corners of these sightings in now.csv by 5 px.
  template <typename Which>
  void MoveInNow(const Which& which) const {
    auto now = SightingsFromText(ContentOf(shell_.folder() / "now.csv"), "now.csv");
    ASSERT_TRUE(now.ok()) << now.status();
    for (TagSighting& seen : *now) {
      if (!which(seen)) continue;
      for (Eigen::Vector2d& corner : seen.corners) corner.x() += 5;
    }
    WriteFile(shell_.folder() / "now.csv", SightingFileText(*now));
  }

  CalibrationCheck Written() const {
    return CheckFromText(ContentOf(shell_.folder() / "check.json"), "check.json").value();
  }

  Ended Calibrate(const std::string& arguments) const {
    return shell_.Run(ProgramFolder() + "/silhouette-calibrate " + arguments);
  }
  Ended Db(const std::string& arguments) const {
    return shell_.Run(ProgramFolder() + "/silhouette-db calibration " + arguments);
  }
  void Import() const {
    const Ended written = Calibrate(
        "fundamental --cameras cameras --mask-size 64x64 --calibration cameras/calibration.yaml "
        "--fixed-tags then.csv");
    ASSERT_EQ(written.exit_code, 0) << written.err;
    const Ended imported = Db("import db cameras/calibration.yaml");
    ASSERT_EQ(imported.exit_code, 0) << imported.err;
  }

  Shell shell_;
  std::vector<NamedCamera> cameras_;
};

TEST_F(CheckProgram, TheDatabaseKeepsWhereTheCalibrationComesFrom) {
  Import();
  const Ended shown = Db("show db --format json");
  ASSERT_EQ(shown.exit_code, 0) << shown.err;
  const Json record = Json::parse(shown.out)["record"];
  EXPECT_THAT(record["program"], HasSubstr("silhouette-calibrate fundamental"));
  EXPECT_EQ(record["figures"][0]["name"], "bow");
  EXPECT_GE(record["fixed_tags"].size(), 8u);
  EXPECT_THAT(Db("show db").out, HasSubstr("fixed tags"));
  // Out and in again: the same.
  ASSERT_EQ(Db("export db out").exit_code, 0);
  EXPECT_THAT(Db("import db out").out, HasSubstr("nothing is changed"));
}

TEST_F(CheckProgram, WhatIsKnownOfTheCamerasStaysWhenFixedTagsAreAdded) {
  const std::string file = shell_.folder() / "cameras" / "calibration.yaml";
  WriteFile(file, absl::StrCat("calibration: 1\ntime: long ago\nprogram: somebody\nviews:\n",
                               "  - {name: ", cameras_[0].view, ", camera: ",
                               CameraFileName(cameras_[0].view), "}\n  - {name: ", cameras_[1].view,
                               ", camera: ", CameraFileName(cameras_[1].view),
                               "}\nfigures:\n  - {name: chi2_per_dof, value: 1.25}\n"));
  Import();
  const Json record = Json::parse(Db("show db --format json").out)["record"];
  EXPECT_EQ(record["program"], "somebody");
  EXPECT_EQ(record["time"], "long ago");
  EXPECT_EQ(record["figures"][0]["value"], 1.25);
  EXPECT_EQ(record["figures"][1]["name"], "bow");
  EXPECT_GE(record["fixed_tags"].size(), 8u);
}

TEST_F(CheckProgram, WhatIsKnownOfTheCamerasStaysByWhateverPathTheFileIsNamed) {
  Import();
  for (const std::string file : {"./cameras/calibration.yaml", "db/../cameras/calibration.yaml"}) {
    const Ended ended =
        Calibrate("fundamental --cameras ./cameras --mask-size 64x64 --calibration " + file);
    ASSERT_EQ(ended.exit_code, 0) << ended.err;
    EXPECT_THAT(ContentOf(shell_.folder() / "cameras" / "calibration.yaml"),
                AllOf(HasSubstr("fixed_tags"), HasSubstr(", camera: \"north.cameramodel\"")));
  }
}

TEST_F(CheckProgram, ACalibrationFileThatCannotBeReadIsNotOverwritten) {
  const std::string file = shell_.folder() / "cameras" / "calibration.yaml";
  for (const std::string text : {"calibration: 1\nviws: []\n", "- anything\n", "{"}) {
    WriteFile(file, text);
    const Ended ended = Calibrate(
        "fundamental --cameras cameras --mask-size 64x64 --calibration cameras/calibration.yaml");
    EXPECT_EQ(ended.exit_code, 2) << ended.out;
    EXPECT_THAT(ended.err, HasSubstr("or remove it, for a new one in its place"));
    EXPECT_EQ(ContentOf(file), text);
  }
}

TEST_F(CheckProgram, CornersInImagesOfAnotherSizeAreRefused) {
  Import();
  auto now = SightingsFromText(ContentOf(shell_.folder() / "then.csv"), "then.csv");
  ASSERT_TRUE(now.ok()) << now.status();
  for (TagSighting& seen : *now) seen.image = {1280, 960};
  WriteFile(shell_.folder() / "now.csv", SightingFileText(*now));
  const Ended ended = Calibrate("check --database db --corners now.csv");
  EXPECT_EQ(ended.exit_code, 2) << ended.out;
  EXPECT_THAT(ended.err, HasSubstr("its image size in the database is 640x480, but its corners "
                                   "were found in images of 1280x960"));
}

TEST_F(CheckProgram, CamerasThatStandStillHold) {
  Import();
  WriteCorners("now.csv", cameras_, 2);
  const Ended ended = Calibrate("check --database db --corners now.csv --out check.json");
  EXPECT_EQ(ended.exit_code, 0) << ended.out << ended.err;
  const auto check = CheckFromText(ContentOf(shell_.folder() / "check.json"), "check.json");
  ASSERT_TRUE(check.ok()) << check.status();
  EXPECT_TRUE(check->Holds());
  for (const CheckedView& view : check->views) EXPECT_LT(view.moved_px, 0.4) << view.name;
}

TEST_F(CheckProgram, AResultGoesWhereALinkPointsAndTheFileKeepsItsPermissions) {
  namespace fs = std::filesystem;
  Import();
  WriteCorners("now.csv", cameras_, 2);
  const fs::path file = shell_.folder() / "check.json";
  const fs::path link = shell_.folder() / "link.json";
  constexpr fs::perms kPermissions{0640};
  for (const fs::path& out : {file, link}) {
    WriteFile(file, "earlier");
    fs::permissions(file, kPermissions);
    if (out == link) fs::create_symlink(file, link);
    Calibrate("check --database db --corners now.csv --out " + out.string());
    EXPECT_TRUE(CheckFromText(ContentOf(file), "check.json").ok()) << out;
    EXPECT_EQ(fs::status(file).permissions(), kPermissions) << out;
  }
  EXPECT_TRUE(fs::is_symlink(link));
}

TEST_F(CheckProgram, OldCornersAreNotTakenForWhatIsSeenNow) {
  Import();
  WriteCorners("now.csv", cameras_, 2);
  const auto checked_at = [&] {
    const Ended ended = Calibrate("check --database db --corners now.csv --out check.json");
    EXPECT_EQ(ended.exit_code, 0) << ended.out << ended.err;
    return CheckFromText(ContentOf(shell_.folder() / "check.json"), "check.json")->time;
  };
  const auto file = shell_.folder() / "now.csv";
  const auto written = std::filesystem::last_write_time(file);
  const absl::Time now = absl::Now();
  EXPECT_LT(absl::AbsDuration(now - checked_at()), absl::Minutes(1));
  std::filesystem::last_write_time(file, written - std::chrono::hours(30));
  EXPECT_LT(absl::AbsDuration(now - absl::Hours(30) - checked_at()), absl::Minutes(1));
  std::filesystem::last_write_time(file, written + std::chrono::hours(30));
  EXPECT_LT(absl::AbsDuration(now - checked_at()), absl::Minutes(1));
}

TEST_F(CheckProgram, ATagThatMovedIsNamedAndItsViewIsNotConfirmed) {
  Import();
  WriteCorners("now.csv", cameras_, 2);
  MoveInNow([](const TagSighting& seen) { return seen.view == "east" && seen.tag == 2; });
  const Ended ended = Calibrate("check --database db --corners now.csv");
  EXPECT_EQ(ended.exit_code, 1);
  EXPECT_THAT(ended.out, HasSubstr("north: holds"));
  EXPECT_THAT(ended.out, HasSubstr("east: not checked: tag 2 of tagStandard41h12 moved by itself"));
}

TEST_F(CheckProgram, ACameraThatMovesDuringTheCheckIsNotConfirmed) {
  Import();
  WriteCorners("now.csv", cameras_, 2);
  const std::string check = "check --database db --corners now.csv --out check.json";
  ASSERT_EQ(Calibrate(check).exit_code, 0);
  ASSERT_TRUE(Written().Holds());
  MoveInNow([](const TagSighting& seen) { return seen.view == "east" && seen.frame == "2"; });
  const Ended ended = Calibrate(check);
  EXPECT_EQ(ended.exit_code, 1) << ended.err;
  EXPECT_THAT(ended.out, AllOf(HasSubstr("north: holds"),
                               HasSubstr("east: not checked: view 'east' saw tag ")));
  EXPECT_FALSE(Written().Holds());
}

TEST_F(CheckProgram, AMistakeLeavesTheEarlierResultAsItWas) {
  Import();
  WriteCorners("now.csv", cameras_, 2);
  ASSERT_EQ(Calibrate("check --database db --corners now.csv --out check.json").exit_code, 0);
  EXPECT_EQ(Calibrate("check --database db --corners none.csv --out check.json").exit_code, 2);
  EXPECT_TRUE(Written().Holds());
}

TEST_F(CheckProgram, TheCornersOfTheCalibrationAreNotTakenForWhatIsSeenNow) {
  Import();
  for (const std::string reference : {"", " --reference then.csv"}) {
    const Ended ended = Calibrate("check --database db --corners then.csv" + reference);
    EXPECT_EQ(ended.exit_code, 1) << reference;
    EXPECT_THAT(ended.out, HasSubstr("the images are not new")) << reference;
  }
}

TEST_F(CheckProgram, FixedTagsMayBeTheCornersOfACharucoBoard) {
  const Board board({.name = "floor",
                     .kind = BoardKind::kCharuco,
                     .rows = 5,
                     .columns = 7,
                     .tag_size = 0.11,
                     .square = 0.15});
  Eigen::Isometry3d pose(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX()));
  pose.translation() = Eigen::Vector3d(-0.5, 0.4, 0);
  const auto write = [&](const std::string& file, uint64_t seed) {
    Chance chance(seed);
    std::vector<TagSighting> sightings;
    for (const NamedCamera& camera : cameras_) {
      const auto seen =
          ProjectTags(camera, "1", board, pose, {.sigma = 0.05, .most_tilt = 1.5}, chance);
      sightings.insert(sightings.end(), seen.begin(), seen.end());
    }
    WriteFile(shell_.folder() / file, SightingFileText(sightings));
  };
  write("then.csv", 1);
  write("now.csv", 2);
  Import();
  const Ended ended = Calibrate("check --database db --corners now.csv --format json");
  EXPECT_EQ(ended.exit_code, 0) << ended.out << ended.err;
  EXPECT_GT(Json::parse(ended.out)["views"][1]["corners"], 12);
}

TEST_F(CheckProgram, ACameraThatTurnedIsFoundAndMeasured) {
  Import();
  WriteCorners("now.csv", Turned(0.5, 0), 2);
  const Ended ended =
      Calibrate("check --database db --corners now.csv --format json --draw pictures");
  EXPECT_EQ(ended.exit_code, 1);
  const Json told = Json::parse(ended.out);
  EXPECT_FALSE(told["holds"]);
  EXPECT_TRUE(told["views"][0]["holds"]);
  EXPECT_FALSE(told["views"][1]["holds"]);
  // Half a degree is 4.6 px in the middle of the image, and 6.4 at its corners.
  EXPECT_GT(told["views"][1]["moved_px"], 4.6);
  EXPECT_LT(told["views"][1]["moved_px"], 6.4);
  EXPECT_FALSE(cv::imread(shell_.folder() / "pictures" / "check_east.png").empty());
}

TEST_F(CheckProgram, ATurnAboutTheAxisIsToldFromAShift) {
  Import();
  WriteCorners("now.csv", Turned(0, 1), 2);
  const Ended ended = Calibrate("check --database db --corners now.csv --format json");
  EXPECT_EQ(ended.exit_code, 1);
  const Json view = Json::parse(ended.out)["views"][1];
  EXPECT_NEAR(view["turn_deg"], 1, 0.15);
  EXPECT_NEAR(view["moved_px"], 7, 2);  // in the image's corners, 400 px out
}

TEST_F(CheckProgram, ACameraThatSeesNoTagIsNotTaken) {
  Import();
  WriteCorners("now.csv", {cameras_[0]}, 2);
  const Ended ended = Calibrate("check --database db --corners now.csv --out check.json");
  EXPECT_EQ(ended.exit_code, 1);
  EXPECT_THAT(ended.out, HasSubstr("east: not checked"));
  EXPECT_FALSE(CheckFromText(ContentOf(shell_.folder() / "check.json"), "")->Holds());
}

TEST_F(CheckProgram, SaysWhatIsMissing) {
  WriteCorners("now.csv", cameras_, 2);
  const auto said = [&](const std::string& arguments) {
    const Ended ended = Calibrate("check " + arguments);
    EXPECT_EQ(ended.exit_code, 2);
    return ended.err;
  };
  EXPECT_THAT(said("--database db --corners now.csv"), HasSubstr("has no calibration to check"));
  ASSERT_EQ(Db("import db cameras").exit_code, 0);
  EXPECT_THAT(said("--database db --corners now.csv"), HasSubstr("give --reference"));
  EXPECT_EQ(Calibrate("check --database db --corners now.csv --reference then.csv").exit_code, 0);
  EXPECT_THAT(said("--database db --corners none.csv --reference then.csv"), HasSubstr("none.csv"));
  EXPECT_THAT(said("--database db --corners now.csv --reference then.csv --number 0"),
              HasSubstr("--number compares the parked robot in --images or --live"));
}

TEST(CheckFile, WhatIsNotKnownDoesNotHold) {
  CalibrationCheck check;
  check.time = absl::FromUnixSeconds(1'000'000'000);
  check.calibration = "x";
  check.limit_mask_px = 1;
  EXPECT_FALSE(check.Holds());  // no view
  CheckedView& view = check.views.emplace_back();
  view.name = "top";
  view.method = "tags";
  view.checked = view.holds = true;
  EXPECT_TRUE(CheckFromText(CheckFileText(check), "f")->Holds());
  EXPECT_EQ(CheckFromText(CheckFileText(check), "f")->time, check.time);
  check.views[0].moved_mask_px = 1.5;  // contradicts holds
  EXPECT_FALSE(CheckFromText(CheckFileText(check), "f")->Holds());
  check.views[0].checked = false;
  EXPECT_FALSE(CheckFromText(CheckFileText(check), "f")->Holds());
  view.checked = true;
  for (const double impossible : {-0.5, std::numeric_limits<double>::infinity()}) {
    view.moved_mask_px = impossible;
    EXPECT_FALSE(CheckFromText(CheckFileText(check), "f").ok());
  }
  view.moved_mask_px = -0.5;
  EXPECT_EQ(CheckFromText(CheckFileText(check), "f").status().message(),
            "'f': view 'top' cannot have moved by -0.5 px");
  view.moved_mask_px = 0;
  check.limit_mask_px = -1;
  EXPECT_FALSE(CheckFromText(CheckFileText(check), "f").ok());
  check.limit_mask_px = 1;
  std::string doubtful = CheckFileText(check);
  doubtful.replace(doubtful.find("true"), 4, "false");  // the file's own "holds", its first
  EXPECT_FALSE(CheckFromText(doubtful, "f").ok());
  EXPECT_FALSE(CheckFromText("{}", "f").ok());
  EXPECT_FALSE(CheckFromText("{\"check\": 2}", "f").ok());
  EXPECT_FALSE(CheckFromText("", "f").ok());
}

}  // namespace
}  // namespace silhouette
