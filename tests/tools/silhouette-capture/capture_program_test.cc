// SPDX-License-Identifier: Apache-2.0
// What silhouette-capture says and returns: done, not done, and every wrong input.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/statvfs.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/capture/session/program_cell.h"
#include "tests/db/store/index_checks.h"
#include "tests/folders.h"
#include "tests/running_program.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::SizeIs;
using testing::StartsWith;

constexpr uid_t kNobody = 65534;

class CaptureProgram : public testing::Test {
 protected:
  // The run is refused as the user's mistake with one line that holds `message`.
  void ExpectMistake(const Outcome& outcome, const std::string& message) {
    EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(message));
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    EXPECT_EQ(outcome.out, "");
  }
  nlohmann::json Json(const Outcome& outcome) {
    return nlohmann::json::parse(outcome.out, nullptr, /*allow_exceptions=*/false);
  }

  ProgramCell cell_;
};

TEST_F(CaptureProgram, GoesFromNothingToACompleteDatabase) {
  Outcome outcome = cell_.Run(cell_.Arguments("status", {"--format", "json"}));
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_EQ(Json(outcome)["missing"], 45);
  EXPECT_THAT(std::string(Json(outcome)["next"]), StartsWith("silhouette-capture reference"));

  outcome = cell_.Run(cell_.Arguments("reference", {"--format", "json"}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(Json(outcome)["images"], 3);
  EXPECT_THAT(Json(outcome)["views"], SizeIs(2));

  outcome = cell_.Run(cell_.Arguments("run", {"--format", "json"}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  const nlohmann::json report = Json(outcome);
  EXPECT_EQ(report["state"], "complete");
  EXPECT_EQ(report["captured"], 45);
  EXPECT_EQ(report["views"], 2);
  EXPECT_GT(report["seconds"], 0);
  for (const auto& view : report["view_quality"]) {
    EXPECT_EQ(view["empty"], 0);
    EXPECT_GT(view["mean_area"], 5);
  }
  EXPECT_EQ(report["collision_index"]["complete"], true);
  EXPECT_EQ(report["collision_index"]["built"], 1);

  outcome = cell_.Run(cell_.Arguments("status"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("all is captured"));
}

TEST_F(CaptureProgram, StatusOfACellWithoutCamerasNamesTheImport) {
  cell_.WriteCell({{"source: sim, noise: none, image_size: [160, 120], ", ""},
                   {"-150 deg, upper: 150 deg", "-1, upper: 1"},
                   {"{joint_1: 9, joint_3: 5}", "{joint_1: 2, joint_3: 2}"}});
  Outcome outcome = cell_.Run(cell_.Arguments("status"));
  EXPECT_EQ(outcome.exit_code, 1);
  const std::string arguments =
      "import --cell " + cell_.cell() + " --database " + cell_.database() + " ";
  EXPECT_THAT(outcome.out, HasSubstr("next: silhouette-db " + arguments + "FOLDER\n"));
  WriteText(cell_ / "configurations.csv",
            "joint_1,joint_3,top,front\n-1,-120deg,,\n-1,110deg,,\n1,-120deg,,\n1,110deg,,\n");
  const std::string import = ProgramFolder() + "/silhouette-db " + arguments;
  ASSERT_EQ(std::system((import + cell_ / "configurations.csv" + " >/dev/null").c_str()), 0);
  outcome = cell_.Run(cell_.Arguments("status"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out;
}

TEST_F(CaptureProgram, CollisionIndexIsThatOfTheCapturedImagesUnlessLeftOut) {
  EXPECT_EQ(cell_.Run(cell_.Arguments("reference")).exit_code, 0);
  Outcome outcome = cell_.Run(cell_.Arguments("run", {"--no-index"}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, Not(HasSubstr("collision index")));
  const auto open = [&] { return *Database::Open(cell_.database(), Database::Access::kRead); };
  EXPECT_EQ(OpenIndex(*open())->State(0), TileState::kMissing);
  // Nothing is left to capture; the index is.
  outcome = cell_.Run(cell_.Arguments("run"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("collision index    1 of 1 tile built\n"));
  ExpectIndexHoldsTheRobotImages(*open());
  EXPECT_EQ(OpenIndex(*open())->State(0), TileState::kFresh);
  outcome = cell_.Run(cell_.Arguments("run", {"--only", "all", "--no-index"}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(OpenIndex(*open())->State(0), TileState::kStale);
  outcome = cell_.Run(cell_.Arguments("run", {"--format", "json"}));
  EXPECT_EQ(Json(outcome)["collision_index"]["built"], 1);
  ExpectIndexHoldsTheRobotImages(*open());
}

TEST_F(CaptureProgram, DatabaseMayBeNamedByTheCellFile) {
  cell_.WriteCell({{"name: small\n", "name: small\ndatabase: cell.lmdb\n"}});
  EXPECT_EQ(cell_.Run({"reference", "--cell", cell_.cell()}).exit_code, 0);
  const Outcome outcome = cell_.Run({"run", "--cell", cell_.cell()});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(cell_.Records(), 45u);
}

TEST_F(CaptureProgram, DryRunCountsAndStoresNothing) {
  Outcome outcome = cell_.Run(cell_.Arguments("run", {"--dry-run", "--format", "json"}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(Json(outcome)["configurations"], 45);
  EXPECT_GT(Json(outcome)["seconds"], 10);
  EXPECT_GT(Json(outcome)["bytes"], 1000);
  EXPECT_FALSE(std::filesystem::exists(cell_.database()));
  outcome = cell_.Run(cell_.Arguments("run", {"--dry-run"}));
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("45 configurations"), HasSubstr("room on disk"),
                                 HasSubstr("nothing was moved or stored")));
}

TEST_F(CaptureProgram, OutliersAreCapturedAnew) {
  cell_.CaptureAll();
  const auto good = cell_.Content();
  {
    auto database = Database::Open(cell_.database(), Database::Access::kWrite);
    ASSERT_TRUE(database.ok()) << database.status();
    auto writer = (*database)->Write("test");
    RobotImage empty = good.begin()->second;
    for (Mask& mask : empty.masks) mask = Mask(mask.size());
    ASSERT_TRUE(writer->Put(empty, /*replace=*/true).ok());
    ASSERT_TRUE(writer->Commit().ok());
  }
  EXPECT_EQ(cell_.Run(cell_.Arguments("run")).exit_code, 0);
  EXPECT_NE(cell_.Content(), good);
  const Outcome outcome = cell_.Run(cell_.Arguments("run", {"--only", "outliers"}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(cell_.Content(), good);
}

TEST_F(CaptureProgram, RegionAddedLaterIsNotAppliedUnasked) {
  cell_.CaptureAll();
  cell_.WriteCell({{"capture:\n",
                    "capture:\n  forbidden_regions:\n"
                    "    - {name: pillar, joints: {joint_1: [100 deg, 150 deg]}}\n"}});
  ExpectMistake(cell_.Run(cell_.Arguments("run")), "10 configurations that have robot images");
  const Outcome outcome = cell_.Run(cell_.Arguments("run", {"--exclude-captured"}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  uint64_t excluded = 0;
  for (const auto& [number, image] : cell_.Content()) excluded += image.excluded ? 1 : 0;
  EXPECT_EQ(excluded, 10u);
}

TEST_F(CaptureProgram, MissingReferenceImagesAreToldWithTheirCommand) {
  const std::string command =
      absl::StrCat("take them first with: silhouette-capture reference ", "--cell ", cell_.cell(),
                   " --database ", cell_.database());
  ExpectMistake(cell_.Run(cell_.Arguments("run")), command);
  EXPECT_FALSE(std::filesystem::exists(cell_.database()));
  // Neither has a database that was made by other means.
  cell_.TakeReferences();
  const storage::v1::CellDescription description =
      (*Database::Open(cell_.database(), Database::Access::kRead))->cell();
  std::filesystem::remove_all(cell_.database());
  ASSERT_TRUE(Database::Create(cell_.database(), description).ok());
  ExpectMistake(cell_.Run(cell_.Arguments("run")), command);
}

TEST_F(CaptureProgram, DatabaseOfAnotherCellIsRefusedWithTheDifference) {
  cell_.TakeReferences();
  cell_.WriteCell({{"joint_3: 5}", "joint_3: 6}"}});
  for (const char* command : {"reference", "run", "status"}) {
    ExpectMistake(cell_.Run(cell_.Arguments(command)),
                  "joint 'joint_3': steps is 6 in the cell file, 5 in the database");
  }
  cell_.WriteCell({{"capture:\n", "segmentation: {noise_factor: 5}\ncapture:\n"}});
  ExpectMistake(cell_.Run(cell_.Arguments("run")), "noise_factor");
}

TEST_F(CaptureProgram, WrongCellFilesAreToldWithTheirPlace) {
  ExpectMistake(cell_.Run({"run", "--cell", cell_ / "none.yaml"}), "none.yaml");
  cell_.WriteCell({{"views:", "vews:"}});
  ExpectMistake(cell_.Run(cell_.Arguments("run")), "unknown key 'vews'");
  cell_.WriteCell({});
  ExpectMistake(cell_.Run({"run", "--cell", cell_.cell()}), "say where the database is");
}

TEST_F(CaptureProgram, CellWithoutDevicesIsToldWhatToPutWhere) {
  cell_.WriteCell({{"  driver: sim\n", ""}});
  ExpectMistake(cell_.Run(cell_.Arguments("run")), "put 'driver: sim' into 'robot'");
  cell_.WriteCell({{"driver: sim", "driver: staubli"}});
  ExpectMistake(cell_.Run(cell_.Arguments("run")), "known are 'sim', 'manual', 'simple_message");
  cell_.WriteCell({{"name: front, source: sim", "name: front"}});
  ExpectMistake(cell_.Run(cell_.Arguments("run")),
                "the view 'front' has no source of images; put 'source: sim' into it");
  ExpectMistake(cell_.Run(cell_.Arguments("reference")), "the view 'front' has no source");
  cell_.WriteCell({{"name: front, source: sim", "name: front, source: usb"}});
  ExpectMistake(cell_.Run(cell_.Arguments("reference")), "source 'usb'");
  cell_.WriteCell({{"simulation: simulation.yaml\n", ""}});
  ExpectMistake(cell_.Run(cell_.Arguments("reference")), "needs the key 'simulation'");
  cell_.WriteCell({{"name: front", "name: back"}});
  ExpectMistake(cell_.Run(cell_.Arguments("reference")), "no camera for the view 'back'");
}

TEST_F(CaptureProgram, TwoViewsWithTheSameCameraAreAMistake) {
  const auto with = [&](const std::string& top, const std::string& front) {
    cell_.WriteCell({{"name: top, source: sim", "name: top, source: " + top},
                     {"name: front, source: sim", "name: front, source: " + front}});
    return cell_.Run(cell_.Arguments("reference"));
  };
  const std::string same = "the views 'top' and 'front' have the same camera, ";
  ExpectMistake(with("{gige: {serial: abc}}", "{gige: {serial: abc}}"), same + "abc");
  ExpectMistake(with("{rtsp: 'rtsp://127.0.0.1:9/x'}", "{rtsp: 'rtsp://me:secret@127.0.0.1:9/x'}"),
                same + "rtsp://127.0.0.1:9/x");
  ExpectMistake(with("{grpc: {address: 'localhost:1', camera: a}}",
                     "{grpc: {address: 'localhost:1', camera: a}}"),
                same + "'a' of the driver at localhost:1");
  const std::string two_of_a_driver = with("{grpc: {address: 'localhost:1', timeout: 10 ms}}",
                                           "{grpc: {address: 'localhost:1', timeout: 10 ms}}")
                                          .err;
  EXPECT_THAT(two_of_a_driver, Not(HasSubstr("same camera")));
}

TEST_F(CaptureProgram, WrongCommandLinesAreTold) {
  ExpectMistake(cell_.Run({}), "subcommand");
  ExpectMistake(cell_.Run({"run"}), "--cell");
  ExpectMistake(cell_.Run(cell_.Arguments("run", {"--only", "some"})), "--only");
  ExpectMistake(cell_.Run(cell_.Arguments("run", {"--speed", "3"})), "--speed");
  EXPECT_EQ(cell_.Run({"--version"}).exit_code, 0);
  for (const char* command : {"reference", "run", "status"}) {
    const Outcome help = cell_.Run({command, "--help"});
    EXPECT_EQ(help.exit_code, 0);
    EXPECT_THAT(help.out, HasSubstr("Example"));
  }
}

TEST_F(CaptureProgram, ForeignFoldersAreLeftAlone) {
  std::filesystem::create_directories(cell_.database());
  WriteText(cell_.database() + "/letter.txt", "dear reader");
  ExpectMistake(cell_.Run(cell_.Arguments("reference")), "is not empty");
  EXPECT_EQ(ReadText(cell_.database() + "/letter.txt"), "dear reader");
  WriteText(cell_.database() + "/data.mdb", std::string(10000, 'x'));
  ExpectMistake(cell_.Run(cell_.Arguments("run")), "is not a database");
  EXPECT_EQ(ReadText(cell_.database() + "/data.mdb"), std::string(10000, 'x'));
}

TEST_F(CaptureProgram, DatabaseThatAnotherProcessWritesIsRefused) {
  cell_.TakeReferences();
  const auto writer = Database::Open(cell_.database(), Database::Access::kWrite);
  ASSERT_TRUE(writer.ok());
  ExpectMistake(cell_.Run(cell_.Arguments("run")), "another process");
  EXPECT_EQ(cell_.Run(cell_.Arguments("status")).exit_code, 1);
}

TEST_F(CaptureProgram, TruncatedDatabaseIsTheWorldsFault) {
  cell_.CaptureAll();
  std::filesystem::resize_file(cell_.database() + "/data.mdb", 12'000);
  const Outcome outcome = cell_.Run(cell_.Arguments("run"));
  EXPECT_EQ(outcome.exit_code, 3) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("is truncated"));
}

TEST_F(CaptureProgram, FolderWithoutPermissionIsTold) {
  if (geteuid() != 0) GTEST_SKIP() << "needs a second user, thus root";
  if (access(ProgramFolder().c_str(), X_OK) != 0) GTEST_SKIP() << "the program cannot be reached";
  ASSERT_EQ(chmod((cell_ / ".").c_str(), 0755), 0);
  Outcome outcome = cell_.Wait(cell_.Start(cell_.Arguments("reference"), kNobody));
  if (outcome.exit_code == 127) GTEST_SKIP() << "the program cannot be reached by other users";
  ExpectMistake(outcome, "cannot be made");
  cell_.TakeReferences();
  ASSERT_EQ(chmod(cell_.database().c_str(), 0555), 0);
  outcome = cell_.Wait(cell_.Start(cell_.Arguments("run"), kNobody));
  ExpectMistake(outcome, "no permission");
}

// Fills a small disk up to `bytes`.
void Fill(const std::string& disk, uint64_t bytes) {
  struct statvfs stat {};
  ASSERT_EQ(statvfs(disk.c_str(), &stat), 0);
  WriteText(disk + "/filler", std::string(stat.f_bavail * stat.f_bsize - bytes, 'x'));
}

TEST_F(CaptureProgram, FullDiskIsToldAndMendedByGoingOn) {
  const std::string disk = cell_ / "disk";
  std::filesystem::create_directories(disk);
  if (mount("tmpfs", disk.c_str(), "tmpfs", 0, "size=2m") != 0) {
    GTEST_SKIP() << "a tmpfs cannot be mounted here: " << strerror(errno);
  }
  const auto arguments = [&](const std::string& subcommand) {
    return std::vector<std::string>{subcommand, "--cell", cell_.cell(), "--database", disk + "/db"};
  };
  EXPECT_EQ(cell_.Run(arguments("reference")).exit_code, 0);
  Fill(disk, 8'192);
  Outcome outcome = cell_.Run(arguments("run"));
  EXPECT_EQ(outcome.exit_code, 3) << outcome.err;
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("the disk is full"),
                                 HasSubstr("go on with: silhouette-capture run")));
  std::filesystem::remove(disk + "/filler");
  outcome = cell_.Run(arguments("run"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(cell_.Run(arguments("status")).exit_code, 0);
  umount2(disk.c_str(), MNT_DETACH);
}

TEST_F(CaptureProgram, ReferenceWithRobotSaysHowManyImagesItTook) {
  cell_.WriteCell({{"{joint_1: 9, joint_3: 5}", "{joint_1: 4, joint_3: 3}"}});
  const Outcome outcome =
      cell_.Run(cell_.Arguments("reference", {"--with-robot", "--format", "json"}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(Json(outcome)["images"], 12) << "all that the grid has";
}

// The cell of tools/demo without what it sets for speed.
TEST(DemoCell, TakesReferencesWithItsRobotAndIsCapturedByTheDefaults) {
  const std::string folder = SourceFolder() + "/capture/sim/cells/demo/";
  std::string text = ReadText(folder + "cell.yaml");
  const size_t capture = text.find("capture:\n");
  text.erase(capture, text.find("server:\n") - capture);
  const ProgramCell cell;
  WriteText(cell.cell(),
            absl::StrReplaceAll(text, {{": simulation.yaml", ": " + folder + "simulation.yaml"},
                                       {": ../../", ": " + folder + "../../"},
                                       {"max_move: 0.08", "steps: {joint_1: 7, joint_3: 4}"}}));
  Outcome outcome = cell.Run(cell.Arguments("reference", {"--with-robot", "--images", "12"}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  outcome = cell.Run(cell.Arguments("reference"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  outcome = cell.Run(cell.Arguments("run"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_GT(cell.Records(), 5u);
}

// Of the views that have each other's camera models, and of no others.
TEST_F(CaptureProgram, NothingRestsOnACalibrationThatHasTheRobotElsewhereThanImages) {
  cell_.TakeReferences();
  ASSERT_EQ(cell_.Run(cell_.Arguments("run")).exit_code, 0);
  const std::string models = cell_ / "true";
  const auto shell = [](const std::string& command) {
    const std::string whole = ProgramFolder() + "/" + command + " >/dev/null 2>&1";
    ASSERT_EQ(std::system(whole.c_str()), 0) << whole;
  };
  shell("silhouette-sim calibration --cell " + cell_.cell() + " --out " + models);
  shell("silhouette-db calibration import " + cell_.database() + " " + models);
  EXPECT_THAT(cell_.Run(cell_.Arguments("check")).out, Not(HasSubstr("calibration")));

  std::filesystem::rename(models + "/top.cameramodel", models + "/other");
  std::filesystem::rename(models + "/front.cameramodel", models + "/top.cameramodel");
  std::filesystem::rename(models + "/other", models + "/front.cameramodel");
  shell("silhouette-db calibration import --force " + cell_.database() + " " + models);
  const Outcome checked = cell_.Run(cell_.Arguments("check"));
  EXPECT_NE(checked.exit_code, 0);
  EXPECT_THAT(checked.out, HasSubstr("FAULT  calibration: views 'top', 'front': the robot in its "
                                     "captured images is not where calibration and URDF have it"));
  RunningProgram server({ProgramFolder() + "/silhouette-server", "--cell", cell_.cell(),
                         "--database", cell_.database(), "--listen", "127.0.0.1:0"},
                        cell_ / "server.out", cell_ / "server.err");
  EXPECT_THAT(server.Address(), StartsWith("127.0.0.1:"));
  EXPECT_THAT(server.Errors(), HasSubstr("what rests on the calibration is unknown, never free: "
                                         "views 'top', 'front': the robot"));
}

// Nothing is captured with a robot that no camera sees.
TEST_F(CaptureProgram, RobotThatNoViewSeesIsRefusedBeforeAnythingIsStored) {
  cell_.TakeReferences();
  // The cameras look at the floor beside it.
  WriteText(cell_ / "simulation.yaml",
            absl::StrReplaceAll(ReadText(cell_ / "simulation.yaml"),
                                {{"look_at: [0, 0, 1]", "look_at: [5, 5, 0]"}}));
  cell_.TakeReferences();
  const Outcome outcome = cell_.Run(cell_.Arguments("run"));
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("configuration 0: no view sees the robot; check"),
                                 HasSubstr("none of these images was stored"),
                                 Not(HasSubstr("what was captured is stored"))));
  const Outcome again = cell_.Run(cell_.Arguments("run", {"--format", "json"}));
  EXPECT_FALSE(Json(again).contains("next")) << again.out;
  EXPECT_EQ(cell_.Records(), 0u);
}

}  // namespace
}  // namespace silhouette
