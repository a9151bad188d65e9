// SPDX-License-Identifier: Apache-2.0
// What silhouette-db exports and imports.
#include <gmock/gmock.h>
#include <google/protobuf/util/message_differencer.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "common/picture/mask_png.h"
#include "tests/db/store/test_cell.h"
#include "tests/tools/silhouette-db/database_program.h"

namespace silhouette {
namespace {

using Json = nlohmann::json;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

class SilhouetteDbExchange : public SilhouetteDb {};

TEST_F(SilhouetteDbExchange, ExportAndImportKeepAllButRawImages) {
  MakeDatabase("db", 0, {3});
  Write("cell.yaml", kTestCellFile);
  EXPECT_EQ(Run("export db out").exit_code, 0);
  const Ended imported = Run("import --cell cell.yaml --database copy out");
  EXPECT_EQ(imported.exit_code, 0) << imported.err;
  EXPECT_THAT(imported.out, HasSubstr("29 records imported into copy"));
  const Ended same = Run("diff db copy");
  EXPECT_EQ(same.exit_code, 0) << same.out;
  EXPECT_THAT(Run("export db out").err, HasSubstr("folder 'out' is not empty"));

  {
    const auto database = Database::Open(folder_ / "db", Database::Access::kWrite);
    auto writer = (*database)->Write("test");
    std::optional<RobotImage> captured;
    const auto visit = [&](ConfigurationNumber, absl::StatusOr<RobotImage> image) {
      captured = *std::move(image);
      return captured->excluded;
    };
    ASSERT_TRUE((*database)->Read()->ForEach(visit).ok());
    ASSERT_TRUE(writer->Put(*captured, /*replace=*/true, {"a", "b"}).ok());
    ASSERT_TRUE(writer->Commit().ok());
  }
  const Ended without = Run("diff db copy");
  EXPECT_EQ(without.exit_code, 1);
  EXPECT_EQ(without.out, "raw images of 1 configuration: only in the first\n");
  EXPECT_EQ(Run("diff --masks-only db copy").exit_code, 0);
}

TEST_F(SilhouetteDbExchange, ScriptsReadWhatWasExportedImportedAndCompacted) {
  MakeDatabase("db", 0, {3});
  Write("cell.yaml", kTestCellFile);
  const Json exported = Json::parse(Run("export db out --format json").out);
  EXPECT_EQ(exported["table"], "out/configurations.csv");
  EXPECT_EQ(exported["exported"], 29);
  EXPECT_EQ(exported["damaged"], 0);
  const std::string import = "import --cell cell.yaml --database copy out --format json";
  const Json imported = Json::parse(Run(import).out);
  EXPECT_EQ(imported["imported"], 29);
  EXPECT_EQ(imported["complete"], true);
  EXPECT_EQ(imported["next"], "silhouette-db index copy");
  EXPECT_EQ(Json::parse(Run(import).out)["there_already"], 29);
  const Json compacted = Json::parse(Run("compact db small --format json").out);
  EXPECT_EQ(compacted["target"], "small");
  EXPECT_GE(compacted["bytes"], compacted["target_bytes"]);
}

TEST_F(SilhouetteDbExchange, ImportRunAgainGoesOn) {
  MakeDatabase("db");
  Write("cell.yaml", kTestCellFile);
  ASSERT_EQ(Run("export db out").exit_code, 0);
  const std::string table = Read("out/configurations.csv");
  Write("out/configurations.csv", table.substr(0, table.find('\n', table.size() / 2) + 1));
  EXPECT_EQ(Run("import --cell cell.yaml --database copy out").exit_code, 0);
  const Ended differs = Run("diff db copy --format json");
  EXPECT_EQ(differs.exit_code, 1);
  EXPECT_EQ(Json::parse(differs.out)["same"], false);
  EXPECT_THAT(Json::parse(differs.out)["first"][0], HasSubstr("only in the first"));
  Write("out/configurations.csv", table);
  const Ended again = Run("import --cell cell.yaml --database copy out");
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_THAT(again.out, HasSubstr("were there already"));
  EXPECT_EQ(Run("diff db copy").exit_code, 0);
}

TEST_F(SilhouetteDbExchange, ImportNeverMixesMasksWithDrawnOnes) {
  MakeDatabase("db");
  Write("cell.yaml", kTestCellFile);
  ASSERT_EQ(Run("export db out").exit_code, 0);
  MakeDrawnDatabase("drawn");
  MakeDrawnDatabase("nodes", "own");
  for (const std::string into :
       {"drawn", "drawn --variant open", "nodes", "nodes --variant open"}) {
    const Ended imported = Run("import out --cell cell.yaml --database " + into);
    EXPECT_EQ(imported.exit_code, 2) << into;
    EXPECT_THAT(imported.err, HasSubstr("were drawn; import into another database"));
  }
  EXPECT_THAT(Run("info drawn").out, HasSubstr("00ff"));
  // A server of a drawn cell refuses any other variant.
  EXPECT_THAT(VariantsOf("drawn"), ElementsAre("default"));
  EXPECT_THAT(VariantsOf("nodes"), ElementsAre("default", "own"));
}

TEST_F(SilhouetteDbExchange, ExportRefusesDrawnImagesSinceImportWouldTakeThemForCapturedOnes) {
  MakeDrawnDatabase("drawn");
  MakeDrawnDatabase("nodes", "own");
  for (const std::string from : {"drawn", "nodes", "nodes --variant own"}) {
    const Ended exported = Run("export " + from + " --folder out");
    EXPECT_EQ(exported.exit_code, 2) << from;
    EXPECT_THAT(exported.err, HasSubstr("were drawn, and only captured ones are exported"));
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
  }
}

TEST_F(SilhouetteDbExchange, ImportOfWhichNothingIsTakenMakesNoVariant) {
  MakeDatabase("db");
  Write("cell.yaml", kTestCellFile);
  Write("white.png", PlainPng({64, 64}, CV_8UC1, 255));
  Write("t.png", EncodeMaskPng(OnePixel({33, 20})));
  for (const std::string row : {"-1,-1,white.png,t.png\n", "-0.9,-1,white.png,t.png\n"}) {
    Write("configurations.csv", "axis_1,axis_2,left,top\n" + row);
    EXPECT_EQ(Run("import . --variant open --cell cell.yaml --database db").exit_code, 2);
    EXPECT_THAT(VariantsOf("db"), ElementsAre("default")) << row;
  }
  Write("configurations.csv", "axis_1,axis_2,left,top\n-0.9,-1,t.png,t.png\n-1,-1,,\n");
  const Ended partly = Run("import . --variant open --cell cell.yaml --database db");
  EXPECT_EQ(partly.exit_code, 2);
  EXPECT_THAT(partly.out, HasSubstr("1 record imported"));
  EXPECT_THAT(VariantsOf("db"), ElementsAre("default", "open"));
}

TEST_F(SilhouetteDbExchange, ImportReplacesOtherReferenceImagesOnlyWhenAsked) {
  using google::protobuf::util::MessageDifferencer;
  MakeDatabase("db");
  Write("cell.yaml", kTestCellFile);
  ASSERT_EQ(Run("export db out").exit_code, 0);
  storage::v1::References retaken = TestReferences(30'000);
  const auto retake = [&] {
    const auto database = Database::Open(folder_ / "db", Database::Access::kWrite).value();
    ASSERT_TRUE(database->SetReferences(retaken, "test").ok());
  };
  retake();
  const Ended refused = Run("import out --cell cell.yaml --database db");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_EQ(refused.err,
            "silhouette-db: database 'db' has other reference images than 'out/references.csv'; "
            "delete this file to keep them, or give --replace\n");
  EXPECT_TRUE(MessageDifferencer::Equals(ReferencesOf("db"), retaken));
  EXPECT_EQ(Run("import out --replace --cell cell.yaml --database db").exit_code, 0);
  EXPECT_TRUE(MessageDifferencer::Equals(ReferencesOf("db"), TestReferences(25'000)));
  retake();
  std::filesystem::remove(folder_ / "out/references.csv");
  EXPECT_EQ(Run("import out --cell cell.yaml --database db").exit_code, 0);
  EXPECT_TRUE(MessageDifferencer::Equals(ReferencesOf("db"), retaken));
  // What the files do not state is no difference.
  for (auto& view : *retaken.mutable_views()) view.set_with_robot(true);
  retake();
  ASSERT_EQ(Run("export db again").exit_code, 0);
  EXPECT_EQ(Run("import again --cell cell.yaml --database db").exit_code, 0);
  EXPECT_TRUE(ReferencesOf("db").views(0).with_robot());
}

TEST_F(SilhouetteDbExchange, ImportRefusesReferenceImagesThatTheServerCouldNotUse) {
  MakeDatabase("from");
  Write("cell.yaml", kTestCellFile);
  ASSERT_EQ(Run("export from out").exit_code, 0);
  const std::string mean = Read("out/references/left-mean.png");
  const std::string table = Read("out/references.csv");
  const auto refusal = [&] {
    const Ended outcome = Run("import out --cell cell.yaml --database db");
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(folder_ / "db"));
    return outcome.err;
  };
  const auto of_mean = [&](const std::string& png) {
    Write("out/references/left-mean.png", png);
    return refusal();
  };
  EXPECT_THAT(of_mean(mean.substr(0, mean.size() / 2)),
              HasSubstr("references.csv:2: 'out/references/left-mean.png' is not an image, or is "
                        "damaged"));
  EXPECT_THAT(of_mean(PlainPng({640, 480}, CV_8UC1, 90)),
              HasSubstr("references.csv:2: the reference's mean is not a 16-bit PNG image"));
  EXPECT_THAT(of_mean(PlainPng({66, 40}, CV_16UC1, 90)), HasSubstr("differ in size"));
  Write("out/references/left-noise.png", PlainPng({66, 40}, CV_16UC1, 90));
  EXPECT_THAT(refusal(), HasSubstr("references.csv:2: the reference image of the view 'left' is "
                                   "66x40 pixels large and should be 640x480"));
  Write("out/references.csv",
        absl::StrReplaceAll(table, {{"\nleft", "\ntop"}, {"\ntop", "\nleft"}}));
  EXPECT_THAT(refusal(), HasSubstr("references.csv:2: the view here is 'left', not 'top'"));
  Write("out/references.csv", table.substr(0, table.find("\ntop")));
  EXPECT_THAT(refusal(),
              HasSubstr("references.csv: it needs a row for each of the 2 views, and has 1"));
}

TEST_F(SilhouetteDbExchange, ImportTakesMasksMadeElsewhere) {
  Write("cell.yaml", kTestCellFile);
  const Mask left = Mask::FromPredicate({64, 64}, [](int x, int y) { return x == y; });
  const Mask top = Mask::FromPredicate({33, 20}, [](int x, int) { return x == 4; });
  Write("masks/l.png", EncodeMaskPng(left));
  Write("masks/t.png", EncodeMaskPng(top));
  Write("configurations.csv",
        "\xef\xbb\xbf"
        "top,axis_2,left,axis_1\r\nmasks/t.png,-1,\"masks/l.png\",-0.5 rad\r\n\r\n,0.25,,-1\r\n");
  const Ended outcome = Run("import configurations.csv --cell cell.yaml --database db");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  const auto database = Database::Open(folder_ / "db", Database::Access::kRead);
  const auto image = (*database)->Read()->Find(NumberAt(1, 0));
  ASSERT_TRUE(image.ok() && image->has_value());
  EXPECT_EQ((*image)->masks, (std::vector{left, top}));
  EXPECT_FALSE((*image)->excluded);
  EXPECT_TRUE((*image)->measured.empty());
  EXPECT_TRUE((**(*database)->Read()->Find(NumberAt(0, 2))).excluded);
  EXPECT_EQ((*database)->Read()->size(), 2);
}

TEST_F(SilhouetteDbExchange, ImportRefusesMasksThatAreInverted) {
  Write("cell.yaml", kTestCellFile);
  std::string table = "axis_1,axis_2,left,top\n";
  // The robot stands at the lower rim, as it mostly does.
  for (const int i : {0, 1, 2}) {
    const Mask left = Mask::FromPredicate(
        {64, 64}, [i](int x, int y) { return y < 30 || std::abs(x - 20 - 10 * i) > 5; });
    Write(absl::StrCat("left", i, ".png"), EncodeMaskPng(left));
    absl::StrAppend(&table, -1 + 0.5 * i, ",-1,left", i, ".png,t.png\n");
  }
  Write("t.png", EncodeMaskPng(OnePixel({33, 20})));
  Write("configurations.csv", table);
  const Ended refused = Run("import . --cell cell.yaml --database db");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("configurations.csv: the masks of the view 'left' seem "
                                           "to be inverted"),
                                 HasSubstr("or give --robot-fills-view")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "db"));
  const Ended taken = Run("import . --cell cell.yaml --database db --robot-fills-view");
  EXPECT_EQ(taken.exit_code, 0) << taken.err;
  EXPECT_THAT(taken.out, HasSubstr("3 records imported"));
}

TEST_F(SilhouetteDbExchange, ImportTellsFileAndLineOfEachMistakeAndKeepsTheRest) {
  Write("cell.yaml", kTestCellFile);
  Write("l.png", EncodeMaskPng(OnePixel({64, 64})));
  Write("t.png", EncodeMaskPng(OnePixel({33, 20})));
  Write("text.png", "no image");
  Write("black.png", EncodeMaskPng(Mask({64, 64})));
  Write("black_t.png", EncodeMaskPng(Mask({33, 20})));
  std::vector<uint8_t> ones;
  cv::imencode(".png", cv::Mat(64, 64, CV_8UC1, cv::Scalar(1)), ones);
  Write("ones.png", std::string(ones.begin(), ones.end()));
  Write("configurations.csv",
        "axis_1,axis_2,left,top\n"
        "-1,-1,l.png,t.png\n"
        "-0.9,-1,l.png,t.png\n"
        "7,-1,l.png,t.png\n"
        "x,-1,l.png,t.png\n"
        "0,-1,t.png,t.png\n"
        "0,-1,none.png,t.png\n"
        "0,-1,text.png,t.png\n"
        "0,-1,l.png,\n"
        "0,-1,l.png\n"
        "-1,-1,l.png,t.png\n"
        "1.5,1.5,l.png,t.png\n"
        "90,1.5,l.png,t.png\n"
        "0,-1,black.png,black_t.png\n"
        "0,-1,ones.png,t.png\n"
        "\"0\".5,-1,l.png,t.png\n");
  const Ended outcome = Run("import . --cell cell.yaml --database db");
  EXPECT_EQ(outcome.exit_code, 2);
  for (const char* message : {
           "configurations.csv:3: joint 'axis_1': -0.9 is not on the grid; the nearest value is -1",
           "configurations.csv:4: joint 'axis_1': 7 is outside -1 to 1.5",
           "configurations.csv:5: joint 'axis_1': 'x' is no joint value; 0.5, -30deg and 0.2m are",
           "configurations.csv:13: joint 'axis_1': 90 is outside -1 to 1.5 (joint values are "
           "radians; did you mean degrees? Write 90deg)",
           "configurations.csv:6: view 'left': './t.png': it is 33x20 pixels large and should be "
           "64x64",
           "configurations.csv:7: view 'left': './none.png' cannot be read: No such file",
           "configurations.csv:8: view 'left': './text.png': it is not an image",
           "configurations.csv:9: view 'top' has no mask; only an excluded configuration",
           "configurations.csv:10: it has 3 cells, the header has 4",
           "configurations.csv:11: the same configuration is in line 2",
           "configurations.csv:14: no mask has a pixel of the robot",
           "configurations.csv:15: view 'left': './ones.png': pixel (0, 0) is neither black (0) "
           "nor white (255) but 1",
           "configurations.csv:16: the double quotes do not match",
           "13 lines are wrong; mend them and run it again, what is imported stays",
       }) {
    EXPECT_THAT(outcome.err, HasSubstr(message));
  }
  EXPECT_THAT(outcome.out, HasSubstr("2 records imported"));
}

TEST_F(SilhouetteDbExchange, ImportTakesGridValuesWithSixDecimalsAndNoneThatAreFurtherOff) {
  Write("cell.yaml", absl::StrReplaceAll(kTestCellFile, {{"lower: -1, upper: 1.5",
                                                          "lower: -60 deg, "
                                                          "upper: 60 deg"},
                                                         {"axis_1: 6, axis_2: 5",
                                                          "axis_1: 13, "
                                                          "axis_2: 13"}}));
  Write("l.png", EncodeMaskPng(OnePixel({64, 64})));
  Write("t.png", EncodeMaskPng(OnePixel({33, 20})));
  Write("configurations.csv",
        "axis_1,axis_2,left,top\n"
        "-1.047198,1.047198,l.png,t.png\n"  // a little outside
        "0.174533,-0.698132,l.png,t.png\n");
  const Ended taken = Run("import . --cell cell.yaml --database db");
  EXPECT_EQ(taken.exit_code, 0) << taken.err;
  EXPECT_THAT(taken.out, HasSubstr("2 records imported"));
  Write("configurations.csv",
        "axis_1,axis_2,left,top\n"
        "0.174531,0,l.png,t.png\n"
        "1.047200,0,l.png,t.png\n"
        "1.1,0,l.png,t.png\n"
        "2,32,l.png,t.png\n");
  const Ended refused = Run("import . --cell cell.yaml --database other");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err,
              AllOf(HasSubstr("csv:2: joint 'axis_1': 0.174531 is not on the grid"),
                    HasSubstr("csv:3: joint 'axis_1': 1.047200 is outside"),
                    HasSubstr("csv:5: joint 'axis_1': 2 is outside -1.0472 to 1.0472 (joint values "
                              "are radians; did you mean degrees?")));
  EXPECT_THAT(refused.err, HasSubstr("mend them and run it again\n"));
  EXPECT_EQ(refused.out, "nothing is imported\nno database is made\n");
}

TEST_F(SilhouetteDbExchange, ImportRefusesMasksOfARobotThatWasMeasuredElsewhere) {
  Write("cell.yaml", kTestCellFile);
  Write("l.png", EncodeMaskPng(OnePixel({64, 64})));
  Write("t.png", EncodeMaskPng(OnePixel({33, 20})));
  Write("configurations.csv",
        "axis_1,axis_2,left,top,measured:axis_1,measured:axis_2,measured:axis_3\n"
        "-1,-1,l.png,t.png,-0.999,-1,0.25\n"
        "0,-1,l.png,t.png,0,-0.99,0.25\n");
  const Ended outcome = Run("import . --cell cell.yaml --database db");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("configurations.csv:3: joint 'axis_2' was measured at -0.99, "
                                     "not at -1: the masks show another configuration"));
  EXPECT_THAT(outcome.out, HasSubstr("1 record imported"));
}

TEST_F(SilhouetteDbExchange, ImportTellsWrongColumnsBeforeItMakesADatabase) {
  Write("cell.yaml", kTestCellFile);
  const auto refusal = [&](const std::string& header) {
    Write("configurations.csv", header + "\n");
    const Ended outcome = Run("import . --cell cell.yaml --database db");
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_FALSE(std::filesystem::exists(folder_ / "db"));
    return outcome.err;
  };
  EXPECT_THAT(refusal("axis_1,axis_2,left"), HasSubstr("csv:1: column 'top' is missing"));
  EXPECT_THAT(refusal("axis_1,left,top"), HasSubstr("csv:1: column 'axis_2' is missing"));
  EXPECT_THAT(
      refusal("axis_1,axis_2,left,top,colour"),
      HasSubstr("csv:1: column 'colour' is neither a joint nor a view of cell 'test cell'"));
  EXPECT_THAT(refusal("axis_1;axis_2;left;top"),
              HasSubstr("with commas between them: axis_1,axis_2,left"));
  EXPECT_THAT(refusal("axis_1,axis_2,left,top"),
              HasSubstr("csv: there is no row below the header"));
  EXPECT_THAT(refusal("axis_1,axis_2,left,top,top"), HasSubstr("column 'top' is there twice"));
  EXPECT_THAT(
      refusal("axis_1,axis_2,left,top,measured:axis_1"),
      HasSubstr("column 'measured:axis_2' is missing; it is there for all joints or for none"));
}

TEST_F(SilhouetteDbExchange, ImportOfWhichNothingIsTakenLeavesNoDatabase) {
  Write("cell.yaml", kTestCellFile);
  Write("l.png", EncodeMaskPng(OnePixel({64, 64})));
  Write("t.png", EncodeMaskPng(OnePixel({33, 20})));
  Write("configurations.csv", "axis_1,axis_2,left,top\n-0.9,-1,l.png,t.png\n");
  for (const std::string variant : {"", " --variant open", " --variant no/name"}) {
    const Ended outcome = Run("import . --cell cell.yaml --database db" + variant);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_FALSE(std::filesystem::exists(folder_ / "db")) << variant;
  }
  EXPECT_THAT(Run("import . --cell cell.yaml --database db").err,
              HasSubstr("1 line is wrong; mend it and run"));
  MakeDatabase("db");
  EXPECT_EQ(Run("import . --cell cell.yaml --database db").exit_code, 2);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "db")) << "it was there";
}

TEST_F(SilhouetteDbExchange, ImportRefusesADatabaseOfAnotherCellAndOtherRecords) {
  MakeDatabase("db");
  Write("cell.yaml", kTestCellFile);
  ASSERT_EQ(Run("export db out").exit_code, 0);
  MakeDatabase("other", 1);
  const Ended outcome = Run("import out --cell cell.yaml --database other");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("the database has another record of this configuration"));
  EXPECT_EQ(Run("import out --replace --cell cell.yaml --database other").exit_code, 0);
  EXPECT_EQ(Run("diff db other").exit_code, 0);
  Write("cell.yaml", absl::StrReplaceAll(kTestCellFile, {{"axis_1: 6", "axis_1: 7"}}));
  const Ended another = Run("import out --cell cell.yaml --database other");
  EXPECT_EQ(another.exit_code, 2);
  EXPECT_THAT(another.err,
              HasSubstr("joint 'axis_1': steps is 7 in the cell file, 6 in the database"));
}

TEST_F(SilhouetteDbExchange, ImportReadsNoPipesAndDevices) {
  MakeDatabase("db");
  Write("cell.yaml", kTestCellFile);
  ASSERT_EQ(Run("export db out").exit_code, 0);
  const std::string rows = Read("out/configurations.csv");
  const size_t end = rows.find(".png");
  const std::string mask =
      rows.substr(rows.rfind(',', end) + 1, end + 4 - rows.rfind(',', end) - 1);
  for (const std::string& file : {mask, std::string("configurations.csv")}) {
    std::filesystem::remove(folder_ / "out" / file);
    std::filesystem::create_symlink("/dev/null", folder_ / "out" / file);
    const Ended outcome = Run("import out --cell cell.yaml --database other");
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.err, HasSubstr(file + "' is a pipe or device; name a file"));
  }
}

TEST_F(SilhouetteDbExchange, ImportCountsALastLineWithoutItsEnd) {
  MakeDatabase("db");
  Write("cell.yaml", kTestCellFile);
  ASSERT_EQ(Run("export db out").exit_code, 0);
  std::string rows = Read("out/configurations.csv");
  ASSERT_EQ(rows.back(), '\n');
  rows.pop_back();
  Write("out/configurations.csv", rows);
  EXPECT_THAT(Run("import out --cell cell.yaml --database other").err,
              HasSubstr("import 31 of 31 lines"));
}

}  // namespace
}  // namespace silhouette
