// SPDX-License-Identifier: Apache-2.0
#include "common/yaml/strict_yaml.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <functional>
#include <numbers>

#include "tests/test_folder.h"

namespace silhouette {
namespace {

using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;

YamlNode Parse(const std::string& text) { return {YAML::Load(text), "file.yaml", ""}; }

std::string ErrorOf(const std::function<void()>& action) {
  try {
    action();
  } catch (const YamlError& error) {
    return error.what();
  }
  return "";
}

TEST(StrictYaml, UnknownKeyIsNamedWithItsLineAndTheNearestKey) {
  YamlMap map(Parse("name: a\n\nvews: 3\n"));
  map.Get<std::string>("name");
  map.Optional("views");
  EXPECT_EQ(ErrorOf([&] { map.Finish(); }),
            "file.yaml:3: unknown key 'vews'; did you mean 'views'?");
}

TEST(StrictYaml, UnknownKeyThatResemblesNoneListsTheKnownKeys) {
  YamlMap map(Parse("colour: red"));
  map.Optional("name");
  map.Optional("grid");
  EXPECT_THAT(ErrorOf([&] { map.Finish(); }), EndsWith("known are 'grid' and 'name'"));
}

TEST(StrictYaml, KeyThatStandsTwiceIsRefused) {
  EXPECT_THAT(ErrorOf([] { YamlMap map(Parse("a: 1\na: 2\n")); }),
              HasSubstr("file.yaml:2: the key 'a' stands there twice"));
}

TEST(StrictYaml, MergeKeyIsRefusedWithItsLine) {
  EXPECT_EQ(ErrorOf([] {
              const YamlNode file = Parse("common: &common {a: 1}\nview:\n  <<: *common\n  b: 2\n");
              YamlMap(YamlMap(file).Required("view"));
            }),
            "file.yaml:3: view: merge keys ('<<') are not supported; write the keys out");
}

TEST(StrictYaml, MissingKeyIsNamed) {
  YamlMap map(Parse("a: 1"));
  EXPECT_THAT(ErrorOf([&] { map.Required("b"); }), HasSubstr("the key 'b' is missing"));
}

TEST(StrictYaml, WrongKindOfValueIsRefused) {
  EXPECT_THAT(ErrorOf([] { Parse("many").As<int>(); }), HasSubstr("a whole number is expected"));
  EXPECT_THAT(ErrorOf([] { Parse("1.5").As<int>(); }), HasSubstr("a whole number is expected"));
  EXPECT_THAT(ErrorOf([] { Parse(".nan").As<double>(); }), HasSubstr("a number is expected"));
  EXPECT_THAT(ErrorOf([] { Parse("3").As<bool>(); }), HasSubstr("true or false is expected"));
  EXPECT_THAT(ErrorOf([] { Parse("[1]").As<double>(); }), HasSubstr("a number is expected"));
  EXPECT_THAT(ErrorOf([] { YamlMap map(Parse("[1]")); }), HasSubstr("keys with values"));
  EXPECT_THAT(ErrorOf([] { Parse("a: 1").Items(); }), HasSubstr("a list is expected"));
  EXPECT_THAT(ErrorOf([] { Parse("[1, 2]").Items(3); }), HasSubstr("a list of 3 is expected"));
}

TEST(StrictYaml, BoundsAndChoicesAreChecked) {
  EXPECT_EQ(Parse("0").AsNotNegative(), 0);
  EXPECT_EQ(Parse("1").AsShare(), 1);
  EXPECT_EQ(Parse("c").AsWordOf({"a", "b", "c"}), 2u);
  EXPECT_THAT(ErrorOf([] { Parse("0").AsPositive(); }), HasSubstr("greater than 0"));
  EXPECT_THAT(ErrorOf([] { Parse("-1").AsNotNegative(); }), HasSubstr("not below 0"));
  EXPECT_THAT(ErrorOf([] { Parse("1.1").AsShare(); }), HasSubstr("from 0 to 1"));
  EXPECT_THAT(ErrorOf([] { Parse("0 s").AsPositiveTime(); }), HasSubstr("greater than 0"));
  EXPECT_THAT(ErrorOf([] {
                Parse("d").AsWordOf({"a", "b", "c"});
              }),
              HasSubstr("'a', 'b' or 'c' is expected"));
  YamlMap map(Parse("a: 2 s"));
  absl::Duration a, b = absl::Seconds(7);
  map.Read("a", a, &YamlNode::AsTime);
  map.Read("b", b, &YamlNode::AsTime);
  EXPECT_EQ(a, absl::Seconds(2));
  EXPECT_EQ(b, absl::Seconds(7)) << "as it was";
}

TEST(StrictYaml, WholeNumbersAreDecimal) {
  EXPECT_EQ(Parse("0").As<int>(), 0);
  EXPECT_EQ(Parse("-10").As<int>(), -10);
  for (const char* other : {"010", "0x10", "-010", "1_000", "1e2", ".nan", "''"}) {
    EXPECT_THAT(ErrorOf([=] { Parse(other).As<int>(); }), HasSubstr("in decimal digits")) << other;
  }
}

TEST(StrictYaml, TextThatIsNotUtf8IsNamedByItsLine) {
  const auto error = [](const std::string& text) {
    return ErrorOf([&] { YamlNode::FromText(text, "cell.yaml"); });
  };
  EXPECT_THAT(error("a: b\nname: M\xfcnchen\n"), HasSubstr("cell.yaml:2: the text is not UTF-8"));
  EXPECT_EQ(error("a: M\xc3\xbcnchen"), "");
  EXPECT_EQ(error("\xef\xbb\xbf"
                  "a: b"),
            "");
  EXPECT_EQ(error(std::string("\xff\xfe"
                              "a\0:\0 \0b\0",
                              10)),
            "")
      << "UTF-16";
}

TEST(StrictYaml, AMissingKeyThatIsThereMistypedIsNamed) {
  for (const char* typed : {"veiws", "view", "viewss", "wiews"}) {
    EXPECT_EQ(ErrorOf([=] { YamlMap(Parse(std::string(typed) + ": 1")).Required("views"); }),
              "file.yaml:1: unknown key '" + std::string(typed) + "'; did you mean 'views'?");
  }
  EXPECT_THAT(ErrorOf([] { YamlMap(Parse("name: 1")).Required("views"); }),
              HasSubstr("the key 'views' is missing"));
}

TEST(StrictYaml, KeyWhoseValueWasForgottenIsRefused) {
  for (const char* text : {"margin:", "margin: ~", "margin: # 1 px"}) {
    EXPECT_EQ(ErrorOf([=] { YamlMap(Parse(text)).Get<double>("margin", 0); }),
              "file.yaml:1: margin: it has no value; write one, or leave the key out");
  }
}

TEST(StrictYaml, AnglesAndTimesTakeUnits) {
  EXPECT_DOUBLE_EQ(Parse("1.5").AsAngle(), 1.5);
  EXPECT_DOUBLE_EQ(Parse("180 deg").AsAngle(), std::numbers::pi);
  EXPECT_DOUBLE_EQ(Parse("-2 rad").AsAngle(), -2);
  EXPECT_DOUBLE_EQ(Parse("250 ms").AsSeconds(), 0.25);
  EXPECT_DOUBLE_EQ(Parse("1 min 30 s").AsSeconds(), 90);
  EXPECT_THAT(ErrorOf([] { Parse("5 m").AsSeconds(); }), HasSubstr("units: ms, s, min, h"));
  EXPECT_THAT(ErrorOf([] { Parse("3 turns").AsAngle(); }), HasSubstr("an angle is expected"));
  EXPECT_DOUBLE_EQ(Parse("-50 mm").AsPosition(), -0.05);
  EXPECT_THAT(ErrorOf([] { Parse("90 deg").AsPosition(); }), HasSubstr("a position is expected"));
  EXPECT_DOUBLE_EQ(Parse("-5 cm").AsAngleOrPosition(), -0.05);
  EXPECT_DOUBLE_EQ(Parse("180 deg").AsAngleOrPosition(), std::numbers::pi);
  EXPECT_THAT(ErrorOf([] { Parse("-1 s").AsSeconds(); }), HasSubstr("a time is expected"));
  EXPECT_EQ(Parse("1.5 GB").AsBytes(), 1'500'000'000u);
  EXPECT_EQ(Parse("2 KiB").AsBytes(), 2048u);
  EXPECT_EQ(Parse("0").AsBytes(), 0u);
  for (const char* wrong : {"-1", "8 gigs", "1e30", "nan", "[1]"}) {
    EXPECT_THAT(ErrorOf([=] { Parse(wrong).AsBytes(); }), HasSubstr("a number of bytes"));
  }
}

TEST(StrictYaml, ListsKeepTheirOrder) {
  EXPECT_THAT(Parse("[3, 1, 2]").Values<int>(), ElementsAre(3, 1, 2));
}

TEST(StrictYaml, BrokenFileIsToldWithItsLine) {
  const std::string path = (TestFolder() / "broken.yaml").string();
  std::ofstream(path) << "a: 1\nb: [1, 2\nc: }\n";
  EXPECT_THAT(ErrorOf([&] { YamlNode::FromFile(path); }), HasSubstr("broken.yaml:3: "));
}

TEST(StrictYaml, TabInAnIndentationIsToldWithItsLine) {
  EXPECT_THAT(ErrorOf([] { YamlNode::FromText("a:\n  b: 1\n\tc: 2\nd: 3\n", "cell.yaml"); }),
              HasSubstr("cell.yaml:3: the line is indented by a tab; YAML wants spaces"));
}

TEST(StrictYaml, MissingAndEmptyFilesAreTold) {
  EXPECT_THAT(ErrorOf([] { YamlNode::FromFile("/nowhere/cell.yaml"); }),
              HasSubstr("/nowhere/cell.yaml: the file does not exist"));
  const std::string path = (TestFolder() / "empty.yaml").string();
  std::ofstream(path) << "# nothing\n";
  EXPECT_THAT(ErrorOf([&] { YamlNode::FromFile(path); }), HasSubstr("the file is empty"));
}

TEST(StrictYaml, SecondDocumentIsNoPartOfTheFileAndRefused) {
  EXPECT_THAT(ErrorOf([] { YamlNode::FromText("a: 1\n---\nb: 2\n", "cell.yaml"); }),
              HasSubstr("cell.yaml:3: a second document begins here"));
  EXPECT_NO_THROW(YamlNode::FromText("---\na: 1\n...\n", "cell.yaml"));
  EXPECT_NO_THROW(YamlNode::FromText("a: 1\n---\n", "cell.yaml"));
}

TEST(StrictYaml, NearestWordIsEmptyWhereNothingIsNear) {
  EXPECT_EQ(NearestWord("joint_1", {"axis_a", "joint_2"}), "joint_2");
  EXPECT_EQ(NearestWord("zzz", {"name", "grid"}), "");
}

}  // namespace
}  // namespace silhouette
