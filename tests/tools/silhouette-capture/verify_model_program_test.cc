// SPDX-License-Identifier: Apache-2.0
// silhouette-capture verify-model in a simulated cell whose arm has a cable that its model lacks.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "capture/verification/kept_samples.h"
#include "tests/capture/session/program_cell.h"
#include "tests/folders.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::AnyOf;
using testing::HasSubstr;
using testing::Not;

struct VerifyModelProgram : testing::Test {
  VerifyModelProgram() {
    const std::string simulation = ReadText(cell_ / "simulation.yaml");
    WriteText(cell_ / "simulation.yaml",
              simulation +
                  "light: {shadow: 0}\n"
                  "parts:\n"
                  "  default:\n"
                  "    - {link: forearm, capsule: {radius: 0.02, length: 0.3},\n"
                  "       position: [0.18, 0, 0.25], brightness: 0.9}\n");
    Write("captured.yaml", "", "grid:\n  steps: {joint_1: 9, joint_3: 5}\n");
    Write("drawn.yaml", "  images: drawn\n",
          "workspace: {lower: [-1.9, -1.9, 0], upper: [1.9, 1.9, 2.4]}\n");
  }

  void Write(const std::string& file, const std::string& robot, const std::string& more) {
    cell_.WriteCell({{"  driver: sim\n", "  driver: sim\n" + robot},
                     {"grid:\n  steps: {joint_1: 9, joint_3: 5}\n", more},
                     {"[32, 32]", "[64, 64]"},
                     {"[40, 30]", "[80, 60]"}});
    std::filesystem::rename(cell_.cell(), cell_ / file);
  }

  Outcome Run(const std::string& subcommand, const std::string& cell, const std::string& database,
              const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = {subcommand, "--cell", cell_ / cell, "--database",
                                          cell_ / database};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return cell_.Run(arguments);
  }

  static void Shell(const std::string& command) {
    const std::string whole = ProgramFolder() + "/" + command + " >/dev/null 2>&1";
    ASSERT_EQ(std::system(whole.c_str()), 0) << whole;
  }

  // The drawn cell's database with the true cameras.
  void MakeDrawn() const {
    ASSERT_EQ(Run("reference", "drawn.yaml", "drawn.lmdb").exit_code, 0);
    Shell("silhouette-sim calibration --cell " + cell_ / "drawn.yaml" + " --out " + cell_ / "true");
    Shell("silhouette-db calibration import " + cell_ / "drawn.lmdb" + " " + cell_ / "true");
  }

  bool IsVerified() const {
    const auto database = *Database::Open(cell_ / "drawn.lmdb", Database::Access::kRead);
    return database->Read()->Verification()->has_value();
  }

  ProgramCell cell_;
};

TEST_F(VerifyModelProgram, CapturedImagesOfADatabaseVerifyTheModelAndRefuseAWrongOne) {
  ASSERT_EQ(Run("reference", "captured.yaml", "captured.lmdb").exit_code, 0);
  ASSERT_EQ(Run("run", "captured.yaml", "captured.lmdb").exit_code, 0);
  MakeDrawn();
  const std::vector<std::string> by_database = {"--captured", cell_ / "captured.lmdb", "--format",
                                                "json"};
  Outcome outcome = Run("verify-model", "drawn.yaml", "drawn.lmdb", by_database);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err << outcome.out;
  const nlohmann::json found = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(found["passed"], true);
  EXPECT_EQ(found["configurations"], 45);
  double growth = 0;
  for (const auto& link : found["links"]) growth += link["growth"].get<double>();
  EXPECT_GT(growth, 0) << "the cable";
  EXPECT_TRUE(IsVerified());
  EXPECT_TRUE(std::filesystem::exists(std::string(found["picture"])));

  // The arm stands elsewhere than its model has it.
  std::string text = ReadText(cell_ / "drawn.yaml");
  ASSERT_NE(text.find("joint_2: 40 deg"), std::string::npos);
  const std::string urdf = ReadText(SourceFolder() + "/capture/sim/robots/rx130.urdf");
  const std::string shoulder = "<origin xyz=\"0 0 0.34\"/>";
  ASSERT_NE(urdf.find(shoulder), std::string::npos);
  WriteText(cell_ / "wrong.urdf",
            absl::StrReplaceAll(urdf, {{shoulder, "<origin xyz=\"0.12 0 0.34\"/>"}}));
  WriteText(cell_ / "wrong.yaml",
            absl::StrReplaceAll(
                text, {{SourceFolder() + "/capture/sim/robots/rx130.urdf", "wrong.urdf"}}));
  EXPECT_THAT(Run("status", "drawn.yaml", "drawn.lmdb").out, HasSubstr("which is verified"));
  outcome = Run("status", "wrong.yaml", "drawn.lmdb");
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.out, HasSubstr("which is not verified\nnext: silhouette-capture verify-"));
  outcome = Run("verify-model", "wrong.yaml", "drawn.lmdb", by_database);
  EXPECT_EQ(outcome.exit_code, 1) << outcome.out;
  EXPECT_THAT(outcome.err, HasSubstr("not verified: "));
  EXPECT_THAT(outcome.err, HasSubstr("the verification that the database had is removed"));
  EXPECT_FALSE(IsVerified());

  // More configurations than were captured are needed: no command takes them from there.
  std::string strict =
      ReadText(cell_ / "drawn.yaml") + "verification: {least_configurations: 10000}\n";
  WriteText(cell_ / "strict.yaml", strict);
  outcome = Run("verify-model", "strict.yaml", "drawn.lmdb",
                {"--captured", cell_ / "captured.lmdb", "--sample", "9000"});
  EXPECT_EQ(outcome.exit_code, 1) << outcome.out;
  EXPECT_THAT(outcome.err, HasSubstr("a larger sample than all of '" + (cell_ / "captured.lmdb")));
  EXPECT_THAT(outcome.err, HasSubstr("capture more there, or drive the robot: silhouette-capture"));
  EXPECT_THAT(outcome.err, Not(HasSubstr("--captured")));
}

TEST_F(VerifyModelProgram, CapturedImagesOfAJointThatStoodStillDoNotVerifyItsAxis) {
  ASSERT_EQ(Run("reference", "captured.yaml", "captured.lmdb").exit_code, 0);
  ASSERT_EQ(Run("run", "captured.yaml", "captured.lmdb").exit_code, 0);
  WriteText(cell_ / "drawn.yaml",
            absl::StrReplaceAll(ReadText(cell_ / "drawn.yaml"),
                                {{"  fixed: {joint_2: 40 deg, joint_4: 0, ",
                                  "    - {name: joint_4}\n  fixed: {joint_2: 40 deg, "}}));
  MakeDrawn();
  const Outcome outcome =
      Run("verify-model", "drawn.yaml", "drawn.lmdb", {"--captured", cell_ / "captured.lmdb"});
  EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
  EXPECT_THAT(outcome.err, HasSubstr("the joint 'joint_4' moves from -4.7"));
  EXPECT_THAT(outcome.err, Not(HasSubstr("joint_1")));
  EXPECT_FALSE(IsVerified());
}

TEST_F(VerifyModelProgram, CheckNamesViewsWhoseCamerasAreExchanged) {
  MakeDrawn();
  EXPECT_THAT(Run("check", "drawn.yaml", "drawn.lmdb").out, Not(HasSubstr("exchanged")));
  const std::string top = ReadText(cell_ / "true/top.cameramodel");
  WriteText(cell_ / "true/top.cameramodel", ReadText(cell_ / "true/front.cameramodel"));
  WriteText(cell_ / "true/front.cameramodel", top);
  Shell("silhouette-db calibration import " + cell_ / "drawn.lmdb" + " " + cell_ / "true");
  const Outcome checked = Run("check", "drawn.yaml", "drawn.lmdb");
  EXPECT_EQ(checked.exit_code, 1) << checked.out;
  EXPECT_THAT(checked.out,
              HasSubstr("FAULT  calibration: the views 'top' and 'front' are exchanged: in each"));
}

TEST_F(VerifyModelProgram, DrivesTheRobotWithinItsWorkspace) {
  MakeDrawn();
  const Outcome outcome = Run("verify-model", "drawn.yaml", "drawn.lmdb", {"--sample", "80"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err << outcome.out;
  EXPECT_THAT(outcome.out, HasSubstr("compared           80 configurations, 2 views"));
  EXPECT_THAT(outcome.out, HasSubstr("the model is verified"));
  EXPECT_TRUE(IsVerified());
  // Reference images do not change the model.
  EXPECT_THAT(Run("reference", "drawn.yaml", "drawn.lmdb").out,
              AllOf(HasSubstr("the robot's model is verified"), Not(HasSubstr("next: "))));
}

// What was taken before a drive ended early is used by the next one, however it ended.
TEST_F(VerifyModelProgram, StoppedOrKilledDriveLosesNoConfiguration) {
  MakeDrawn();
  const std::string part = cell_ / "drawn.lmdb.verification.part";
  const auto kept = [&] {
    const auto database = Database::Open(part, Database::Access::kRead);
    return database.ok() ? (*database)->Read()->size() : 0;
  };
  const std::vector<std::string> arguments = {
      "verify-model", "--cell", cell_ / "drawn.yaml", "--database", cell_ / "drawn.lmdb",
      "--sample",     "80",     "--not-checked",      "base",       "wrist"};
  uint64_t before = 0;
  for (const int signal : {SIGINT, SIGTERM, SIGKILL}) {
    const pid_t program = cell_.Start(arguments);
    for (int i = 0; i < 2000 && kept() < before + 3; ++i) absl::SleepFor(absl::Milliseconds(5));
    kill(program, signal);
    const Outcome outcome = cell_.Wait(program);
    EXPECT_EQ(outcome.exit_code, signal == SIGKILL ? -1 : 1) << outcome.err;
    if (signal != SIGKILL) {
      EXPECT_THAT(outcome.err,
                  HasSubstr(absl::StrCat(kept(), " of 80 configurations are kept in '", part,
                                         "'; go on with: silhouette-capture verify-model --cell ",
                                         cell_ / "drawn.yaml", " --database ", cell_ / "drawn.lmdb",
                                         " --not-checked base wrist --sample 80\n")));
    }
    ASSERT_GE(kept(), before + 3);
    before = kept();
    ASSERT_LT(before, 80u);
  }

  const Outcome outcome = cell_.Run(arguments);
  EXPECT_THAT(outcome.exit_code, AnyOf(0, 1)) << "as chance has it, 80 suffice or do not";
  EXPECT_THAT(outcome.err, HasSubstr(absl::StrCat("going on from ", before, " configurations")));
  EXPECT_THAT(outcome.out, HasSubstr("compared           80 configurations, 2 views"));
  // The next drive begins again; the one that was compared can be compared again.
  EXPECT_FALSE(std::filesystem::exists(part));
  const Outcome again = Run("verify-model", "drawn.yaml", "drawn.lmdb",
                            {"--captured", cell_ / "drawn.lmdb.verification"});
  EXPECT_THAT(again.out, HasSubstr("compared           80 configurations")) << again.err;
}

TEST_F(VerifyModelProgram, KeptConfigurationsOfOtherReferenceImagesAreNotMixedIn) {
  MakeDrawn();
  const std::string part = cell_ / "drawn.lmdb.verification.part";
  {
    const auto drawn = *Database::Open(cell_ / "drawn.lmdb", Database::Access::kRead);
    const auto kept = *OpenKeptSamples(part, *drawn, "test");
    RobotImage image;
    image.number = *kept->grid().Nearest(std::vector<double>{0, 0});
    for (const MaskSize size : kept->mask_sizes()) image.masks.emplace_back(size);
    auto writer = *kept->Write("test");
    ASSERT_TRUE(writer.Put(image).ok());
    ASSERT_TRUE(writer.Commit().ok());
  }
  ASSERT_EQ(Run("reference", "drawn.yaml", "drawn.lmdb").exit_code, 0);
  const Outcome outcome = Run("verify-model", "drawn.yaml", "drawn.lmdb", {"--sample", "80"});
  EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("the reference images are others"),
                                 HasSubstr("move that folder away to begin again")));
  EXPECT_TRUE(std::filesystem::exists(part));
}

TEST_F(VerifyModelProgram, TooSmallASampleIsRefusedWithTheCommandOfALargerOne) {
  MakeDrawn();
  const Outcome outcome = Run("verify-model", "drawn.yaml", "drawn.lmdb", {"--sample", "10"});
  EXPECT_EQ(outcome.exit_code, 1) << outcome.out;
  EXPECT_THAT(outcome.err, HasSubstr("10 configurations are too few to compare"));
  EXPECT_THAT(outcome.err, HasSubstr("a larger sample: silhouette-capture verify-model --cell " +
                                     (cell_ / "drawn.yaml") + " --database " +
                                     (cell_ / "drawn.lmdb") + " --sample "));
}

TEST_F(VerifyModelProgram, WhatIsMissingIsNamedWithItsMend) {
  const auto mistake = [&](const std::string& cell, const std::vector<std::string>& more) {
    const Outcome outcome = Run("verify-model", cell, "drawn.lmdb", more);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
    EXPECT_THAT(outcome.err, Not(HasSubstr("\n\n")));
    return outcome.err;
  };
  EXPECT_THAT(mistake("captured.yaml", {}), HasSubstr("state 'images: drawn'"));
  EXPECT_THAT(mistake("drawn.yaml", {}), HasSubstr("take them first with: silhouette-capture ref"));
  ASSERT_EQ(Run("reference", "drawn.yaml", "drawn.lmdb").exit_code, 0);
  EXPECT_THAT(mistake("drawn.yaml", {}), HasSubstr("silhouette-db calibration import"));
  MakeDrawn();
  EXPECT_THAT(mistake("drawn.yaml", {"--captured", cell_ / "none.lmdb"}), HasSubstr("none.lmdb"));
  Write("anywhere.yaml", "  images: drawn\n", "");
  EXPECT_THAT(mistake("anywhere.yaml", {}), HasSubstr("state 'workspace'"));
  EXPECT_THAT(mistake("drawn.yaml", {"--not-checked", "wrist", "elbo"}),
              HasSubstr("the robot has no link 'elbo'; its links are 'base'"));
  Write("low.yaml", "  images: drawn\n",
        "workspace: {lower: [-1.9, -1.9, 0], upper: [1.9, 1.9, 1]}\n");
  EXPECT_THAT(mistake("low.yaml", {}),
              HasSubstr("'upper_arm' with its tolerance is beyond the upper face of 'workspace' "
                        "across z, or nearer than 3 mm to it, at all joint values that were tried: "
                        "correct 'workspace'"));
  Write("narrow.yaml", "  images: drawn\n",
        "workspace: {lower: [-1.9, -1.9, 0], upper: [0.4, 1.9, 2.4]}\n");
  EXPECT_THAT(mistake("narrow.yaml", {}),
              AllOf(HasSubstr("and the upper face of 'workspace' across x: -"),
                    HasSubstr("move the robot by hand")));
  EXPECT_FALSE(IsVerified());
}

}  // namespace
}  // namespace silhouette
