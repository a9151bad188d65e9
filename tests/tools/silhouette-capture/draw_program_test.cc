// SPDX-License-Identifier: Apache-2.0
// silhouette-capture draw, as a user runs it.
#include <gmock/gmock.h>
#include <signal.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>

#include "calib/files/calibration_message.h"
#include "db/store/collision_index.h"
#include "tests/capture/session/program_cell.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class DrawProgram : public testing::Test {
 protected:
  void SetUp() override {
    cell_.WriteCell({{"  joints:\n", "  images: drawn\n  joints:\n"},
                     {"{joint_1: 9, joint_3: 5}", "{joint_1: 150, joint_3: 120}"}});
  }

  // A database with two cameras that see the robot; all of it up to that focal length.
  void MakeBase(double focal = 150) const {
    const Outcome made = cell_.Run({"reference", "--cell", cell_.cell(), "--database", base()});
    ASSERT_EQ(made.exit_code, 0) << made.err;
    StoreCameras(base(), focal);
  }

  static void StoreCameras(const std::string& path, double focal = 150) {
    storage::v1::Calibration calibration;
    for (const Eigen::Vector3d& from :
         {Eigen::Vector3d(0.2, 0, 5.4), Eigen::Vector3d(5.2, 0, 1.3)}) {
      Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
      pose.linear().col(2) = (Eigen::Vector3d(0, 0, 1) - from).normalized();
      pose.linear().col(0) = pose.linear().col(2).cross(Eigen::Vector3d::UnitY()).normalized();
      pose.linear().col(1) = pose.linear().col(2).cross(pose.linear().col(0));
      pose.translation() = from;
      *calibration.add_cameras() = MessageOf(CameraModel(
          {.width = 160, .height = 120, .fx = focal, .fy = focal, .cx = 79.5, .cy = 59.5},
          pose.inverse()));
    }
    const auto database = Database::Open(path, Database::Access::kWrite);
    ASSERT_TRUE((*database)->SetCalibration(calibration, "test").ok());
  }

  // Of the model that was drawn, in the cell's ranges.
  static storage::v1::ModelVerification Verification(const Outcome& drawn) {
    storage::v1::ModelVerification verification;
    verification.set_digest(nlohmann::json::parse(drawn.out)["digest"].get<std::string>());
    for (const auto& [joint, degrees] : {std::pair{"joint_1", 150}, {"joint_3", 120}}) {
      storage::v1::VerifiedRange& range = *verification.add_ranges();
      range.set_joint(joint);
      range.set_lower(-degrees * std::numbers::pi / 180);
      range.set_upper(degrees * std::numbers::pi / 180);
    }
    return verification;
  }

  std::string base() const { return cell_ / "base.lmdb"; }
  Outcome Draw(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = {"--from", base(), "--format", "json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return cell_.Run(cell_.Arguments("draw", arguments));
  }

  ProgramCell cell_;
};

TEST_F(DrawProgram, DrawsTheGridWithCalibrationReferencesAndIndex) {
  MakeBase();
  const Outcome drawn = Draw();
  ASSERT_EQ(drawn.exit_code, 0) << drawn.err;
  const auto json = nlohmann::json::parse(drawn.out);
  EXPECT_EQ(json["configurations"], 18000);
  EXPECT_EQ(json["drawn"], 18000);
  const auto database = Database::Open(cell_.database(), Database::Access::kRead);
  ASSERT_TRUE(database.ok()) << database.status();
  const auto snapshot = (*database)->Read();
  EXPECT_EQ(snapshot->size(), 18000u);
  EXPECT_TRUE(snapshot->Calibration()->has_value());
  EXPECT_TRUE(snapshot->References()->has_value());
  EXPECT_EQ((*snapshot->DrawnImages())->digest(), json["digest"]);
  const CollisionIndexSummary index = (*CollisionIndex::Open(*(*database)->Read()))->Summary();
  EXPECT_EQ(index.fresh, (*database)->grid().tiles());
  // Once more: nothing is left to do.
  EXPECT_EQ(nlohmann::json::parse(Draw().out)["kept"], 18000);
}

// Both images of a node are records of their own.
TEST_F(DrawProgram, DrawsOwnAndReachImagesOfTheNodesOfAnArm) {
  const std::string wrist = "    - {name: joint_5, lower: -60 deg, upper: 60 deg}\n";
  cell_.WriteCell({{"  joints:\n", "  images: {drawn: {arm_joints: 2}}\n  joints:\n"},
                   {"  fixed: {", wrist + "  fixed: {"},
                   {" joint_5: 20 deg,", ""},
                   {"{joint_1: 9, joint_3: 5}", "{joint_1: 30, joint_3: 20}"}});
  MakeBase();
  const Outcome drawn = Draw();
  ASSERT_EQ(drawn.exit_code, 0) << drawn.err;
  const auto json = nlohmann::json::parse(drawn.out);
  EXPECT_EQ(json["configurations"], 1200) << drawn.out;
  EXPECT_EQ(json["drawn"], 1200);
  const auto database = *Database::Open(cell_.database(), Database::Access::kRead);
  const auto own = *(*database->OpenVariant("own"))->Read();
  const auto reach = *(*database->OpenVariant("reach"))->Read();
  EXPECT_EQ(own.size(), 600u);
  EXPECT_EQ(reach.size(), 600u);
  for (int turn = 0; turn < 30; ++turn) {
    const ConfigurationNumber node = database->grid().NumberOf({turn, turn / 2, 0});
    for (size_t view = 0; view < 2; ++view) {
      const Mask touched = own.Find(node)->value().masks[view];
      EXPECT_GT(touched.Count(), 0);
      EXPECT_EQ((touched - reach.Find(node)->value().masks[view]).Count(), 0);
    }
  }
  EXPECT_EQ(nlohmann::json::parse(Draw().out)["kept"], 1200);
}

TEST_F(DrawProgram, CheckNamesViewsThatShowOnlyAPartOfTheRobot) {
  const auto check = [&] {
    return cell_.Run({"check", "--cell", cell_.cell(), "--database", base()}).out;
  };
  MakeBase();
  EXPECT_THAT(check(), Not(HasSubstr("only a part of the robot")));
  std::filesystem::remove_all(base());
  MakeBase(600);
  EXPECT_THAT(check(), HasSubstr("NOTE   views: views '"));
}

TEST_F(DrawProgram, LosesNothingThatWasCommittedWhenItIsKilled) {
  MakeBase();
  const pid_t child = cell_.Start(
      cell_.Arguments("draw", {"--from", base(), "--format", "json", "--threads", "1"}));
  while (cell_.Records() == 0) usleep(5000);
  kill(child, SIGKILL);
  cell_.Wait(child);
  const uint64_t kept = cell_.Records();
  const Outcome resumed = Draw();
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  const auto json = nlohmann::json::parse(resumed.out);
  EXPECT_EQ(json["kept"], kept);
  EXPECT_EQ(json["drawn"], 18000 - kept);
  EXPECT_EQ(cell_.Records(), 18000u);
}

TEST_F(DrawProgram, SaysInOneSentenceWhatIsMissing) {
  const auto refused = [&](const std::string& why, const std::vector<std::string>& more = {}) {
    const Outcome outcome = cell_.Run(cell_.Arguments("draw", more));
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.err, HasSubstr(why));
    EXPECT_FALSE(std::filesystem::exists(cell_.database()));
  };
  refused("only with a calibration with camera models");
  refused("--shard 8/8: state I/N", {"--shard", "8/8"});
  refused("--shard three: state I/N", {"--shard", "three"});
  cell_.WriteCell({});
  refused("says that robot images are captured");
  cell_.WriteCell({{"  joints:\n", "  images: drawn\n  joints:\n"},
                   {"grid:\n  steps: {joint_1: 9, joint_3: 5}\n", ""}});
  refused("states no grid");
}

TEST_F(DrawProgram, DatabaseOfOtherJointsOrExchangedViewsGivesNothing) {
  const std::pair<std::string, std::string> is_drawn = {"  joints:\n",
                                                        "  images: drawn\n  joints:\n"};
  cell_.WriteCell({is_drawn});
  MakeBase();
  const auto refused = [&](const std::string& difference) {
    const Outcome outcome = Draw();
    EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
    EXPECT_THAT(outcome.err, AllOf(HasSubstr("the database '" + base() + "' does not belong to"),
                                   HasSubstr(difference), HasSubstr("with --from")));
    EXPECT_FALSE(std::filesystem::exists(cell_.database()));
  };
  cell_.WriteCell({is_drawn,
                   {"name: top,", "name: x,"},
                   {"name: front,", "name: top,"},
                   {"name: x,", "name: front,"}});
  refused("view 1: name is 'front' in the cell file, 'top' in the database;");
  cell_.WriteCell({is_drawn,
                   {"    - {name: joint_3, lower: -120 deg, upper: 110 deg}\n", ""},
                   {"fixed: {", "fixed: {joint_3: 0, "},
                   {", joint_3: 5}", "}"}});
  refused("grid joint 2: name is missing in the cell file, 'joint_3' in the database;");
  cell_.WriteCell({is_drawn,
                   {"mask_size: [32, 32]", "mask_size: [48, 36]"},
                   {"upper: 110 deg", "upper: 90 deg"},
                   {"joint_3: 5}", "joint_3: 4}"}});
  const Outcome outcome = Draw();
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
}

TEST_F(DrawProgram, VerificationIsNoneWhereAJointMovesFartherThanItWasVerified) {
  const std::pair<std::string, std::string> is_drawn = {"  joints:\n",
                                                        "  images: drawn\n  joints:\n"};
  cell_.WriteCell({is_drawn});
  MakeBase();
  ASSERT_TRUE((*Database::Open(base(), Database::Access::kWrite))
                  ->SetVerification(Verification(Draw()), "test")
                  .ok());
  const auto drawn = [&] {
    std::filesystem::remove_all(cell_.database());
    return Draw();
  };
  EXPECT_EQ(nlohmann::json::parse(drawn().out)["verified"], true);
  cell_.WriteCell({is_drawn, {"upper: 150 deg", "upper: 155 deg"}});
  const Outcome wider = drawn();
  EXPECT_EQ(nlohmann::json::parse(wider.out)["verified"], false);
  EXPECT_THAT(
      wider.err,
      HasSubstr("not verified: its joint 'joint_1' moves from -2.61799 to 2.70526, but only "
                "from -2.61799 to 2.61799 when"));
}

TEST_F(DrawProgram, WithoutAGridNoReferenceImagesAreTakenWithARobotDrivenToItsLimits) {
  cell_.WriteCell({{"  joints:\n", "  images: drawn\n  joints:\n"},
                   {"grid:\n  steps: {joint_1: 9, joint_3: 5}\n", ""}});
  const Outcome outcome = cell_.Run(cell_.Arguments("reference", {"--with-robot"}));
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("to their limits; state one"));
  EXPECT_FALSE(std::filesystem::exists(cell_.database()));
}

TEST_F(DrawProgram, WithoutCameraModelsTheNextStepIsTheirImport) {
  const std::string next =
      "next: silhouette-db calibration import " + base() + " CAMERAS --cell " + cell_.cell() + "\n";
  const auto said = [&](const std::string& subcommand) {
    return cell_.Run({subcommand, "--cell", cell_.cell(), "--database", base()}).out;
  };
  EXPECT_THAT(said("reference"), HasSubstr(next));
  EXPECT_THAT(said("status"), HasSubstr(next));
  MakeBase();
  EXPECT_THAT(said("reference"), HasSubstr("next: silhouette-capture verify-model"));
  EXPECT_THAT(said("status"), HasSubstr("next: silhouette-capture verify-model"));
}

TEST_F(DrawProgram, NeverMixesTolerancesShardsOrCapturedImagesInADatabase) {
  MakeBase();
  ASSERT_EQ(Draw({"--shard", "1/4"}).exit_code, 0);
  const Outcome other_shard = Draw({"--shard", "2/4"});
  EXPECT_EQ(other_shard.exit_code, 2);
  EXPECT_THAT(other_shard.err, HasSubstr("is shard 1 of 4, not 2 of 4"));
  cell_.WriteCell({{"  joints:\n", "  images: {drawn: {tolerance: 9 mm}}\n  joints:\n"},
                   {"{joint_1: 9, joint_3: 5}", "{joint_1: 150, joint_3: 120}"}});
  const Outcome other_tolerance = Draw({"--shard", "1/4"});
  EXPECT_EQ(other_tolerance.exit_code, 2);
  EXPECT_THAT(other_tolerance.err, HasSubstr("drawn from another tolerance"));
  cell_.WriteCell({{"{joint_1: 9, joint_3: 5}", "{joint_1: 150, joint_3: 120}"}});
  const Outcome captured = cell_.Run(cell_.Arguments("run"));
  EXPECT_EQ(captured.exit_code, 2);
  EXPECT_THAT(captured.err, AllOf(HasSubstr("were drawn"), HasSubstr("another database")));
}

TEST_F(DrawProgram, StatusAndReportNameTheVerificationOfTheModelInsteadOfACapture) {
  const std::string verify = "silhouette-capture verify-model --cell " + cell_.cell() +
                             " --database " + cell_.database() + "\n";
  const Outcome report = cell_.Run(cell_.Arguments("report"));
  EXPECT_EQ(report.exit_code, 2);
  EXPECT_THAT(report.err, HasSubstr("are drawn: no capture is there to report on"));
  EXPECT_THAT(report.err, HasSubstr(verify));
  MakeBase();
  const Outcome drawn = Draw();
  ASSERT_EQ(drawn.exit_code, 0) << drawn.err;
  const Outcome status = cell_.Run(cell_.Arguments("status"));
  EXPECT_EQ(status.exit_code, 1);
  EXPECT_THAT(status.out, HasSubstr("the model, which is not verified\nnext: " + verify));
  {
    const auto database = *Database::Open(cell_.database(), Database::Access::kWrite);
    ASSERT_TRUE(database->SetVerification(Verification(drawn), "test").ok());
  }
  const Outcome verified = cell_.Run(cell_.Arguments("status"));
  EXPECT_EQ(verified.exit_code, 0);
  EXPECT_THAT(verified.out, HasSubstr("the model, which is verified\n"));
}

}  // namespace
}  // namespace silhouette
