// SPDX-License-Identifier: Apache-2.0
// silhouette-db as a user runs it: what it prints, what it writes, how it ends.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "common/picture/files.h"
#include "db/index/tile_index.h"
#include "db/store/environment.h"
#include "db/store/robot_image_format.h"
#include "db/store/schema.h"
#include "db/store/shards.h"
#include "db/store/tile_value.h"
#include "tests/db/store/raw_values.h"
#include "tests/db/store/test_cell.h"
#include "tests/tools/silhouette-db/database_program.h"

namespace silhouette {
namespace {

using Json = nlohmann::json;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

TEST_F(SilhouetteDb, InfoTellsWhatADatabaseHolds) {
  MakeDatabase("db", 0, {3});
  const Ended text = Run("info db");
  EXPECT_EQ(text.exit_code, 0);
  EXPECT_THAT(text.out, AllOf(HasSubstr("test cell"), HasSubstr("29 of 30"), HasSubstr("axis_2"),
                              HasSubstr("axis_3"), HasSubstr("33x20")));
  const Json info = Json::parse(Run("info --database db --format json").out);
  EXPECT_EQ(info["records"], 29);
  EXPECT_EQ(info["configurations"], 30);
  EXPECT_EQ(info["views"][1]["mask_size"], Json::parse("[33, 20]"));
  EXPECT_EQ(info["fixed_joints"]["axis_3"], 0.25);
  EXPECT_EQ(info["references"], true);
}

TEST_F(SilhouetteDb, VerifyTellsSuspectRobotImagesAndExportLeavesThemOut) {
  MakeDatabase("db");
  {
    const auto database = Database::Open(folder_ / "db", Database::Access::kWrite);
    auto writer = (*database)->Write("test");
    RobotImage image = TestImage(**database, NumberAt(2, 1));
    image.excluded = false;
    image.masks = {OnePixel({64, 64}), Mask({33, 20})};
    image.captured = absl::FromUnixSeconds(15);
    ASSERT_TRUE(writer->Put(image, /*replace=*/true).ok());
    ASSERT_TRUE(writer->Commit().ok());
    storage::v1::CaptureHistory history;
    storage::v1::SuspectSpan& span = *history.add_suspects();
    span.mutable_after()->set_seconds(14);
    span.mutable_until()->set_seconds(15);
    ASSERT_TRUE((*database)->SetCaptureHistory(history).ok());
  }
  const Ended text = Run("verify db");
  EXPECT_EQ(text.exit_code, 1);
  EXPECT_THAT(text.out, HasSubstr("1 robot images were captured while the cell may have changed"));
  EXPECT_EQ(Json::parse(Run("verify db --format json").out)["suspect"], 1);
  const Ended exported = Run("export db out --format json");
  EXPECT_EQ(exported.exit_code, 1);
  EXPECT_EQ(Json::parse(exported.out)["suspect"], 1);
  EXPECT_EQ(Json::parse(exported.out)["exported"], 29);
  EXPECT_THAT(Read("out/configurations.csv"), Not(HasSubstr("1970-01-01T00:00:15")));
}

TEST_F(SilhouetteDb, VerifyTellsRobotImagesCapturedWithAFixedJointElsewhere) {
  MakeDatabase("db");
  EXPECT_EQ(Run("verify db").exit_code, 0);
  {
    const auto database = Database::Open(folder_ / "db", Database::Access::kWrite);
    auto writer = (*database)->Write("test");
    for (const double position : {0.26, 0.2501}) {
      const ConfigurationNumber number = NumberAt(2, position > 0.255 ? 1 : 2);
      RobotImage image = TestImage(**database, number);
      image.excluded = false;
      image.masks = {OnePixel({64, 64}), Mask({33, 20})};
      image.measured = {0, 0, position};
      image.commanded = {0, 0, 0.25};
      ASSERT_TRUE(writer->Put(image, /*replace=*/true).ok());
    }
    ASSERT_TRUE(writer->Commit().ok());
  }
  const Ended text = Run("verify db");
  EXPECT_EQ(text.exit_code, 1);
  EXPECT_THAT(text.out,
              AllOf(HasSubstr("1 robot images were captured with a fixed joint elsewhere, the "
                              "first with joint 'axis_3' at 0.26 instead of 0.25"),
                    HasSubstr(absl::StrCat("--only ", NumberAt(2, 1), "\n")),
                    HasSubstr("fixed joint 'axis_3': captured at 0.25 to 0.26\n")));
  const Json found = Json::parse(Run("verify db --format json").out);
  EXPECT_EQ(found["elsewhere"], 1);
  EXPECT_EQ(found["variants"][0]["fixed_joints"]["axis_3"]["highest"], 0.26);
  EXPECT_EQ(Run("verify db --fixed-joint-tolerance 0.02").exit_code, 0);
}

TEST_F(SilhouetteDb, VerifyTellsRobotImagesThatShowNoRobot) {
  MakeDatabase("db");
  {
    const auto database = Database::Open(folder_ / "db", Database::Access::kWrite);
    auto writer = (*database)->Write("test");
    RobotImage image = TestImage(**database, NumberAt(2, 1));
    image.excluded = false;
    image.masks = {Mask({64, 64}), Mask({33, 20})};
    ASSERT_TRUE(writer->Put(image, /*replace=*/true).ok());
    ASSERT_TRUE(writer->Commit().ok());
  }
  const Ended text = Run("verify db");
  EXPECT_EQ(text.exit_code, 1);
  EXPECT_THAT(text.out, HasSubstr("without a pixel of the robot in any view, which no obstacle can "
                                  "meet: 1, the first at axis_1 = "));
}

TEST_F(SilhouetteDb, VerifyTellsViewsThatNeverShowTheRobot) {
  MakeDatabase("db");
  {
    const auto database = Database::Open(folder_ / "db", Database::Access::kWrite);
    auto writer = (*database)->Write("test");
    const ConfigurationGrid& grid = (*database)->grid();
    for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
      if (!grid.Contains(number)) continue;
      RobotImage image = TestImage(**database, number);
      image.excluded = false;
      image.masks = {
          Mask::FromPredicate({64, 64}, [&](int x, int) { return x == static_cast<int>(number); }),
          Mask({33, 20})};
      ASSERT_TRUE(writer->Put(image, /*replace=*/true).ok());
    }
    ASSERT_TRUE(writer->Commit().ok());
  }
  const Ended text = Run("verify db");
  EXPECT_EQ(text.exit_code, 1);
  EXPECT_THAT(text.out, HasSubstr("shows no robot in any of "));
}

TEST_F(SilhouetteDb, IndexIsBuiltToldAndVerified) {
  MakeDatabase("db");
  EXPECT_THAT(Run("info db").out,
              HasSubstr("collision index none; build it with: silhouette-db index db\n"));
  EXPECT_EQ(Json::parse(Run("info db --format json").out)["collision_index"]["state"], "none");
  EXPECT_EQ(Run("verify db").exit_code, 0);

  const Ended built = Run("index db");
  EXPECT_EQ(built.exit_code, 0) << built.err;
  EXPECT_THAT(built.out, AllOf(HasSubstr("1 built, 0 fresh already"), HasSubstr("% of their")));
  EXPECT_THAT(Run("info db").out, HasSubstr("collision index fresh, 1 tile"));
  const Json again = Json::parse(Run("index db --format json").out);
  EXPECT_EQ(again["built"], 0);
  EXPECT_EQ(again["fresh_already"], 1);
  EXPECT_EQ(again["complete"], true);
  EXPECT_EQ(Json::parse(Run("index db --all --format json").out)["built"], 1);
  const Json verified = Json::parse(Run("verify db --format json").out);
  EXPECT_EQ(verified["ok"], true);
  EXPECT_EQ(verified["collision_index"]["state"], "fresh");
  EXPECT_EQ(verified["collision_index"]["fresh"], 1);

  // A new record makes it stale, which is no fault of the database's.
  {
    const auto database = Database::Open(folder_ / "db", Database::Access::kWrite);
    auto writer = (*database)->Write("test");
    ASSERT_TRUE(writer->Put(TestImage(**database, NumberAt(2, 2), 5), true).ok());
    ASSERT_TRUE(writer->Commit().ok());
  }
  const Ended stale = Run("verify db");
  EXPECT_EQ(stale.exit_code, 0);
  EXPECT_THAT(stale.out, HasSubstr("of 1 tile 1 stale; build them with: silhouette-db index db"));
  EXPECT_EQ(Json::parse(Run("info db --format json").out)["collision_index"]["state"], "stale");

  EXPECT_EQ(Run("index nowhere").exit_code, 2);
  EXPECT_THAT(Run("index --help").out, HasSubstr("Example:"));
}

TEST_F(SilhouetteDb, IndexThatIsDamagedOrNotThatOfItsRobotImagesIsFoundByVerify) {
  MakeDatabase("db");
  const auto spoil = [&](const auto& change) {
    EXPECT_EQ(Run("index db --all").exit_code, 0);
    PutRaw(folder_ / "db", schema::kCollisionIndex, 0, 0, change);
  };
  spoil([](std::string value) {
    value.back() = 'x';
    return value;
  });
  const Ended damaged = Run("verify db");
  EXPECT_EQ(damaged.exit_code, 1);
  EXPECT_THAT(damaged.out, HasSubstr("the collision index of 1 tile is damaged"));
  EXPECT_THAT(Run("info db").out, HasSubstr("of 1 tile 1 damaged; build them with"));

  // What a faulty program could have written: sound in itself, but of other robot images.
  spoil([&](const std::string& value) {
    std::vector<PixelTree> trees = {PixelTree({64, 64}), PixelTree({33, 20})};
    return EncodeTileValue(0, *TileHeaderIn(value), TileIndexBuilder(trees).Finish(), 4096);
  });
  EXPECT_THAT(Run("info db").out, HasSubstr("collision index fresh"));
  const Ended wrong = Run("verify db");
  EXPECT_EQ(wrong.exit_code, 1);
  EXPECT_THAT(wrong.out,
              HasSubstr("the collision index of tile 0 is not that of its robot images"));
}

TEST_F(SilhouetteDb, VerifyIsContentWithACompleteDatabase) {
  MakeDatabase("db");
  const Ended outcome = Run("verify db");
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("0 damaged, 0 missing: sound")));
}

TEST_F(SilhouetteDb, VerifyMissesNoRobotImagesThatAreDrawnWhenServed) {
  const std::string path = folder_ / "db";
  const auto database = Database::Create(path, TestCell(6, 5)).value();
  EXPECT_THAT(Run("verify db").out, HasSubstr("there are no robot images"));
  ASSERT_TRUE(database->SetVerification(storage::v1::ModelVerification(), "test").ok());
  const Ended drawn = Run("verify db");
  EXPECT_EQ(drawn.exit_code, 0) << drawn.out;
  EXPECT_THAT(drawn.out, HasSubstr("0 missing: sound"));
  // A captured one of them is the first of all.
  auto writer = database->Write("test");
  ASSERT_TRUE(writer->Put(TestImage(*database, 0)).ok());
  ASSERT_TRUE(writer->Commit().ok());
  EXPECT_THAT(Run("verify db").out, HasSubstr("29 of 30 configurations are missing"));
}

TEST_F(SilhouetteDb, VerifyMissesOfAShardOnlyItsOwnConfigurations) {
  const auto database = Database::Create(folder_ / "db", TestCell(90, 130)).value();
  storage::v1::DrawnImages shard;
  shard.set_digest("00ff");
  shard.set_shards(2);
  shard.set_shard(1);
  ASSERT_TRUE(database->SetDrawnImages(shard, "test").ok());
  auto writer = database->Write("test");
  for (const ConfigurationNumber number : AllNumbers(database->grid())) {
    if (!HasTile(shard, number / kTileSize)) continue;
    RobotImage image;
    image.number = number;
    image.excluded = true;
    ASSERT_TRUE(writer->Put(image).ok());
  }
  ASSERT_TRUE(writer->Commit().ok());
  const Ended outcome = Run("verify db");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out;
  EXPECT_THAT(outcome.out, HasSubstr("0 missing: sound"));
}

TEST_F(SilhouetteDb, VerifyCountsNoRecordsOfOtherShards) {
  const auto database = Database::Create(folder_ / "db", TestCell(90, 130)).value();
  storage::v1::DrawnImages shard;
  shard.set_digest("00ff");
  shard.set_shards(2);
  shard.set_shard(1);
  ASSERT_TRUE(database->SetDrawnImages(shard, "test").ok());
  auto writer = database->Write("test");
  uint64_t foreign = 0;
  uint64_t own = 0;
  for (const ConfigurationNumber number : AllNumbers(database->grid())) {
    // Ten of its own are left out, and ten of the other shard are there.
    uint64_t& count = HasTile(shard, number / kTileSize) ? own : foreign;
    if ((++count <= 10) == (&count == &own)) continue;
    RobotImage image;
    image.number = number;
    image.excluded = true;
    ASSERT_TRUE(writer->Put(image).ok());
  }
  ASSERT_TRUE(writer->Commit().ok());
  const Ended outcome = Run("verify db");
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.out,
              AllOf(HasSubstr(absl::StrCat("10 of ", own, " configurations are missing")),
                    HasSubstr("10 records are of tiles of other shards than this one, 1 of 2")));
}

TEST_F(SilhouetteDb, VerifyTellsEachFaultInALine) {
  MakeDatabase("db", 0, {3, 7});
  Ended outcome = Run("verify db");
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_THAT(outcome.out, HasSubstr("2 of 30 configurations are missing, the first are "));
  EXPECT_EQ(Run("verify --allow-missing db").exit_code, 0);

  // Damage one record wherever it lies in the file.
  std::string bytes = Read("db/data.mdb");
  ConfigurationNumber victim = 0;
  {
    const auto database = Database::Open(folder_ / "db", Database::Access::kRead);
    while (TestImage(**database, victim).excluded) ++victim;
    const std::string value = EncodeRobotImage(TestImage(**database, victim));
    size_t damaged = 0;
    for (size_t at = bytes.find(value); at != std::string::npos; at = bytes.find(value, at + 1)) {
      bytes[at + 30] = static_cast<char>(bytes[at + 30] ^ 1);
      ++damaged;
    }
    ASSERT_GT(damaged, 0);
  }
  Write("db/data.mdb", bytes);
  outcome = Run("verify db --format json");
  EXPECT_EQ(outcome.exit_code, 1);
  const Json findings = Json::parse(outcome.out);
  EXPECT_EQ(findings["damaged"], 1);
  EXPECT_EQ(findings["ok"], false);
  ASSERT_EQ(findings["faults"].size(), 2);
  EXPECT_THAT(findings["faults"][0].get<std::string>(),
              HasSubstr(absl::StrCat("robot image ", victim, ": its checksum does not hold")));
  EXPECT_EQ(Run(absl::StrCat("show db --number ", victim)).exit_code, 3);
  EXPECT_EQ(Run("export db out").exit_code, 1);
  EXPECT_EQ(Json::parse(Run("stats db --format json").out)["damaged"], 1);
}

TEST_F(SilhouetteDb, CoverageCountsAndPaints) {
  MakeDatabase("db", 0, {3, 7});
  const Ended outcome = Run("coverage db --format json --picture coverage.png");
  EXPECT_EQ(outcome.exit_code, 0);
  const Json counts = Json::parse(outcome.out);
  EXPECT_EQ(counts["missing"], 2);
  EXPECT_EQ(counts["captured"].get<int>() + counts["excluded"].get<int>(), 28);
  EXPECT_FALSE(cv::imread(folder_ / "coverage.png").empty());
}

TEST_F(SilhouetteDb, CoverageOfALargeGridNeedsNoMemoryForWhatIsMissing) {
  const int steps = 1 << 20;
  {
    const auto database = Database::Create(folder_ / "db", TestCell(steps, steps)).value();
    auto writer = database->Write("test");
    RobotImage image;
    image.number = database->grid().NumberOf({steps / 2, steps / 2});
    image.excluded = true;
    ASSERT_TRUE(writer->Put(image).ok());
    ASSERT_TRUE(writer->Commit().ok());
  }
  const Ended outcome = Run("coverage db --format json");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const Json counts = Json::parse(outcome.out);
  EXPECT_EQ(counts["excluded"], 1);
  EXPECT_EQ(counts["missing"], (uint64_t{1} << 40) - 1);
}

TEST_F(SilhouetteDb, ShowFindsAConfigurationByNumberAndByJoints) {
  MakeDatabase("db", 0, {0});
  const ConfigurationNumber number = NumberAt(2, 3);
  const Ended by_joints = Run("show db --at 0.05 0.9 --format json --picture masks.png");
  EXPECT_EQ(by_joints.exit_code, 0) << by_joints.err;
  const Json record = Json::parse(by_joints.out);
  EXPECT_EQ(record["number"], number);
  EXPECT_EQ(Run(absl::StrCat("show db --format json --number ", number)).out, by_joints.out);
  EXPECT_EQ(Run(absl::StrCat("show db --format json ", number)).out, by_joints.out);
  EXPECT_EQ(Run("show db --at 2.9deg,51deg --format json").out, by_joints.out);
  const Ended missing = Run("show db --number 0");
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_THAT(missing.err, HasSubstr("is not in the database"));
  EXPECT_THAT(Run("show db --at 0.05 9").err, HasSubstr("(0.05, 9) is outside the grid"));
  EXPECT_THAT(Run("show db --at 0.05").err, HasSubstr("--at takes 2 values"));
  EXPECT_EQ(Run("show db").exit_code, 2);
  const Ended beyond = Run("show db 4095");
  EXPECT_EQ(beyond.exit_code, 2);
  EXPECT_THAT(beyond.err,
              HasSubstr("the grid has no configuration 4095; it has 30, numbered below"));
  EXPECT_THAT(Run("show db --number -1").err, HasSubstr("'-1' is less than 0"));
  EXPECT_THAT(Run("show db --at nan 0").err, HasSubstr("'nan' is no joint value; 0.5, -30deg"));
}

TEST_F(SilhouetteDb, SheetPaintsASlice) {
  MakeDatabase("db");
  EXPECT_EQ(Run("sheet db --picture both.png").exit_code, 0);
  EXPECT_EQ(Run("sheet db --along axis_2 --fix axis_1=0.5 --picture one.png").exit_code, 0);
  EXPECT_FALSE(cv::imread(folder_ / "both.png").empty());
  EXPECT_FALSE(cv::imread(folder_ / "one.png").empty());
  const auto refusal = [&](const std::string& options) {
    const Ended outcome = Run("sheet db --picture sheet.png " + options);
    EXPECT_EQ(outcome.exit_code, 2);
    return outcome.err;
  };
  EXPECT_THAT(refusal("--along axis_9"), HasSubstr("no joint 'axis_9'; its joints are axis_1"));
  EXPECT_THAT(refusal("--along axis_1 axis_1"), HasSubstr("'axis_1' is named twice"));
  EXPECT_THAT(refusal("--along axis_1 --fix axis_2=7"), HasSubstr("7 is not within -1 to 1.5"));
  EXPECT_THAT(refusal("--along axis_1 --fix axis_1=0"), HasSubstr("cannot be fixed"));
  EXPECT_THAT(refusal("--view bottom"), HasSubstr("no view 'bottom'; the views are left, top"));
}

TEST_F(SilhouetteDb, StatsListsOutliersByNumber) {
  const auto database = *Database::Create(folder_ / "db", TestCell(6, 5));
  {
    auto writer = database->Write("test");
    for (ConfigurationNumber number : AllNumbers(database->grid())) {
      RobotImage image;
      image.number = number;
      for (MaskSize size : database->mask_sizes()) {
        image.masks.push_back(Mask::FromPredicate(
            size, [](int x, int y) { return 5 < x && x < 15 && 5 < y && y < 15; }));
      }
      if (number == NumberAt(2, 2)) image.masks[1] = Mask(image.masks[1].size());
      ASSERT_TRUE(writer->Put(image).ok());
    }
    ASSERT_TRUE(writer->Commit().ok());
  }
  const Json stats = Json::parse(Run("stats db --format json --picture covered.png").out);
  ASSERT_EQ(stats["outliers"].size(), 1);
  EXPECT_EQ(stats["outliers"][0]["number"], NumberAt(2, 2));
  EXPECT_EQ(stats["outliers"][0]["reason"], "empty");
  EXPECT_EQ(stats["outliers"][0]["view"], "top");
  EXPECT_EQ(stats["views"][0]["permanent_pixels"], 81);
  EXPECT_THAT(Run("stats db").out, HasSubstr("outliers  1"));
}

TEST_F(SilhouetteDb, NameThatIsTooLongForAFileIsTheUsersMistake) {
  const std::string name(256, 'x');
  Write("cell.yaml", kTestCellFile);
  for (const std::string& command :
       {"info " + name, "import --cell cell.yaml --database db " + name}) {
    const Ended ended = Run(command);
    EXPECT_EQ(ended.exit_code, 2) << command;
    EXPECT_THAT(ended.err, HasSubstr("shorten it to 255 characters"));
    EXPECT_EQ(std::ranges::count(ended.err, '\n'), 1) << ended.err;
  }
}

TEST_F(SilhouetteDb, CommandsThatItPrintsCanBePastedIntoAShell) {
  MakeDatabase("from");
  Write("cell.yaml", kTestCellFile);
  ASSERT_EQ(Run("export from out").exit_code, 0);
  EXPECT_THAT(Run("import out --cell cell.yaml --database \"my cell's\"").out,
              HasSubstr("next: silhouette-db index 'my cell'\\''s'\n"));
  EXPECT_THAT(Run("info \"my cell's\"").out,
              HasSubstr("build it with: silhouette-db index 'my cell'\\''s'\n"));
}

TEST_F(SilhouetteDb, WhatIsPrintedToAClosedStreamIsWrittenIntoNoFile) {
  MakeDatabase("from");
  ASSERT_EQ(Run("export from out").exit_code, 0);
  Write("cell.yaml", kTestCellFile);
  EXPECT_EQ(Run("import out --cell cell.yaml --database db <&- >&- 2>&-").exit_code, 3)
      << "the output is lost";
  EXPECT_THAT(ContentOf(folder_ / "db/writer.lock"), Not(HasSubstr("import")));
  EXPECT_EQ(Run("verify db --allow-missing").exit_code, 0);
}

TEST_F(SilhouetteDb, VerifyCallsADatabaseWithoutRobotImagesEmpty) {
  ASSERT_TRUE(Database::Create(folder_ / "db", TestCell(6, 5)).ok());
  const Ended text = Run("verify db");
  EXPECT_EQ(text.exit_code, 1);
  EXPECT_THAT(text.out, AllOf(HasSubstr("there are no robot images: capture them"),
                              HasSubstr("30 missing: empty\n"), Not(HasSubstr("sound"))));
}

TEST_F(SilhouetteDb, ACopyAboveTheLargestFileIsAnError) {
  MakeDatabase("db");
  const Shell shell;
  const Ended outcome = shell.Run("ulimit -f 16; " + ProgramFolder() + "/silhouette-db compact '" +
                                  (folder_ / "db").string() + "' small");
  EXPECT_EQ(outcome.exit_code, 3) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("larger than 'ulimit -f' permits"));
}

TEST_F(SilhouetteDb, ADatabaseAboveTheLargestFileIsAnErrorThatNamesTheLimit) {
  MakeDatabase("db");
  Write("cell.yaml", kTestCellFile);
  EXPECT_EQ(Run("export db out").exit_code, 0);
  const Shell shell;
  const Ended outcome =
      shell.Run("cd '" + folder_.string() + "' && ulimit -f 40 && " + ProgramFolder() +
                "/silhouette-db import out --cell cell.yaml --database other");
  EXPECT_EQ(outcome.exit_code, 3) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("larger than 'ulimit -f' permits"));
}

TEST_F(SilhouetteDb, CompactCopiesEverything) {
  MakeDatabase("db");
  EXPECT_EQ(Run("compact db small").exit_code, 0);
  EXPECT_EQ(Run("diff db small").exit_code, 0);
  const Ended again = Run("compact db small");
  EXPECT_EQ(again.exit_code, 2);
  EXPECT_THAT(again.err, HasSubstr("there is a database in 'small' already"));
}

TEST_F(SilhouetteDb, DiffTellsWhatDiffers) {
  MakeDatabase("a", 0, {3});
  MakeDatabase("b", 0, {4});
  const Ended missing = Run("diff a b");
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_THAT(missing.out, AllOf(HasSubstr("only in the first"), HasSubstr("only in the second")));
  MakeDatabase("c", 1);
  const Ended other = Run("diff a c");
  EXPECT_EQ(other.exit_code, 1);
  EXPECT_THAT(other.out, AllOf(HasSubstr("pixels of view 'left'"), HasSubstr("capture time"),
                               HasSubstr("more differences")));
  EXPECT_THAT(Run("diff --masks-only a c").out, Not(HasSubstr("capture time")));
}

TEST_F(SilhouetteDb, DiffTellsOfVariantsVerificationAndSuspects) {
  MakeDatabase("a");
  MakeDatabase("b");
  for (const std::string name : {"a", "b"}) {
    const auto database = Database::Open(folder_ / name, Database::Access::kWrite);
    const auto variant = (*database)->CreateVariant("closed", "test");
    ASSERT_TRUE(variant.ok());
    if (name == "a") continue;
    auto writer = (*variant)->Write("test");
    ASSERT_TRUE(writer->Put(TestImage(**variant, NumberAt(2, 1))).ok());
    ASSERT_TRUE(writer->Commit().ok());
    ASSERT_TRUE((*database)->CreateVariant("open", "test").ok());
    storage::v1::ModelVerification verification;
    verification.set_digest("x");
    ASSERT_TRUE((*database)->SetVerification(verification, "test").ok());
    storage::v1::CaptureHistory history;
    history.add_suspects()->mutable_until()->set_seconds(1'000'000'000'000);
    ASSERT_TRUE((*database)->SetCaptureHistory(history).ok());
  }
  const Ended ended = Run("diff a b");
  EXPECT_EQ(ended.exit_code, 1);
  EXPECT_THAT(ended.out, AllOf(HasSubstr("verification of the model: only in the second"),
                               HasSubstr("suspect in the second")));
  const Json json = Json::parse(Run("diff --masks-only a b --format json").out);
  EXPECT_EQ(json["differences"], 2) << json;
  EXPECT_THAT(json["first"][0], HasSubstr("variant 'open': only in the second"));
  EXPECT_THAT(json["first"][1], HasSubstr("variant 'closed': configuration "));
  EXPECT_EQ(Run("diff --masks-only --variant default a b").exit_code, 0);
}

TEST_F(SilhouetteDb, EverySubcommandTellsAMissingOrForeignDatabase) {
  Write("foreign/data.mdb", std::string(10'000, 'x'));
  for (const char* arguments :
       {"info %", "verify %", "coverage %", "show % --number 1", "sheet % --picture s.png",
        "stats %", "export % out", "compact % small", "diff % %"}) {
    SCOPED_TRACE(arguments);
    const Ended missing = Run(absl::StrReplaceAll(arguments, {{"%", "none"}}));
    EXPECT_EQ(missing.exit_code, 2);
    EXPECT_EQ(missing.err, "silhouette-db: there is no database in 'none'\n");
    const Ended foreign = Run(absl::StrReplaceAll(arguments, {{"%", "foreign"}}));
    EXPECT_EQ(foreign.exit_code, 2);
    EXPECT_THAT(foreign.err, HasSubstr("'foreign/data.mdb' is not a database"));
    const Ended help =
        Run(std::string(arguments).substr(0, std::string(arguments).find(' ')) + " --help");
    EXPECT_EQ(help.exit_code, 0);
    EXPECT_THAT(help.out, HasSubstr("Example:"));
  }
  EXPECT_EQ(Run("").exit_code, 2);
  EXPECT_EQ(Run("nonsense").exit_code, 2);
  EXPECT_THAT(Run("audit audit.jsonl").err, HasSubstr("did you mean 'verify'?"));
}

}  // namespace
}  // namespace silhouette
