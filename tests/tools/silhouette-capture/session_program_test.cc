// SPDX-License-Identifier: Apache-2.0
// silhouette-capture over more than one session: sentinels, remask, report, log.
#include <gmock/gmock.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <regex>

#include "db/store/store.h"
#include "db/store/writer_lock.h"
#include "tests/capture/session/program_cell.h"

namespace silhouette {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

nlohmann::json SessionProgramJson(const std::string& text) {
  return nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
}

const std::pair<std::string, std::string> kKeepImages = {
    "commit_interval: 20 ms", "commit_interval: 20 ms\n  raw_images: all"};
// The same with other settings for masks.
const std::pair<std::string, std::string> kKeepImagesAndHalfCovered = {
    "commit_interval: 20 ms",
    "commit_interval: 20 ms\n  raw_images: all\nsegmentation: {min_cover: 0.5, min_difference: "
    "20}"};

// Cameras without noise that should have some: they are lost as frozen.
const std::vector<std::pair<std::string, std::string>> kNoisy = {
    {"noise: none, ", ""}, {"settle: 5 ms", "settle: 5 ms\n  retry: 10 ms"}};

TEST(CaptureSessions, LogNeverGoesIntoADatabase) {
  ProgramCell cell;
  cell.CaptureAll();
  const std::string data = cell.database() + "/data.mdb";
  const std::string before = ReadText(data);
  const Outcome outcome = cell.Run(cell.Arguments("run", {"--log", data}));
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("is no text file; name another with --log"));
  EXPECT_EQ(ReadText(data), before);
}

TEST(CaptureSessions, CameraThatWasTurnedOvernightIsNamedWithItsPixels) {
  ProgramCell cell;
  cell.CaptureAll();
  Outcome outcome = cell.Run(cell.Arguments("run", {"--only", "sentinels"}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  // The camera looks 10 cm beside what it looked at, 5.2 m away: to its right.
  std::string simulation = ReadText(cell / "simulation.yaml");
  const std::string front = "position: [5.2, 0, 1.3], look_at: [0, 0, 1]";
  ASSERT_NE(simulation.find(front), std::string::npos);
  simulation =
      absl::StrReplaceAll(simulation, {{front, "position: [5.2, 0, 1.3], look_at: [0, 0.1, 1]"}});
  WriteText(cell / "simulation.yaml", simulation);
  const double focal_length = 80 / std::tan(25 * std::numbers::pi / 180);
  // What is x pixels beside the image's middle moves by 1 + x^2 / f^2 times as much.
  const double truth =
      focal_length * 0.1 / 5.2 * (1 + 80 * 80 / 3.0 / (focal_length * focal_length));

  outcome = cell.Run(cell.Arguments("run", {"--only", "sentinels", "--format", "json"}));
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  EXPECT_EQ(SessionProgramJson(outcome.out)["state"], "paused");
  const std::string alarm = SessionProgramJson(outcome.out)["alarm"];
  std::smatch said;
  ASSERT_TRUE(std::regex_search(
      alarm, said, std::regex("view 'front' moved by [0-9.]+ px \\(([0-9.]+) px to the left")))
      << alarm;
  EXPECT_NEAR(std::stod(said[1]), truth, 0.15) << alarm;
  EXPECT_EQ(alarm.find("'top'"), std::string::npos) << alarm;
  EXPECT_THAT(outcome.err, HasSubstr("--only sentinels"));

  const std::string log = ReadText(cell.database() + ".log");
  EXPECT_THAT(log, HasSubstr("session begins: cell 'small'"));
  EXPECT_THAT(log, HasSubstr("session ends; captured 45 of 45 configurations"));
  EXPECT_THAT(log, HasSubstr("the session pauses and the robot stands still: view 'front' moved"));
  EXPECT_THAT(log, HasSubstr("session ends: the control configurations do not show that"));

  // The session left a report, too.
  EXPECT_TRUE(std::filesystem::exists(cell.database() + ".report/report.html"));
  outcome = cell.Run(cell.Arguments("report", {"--out", cell / "report"}));
  EXPECT_EQ(outcome.exit_code, 1) << outcome.out;
  const std::string page = ReadText(cell / "report/report.html");
  EXPECT_THAT(page, HasSubstr("moved by"));
  EXPECT_THAT(page, HasSubstr("data:image/png;base64,"));
  EXPECT_TRUE(std::filesystem::exists(cell / "report/history.png"));
  const nlohmann::json report = SessionProgramJson(ReadText(cell / "report/report.json"));
  EXPECT_THAT(report["alarms"], SizeIs(1));
  EXPECT_EQ(report["captured"], 45);
  EXPECT_EQ(report["sentinel_checks"], 2);
}

TEST(CaptureSessions, SentinelsAreTakenLaterOnRequestAndAreNoGoodCheckBefore) {
  ProgramCell cell;
  cell.WriteCell({{"commit_interval: 20 ms", "commit_interval: 20 ms\n  sentinels: {count: 0}"}});
  cell.CaptureAll();
  cell.WriteCell({});
  Outcome outcome = cell.Run(cell.Arguments("run", {"--only", "sentinels"}));
  EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
  EXPECT_THAT(outcome.err, HasSubstr("silhouette-capture run --new-sentinels"));
  outcome = cell.Run(cell.Arguments("run", {"--new-sentinels", "--format", "json"}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(SessionProgramJson(outcome.out)["captured"], 3);
  outcome = cell.Run(cell.Arguments("run", {"--only", "sentinels", "--format", "json"}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(SessionProgramJson(outcome.out)["sentinel_checks"], 1);
}

TEST(CaptureSessions, WhatIsSuspectIsNamedAndMended) {
  ProgramCell cell;
  cell.WriteCell({{"settle: 5 ms", "settle: 30 ms"}});
  cell.TakeReferences();
  const pid_t run = cell.Start(cell.Arguments("run"));
  for (int i = 0; i < 3000 && cell.Records() < 8; ++i) absl::SleepFor(absl::Milliseconds(5));
  kill(run, SIGKILL);
  cell.Wait(run);
  const uint64_t before = cell.Records();
  ASSERT_LT(before, 45u);
  const std::string simulation = ReadText(cell / "simulation.yaml");
  WriteText(cell / "simulation.yaml",
            absl::StrReplaceAll(simulation, {{"[5.2, 0, 1.3], look_at: [0, 0, 1]",
                                              "[5.2, 0, 1.3], look_at: [0, 0, 1.2]"}}));
  Outcome outcome = cell.Run(cell.Arguments("run"));
  EXPECT_EQ(outcome.exit_code, 1) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("view 'front' moved by"));
  EXPECT_THAT(outcome.err, HasSubstr("--only suspect"));
  EXPECT_EQ(cell.Records(), before);
  outcome = cell.Run(cell.Arguments("status", {"--format", "json"}));
  // All but the sentinels, which were captured first.
  EXPECT_EQ(SessionProgramJson(outcome.out)["suspect"], before - 3);
  // The camera is put back.
  WriteText(cell / "simulation.yaml", simulation);
  outcome = cell.Run(cell.Arguments("run", {"--only", "suspect", "--format", "json"}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(SessionProgramJson(outcome.out)["captured"], 45 - 3);
  outcome = cell.Run(cell.Arguments("report", {"--out", cell / "report", "--format", "json"}));
  EXPECT_EQ(outcome.exit_code, SessionProgramJson(outcome.out)["repair"].empty() ? 0 : 1);
  EXPECT_THAT(SessionProgramJson(outcome.out)["suspect"], IsEmpty());
}

TEST(CaptureSessions, RemaskedHoldsWhatACaptureWithTheSameSettingsHolds) {
  ProgramCell other;
  other.WriteCell({kKeepImagesAndHalfCovered});
  other.CaptureAll();
  ProgramCell cell;
  cell.WriteCell({kKeepImages});
  cell.CaptureAll();
  const auto before = cell.Content();
  ASSERT_NE(before, other.Content());
  cell.WriteCell({kKeepImagesAndHalfCovered});

  // Into another database, from which everything else stays away, and which deletes nothing else.
  const std::string part = cell / "other.lmdb.part";
  std::filesystem::create_directory(part);
  std::ofstream(part + "/notes.txt") << "mine";
  Outcome outcome = cell.Run(cell.Arguments("remask", {"--into", cell / "other.lmdb/"}));
  EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
  EXPECT_TRUE(std::filesystem::exists(part + "/notes.txt"));
  std::filesystem::remove_all(part);
  outcome = cell.Run(cell.Arguments("remask", {"--into", cell / "other.lmdb/"}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(cell.Content(), before);
  EXPECT_FALSE(std::filesystem::exists(cell / "other.lmdb.part"));
  outcome = cell.Run({"status", "--cell", cell.cell(), "--database", cell / "other.lmdb"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out << outcome.err;

  // In its place.
  outcome = cell.Run(cell.Arguments("remask", {"--format", "json"}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(cell.Content(), other.Content());
  const nlohmann::json report = SessionProgramJson(outcome.out);
  EXPECT_EQ(report["configurations"], 45);
  int64_t change = 0;
  for (const auto& [number, image] : before) {
    change += static_cast<int64_t>(other.Content().at(number).masks[1].Count()) -
              static_cast<int64_t>(image.masks[1].Count());
  }
  EXPECT_EQ(report["views"][1]["pixels_added"].get<int64_t>() -
                report["views"][1]["pixels_removed"].get<int64_t>(),
            change);
  // It belongs to the cell file now; a capture has nothing to do.
  EXPECT_EQ(cell.Run(cell.Arguments("run")).exit_code, 0);
  EXPECT_EQ(cell.RawImages(), 45u);
}

TEST(CaptureSessions, RemaskedIntoAnotherDatabaseKeepsTheCalibration) {
  ProgramCell cell;
  cell.WriteCell({kKeepImages});
  cell.CaptureAll();
  for (const std::string& command :
       {"silhouette-sim calibration --cell " + cell.cell() + " --out " + cell / "true",
        "silhouette-db calibration import " + cell.database() + " " + cell / "true"}) {
    const std::string whole = ProgramFolder() + "/" + command + " >/dev/null 2>&1";
    ASSERT_EQ(std::system(whole.c_str()), 0) << whole;
  }
  const std::string into = cell / "other.lmdb";
  const Outcome outcome = cell.Run(cell.Arguments("remask", {"--into", into}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto calibration_in = [](const std::string& folder) {
    const auto database = Database::Open(folder, Database::Access::kRead);
    return (*database)->Read()->Calibration().value();
  };
  ASSERT_TRUE(calibration_in(into).has_value());
  EXPECT_EQ(calibration_in(into)->SerializeAsString(),
            calibration_in(cell.database())->SerializeAsString());
}

TEST(CaptureSessions, CameraWhoseImagesRepeatIsLostUnlessTheCellSaysThatItHasNoNoise) {
  ProgramCell cell;
  cell.TakeReferences();
  cell.WriteCell(kNoisy);
  for (const char* subcommand : {"reference", "run"}) {
    const Outcome outcome = cell.Run(cell.Arguments(subcommand));
    EXPECT_EQ(outcome.exit_code, 3) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("the camera of the view 'top' is frozen"));
    EXPECT_THAT(outcome.err, HasSubstr("state 'noise: none' at its view in the cell file"));
  }
  EXPECT_EQ(cell.Records(), 0u);
}

TEST(CaptureSessions, NewSentinelsThatAreNotCapturedYetAreAskedForAgain) {
  ProgramCell cell;
  cell.CaptureAll();
  cell.WriteCell(kNoisy);
  const Outcome outcome = cell.Run(cell.Arguments("run", {"--new-sentinels"}));
  EXPECT_EQ(outcome.exit_code, 3) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("go on with: silhouette-capture run --cell " + cell.cell() +
                                     " --database " + cell.database() + " --new-sentinels\n"));
}

// A part that the simulated robot carries in the variant `with-part`.
void AddPart(const ProgramCell& cell) {
  WriteText(
      cell / "simulation.yaml",
      ReadText(cell / "simulation.yaml") +
          "parts:\n"
          "  with-part: [{link: tool, box: {size: [0.4, 0.2, 0.2]}, position: [0, 0, 0.2]}]\n");
}

TEST(CaptureSessions, AllVariantsAreRemaskedAndReported) {
  ProgramCell other;
  ProgramCell cell;
  for (const auto& [each, keep] :
       {std::pair(&other, kKeepImagesAndHalfCovered), std::pair(&cell, kKeepImages)}) {
    AddPart(*each);
    each->WriteCell({keep});
    each->CaptureAll();
    const Outcome outcome = each->Run(each->Arguments("run", {"--variant", "with-part"}));
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  }
  const auto before = cell.Content("with-part");
  ASSERT_NE(before, cell.Content());
  ASSERT_NE(before, other.Content("with-part"));

  Outcome outcome =
      cell.Run(cell.Arguments("report", {"--variant", "with-part", "--format", "json"}));
  EXPECT_EQ(outcome.exit_code, SessionProgramJson(outcome.out)["repair"].empty() ? 0 : 1)
      << outcome.err;
  EXPECT_EQ(SessionProgramJson(outcome.out)["variant"], "with-part");
  EXPECT_THAT(SessionProgramJson(outcome.out)["variants"], SizeIs(2));
  EXPECT_EQ(SessionProgramJson(outcome.out)["variants"][1]["captured"], 45);
  const std::string page = ReadText(cell.database() + ".with-part.report/report.html");
  EXPECT_THAT(page, HasSubstr("Variants"));
  EXPECT_NE(page, ReadText(cell.database() + ".report/report.html"));

  cell.WriteCell({kKeepImagesAndHalfCovered});
  const std::string into = cell / "other.lmdb";
  outcome = cell.Run(cell.Arguments("remask", {"--into", into}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(cell.Content("with-part"), before);
  outcome =
      cell.Run({"status", "--cell", cell.cell(), "--database", into, "--variant", "with-part"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out << outcome.err;
  outcome = cell.Run(cell.Arguments("remask", {"--format", "json"}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(cell.Content(), other.Content());
  EXPECT_EQ(cell.Content("with-part"), other.Content("with-part"));
  EXPECT_EQ(SessionProgramJson(outcome.out)["configurations"], 90);
  EXPECT_EQ(SessionProgramJson(outcome.out)["variants"][1]["name"], "with-part");
  EXPECT_FALSE(std::filesystem::exists(cell.database() + ".remask"));
}

TEST(CaptureSessions, RemaskThatIsKilledLeavesTheDatabaseAsItWasAndCanBeBegunAgain) {
  ProgramCell cell;
  cell.WriteCell({kKeepImages});
  cell.CaptureAll();
  const auto before = cell.Content();
  cell.WriteCell({kKeepImagesAndHalfCovered});
  const pid_t remask = cell.Start(cell.Arguments("remask"));
  while (!std::filesystem::exists(cell.database() + ".remask/data.mdb")) {
    absl::SleepFor(absl::Milliseconds(1));
  }
  kill(remask, SIGKILL);
  cell.Wait(remask);
  ASSERT_EQ(cell.Content(), before);
  const Outcome outcome = cell.Run(cell.Arguments("remask"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(cell.Content(), before);
  EXPECT_FALSE(std::filesystem::exists(cell.database() + ".remask"));
}

TEST(CaptureSessions, RemaskLeavesTheDatabaseThatAnotherRemaskIsWriting) {
  ProgramCell cell;
  cell.WriteCell({kKeepImages});
  cell.CaptureAll();
  const std::string part = cell / "other.lmdb.part";
  auto other = Database::Create(
      part, Database::Open(cell.database(), Database::Access::kRead).value()->cell());
  ASSERT_TRUE(other.ok()) << other.status();
  const std::vector<std::string> remask = cell.Arguments("remask", {"--into", cell / "other.lmdb"});
  Outcome outcome = cell.Run(remask);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("is writing to it; end that first"));
  EXPECT_TRUE(std::filesystem::exists(part + "/data.mdb"));
  other->reset();
  outcome = cell.Run(remask);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
}

TEST(CaptureSessions, RemaskIntoAnotherDatabaseIsRefusedWhileASessionWrites) {
  ProgramCell cell;
  cell.WriteCell({kKeepImages});
  cell.CaptureAll();
  auto session = Database::Open(cell.database(), Database::Access::kWrite);
  ASSERT_TRUE(session.ok()) << session.status();
  const std::vector<std::string> remask = cell.Arguments("remask", {"--into", cell / "other.lmdb"});
  Outcome outcome = cell.Run(remask);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("is writing to it; end that first"));
  EXPECT_FALSE(std::filesystem::exists(cell / "other.lmdb"));
  session->reset();
  // As a server without permission to register itself: it only reads.
  const auto reader = WriterLock::KeepWritersOut(cell.database(), "");
  ASSERT_TRUE(reader.ok()) << reader.status();
  outcome = cell.Run(remask);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  close(*reader);
}

TEST(CaptureSessions, MasksWithoutImagesCannotBeMadeAnew) {
  ProgramCell cell;
  cell.CaptureAll();
  const auto before = cell.Content();
  cell.WriteCell({kKeepImagesAndHalfCovered});
  const Outcome outcome = cell.Run(cell.Arguments("remask"));
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("42 of 45 robot images have no raw images"));
  EXPECT_THAT(outcome.err, HasSubstr("raw_images: all"));
  EXPECT_EQ(cell.Content(), before);
}

TEST(CaptureSessions, DryRunTellsTheRoomForImagesAndWhenItEnds) {
  ProgramCell cell;
  cell.WriteCell({kKeepImages});
  cell.TakeReferences();
  const Outcome dry = cell.Run(cell.Arguments("run", {"--dry-run", "--format", "json"}));
  EXPECT_EQ(dry.exit_code, 0) << dry.err;
  const double estimate = SessionProgramJson(dry.out)["raw_image_bytes"];
  EXPECT_TRUE(SessionProgramJson(dry.out)["fits_on_disk"]);
  EXPECT_THAT(cell.Run(cell.Arguments("run", {"--dry-run"})).out, HasSubstr("done about"));
  EXPECT_EQ(cell.Run(cell.Arguments("run")).exit_code, 0);
  const auto database = Database::Open(cell.database(), Database::Access::kRead);
  const auto truth = static_cast<double>((*database)->GetUsage()->raw_image_bytes);
  EXPECT_GT(estimate, 0.4 * truth);
  EXPECT_LT(estimate, 1.5 * truth);
}

}  // namespace
}  // namespace silhouette
