// SPDX-License-Identifier: Apache-2.0
// The section 'separation' of cell.yaml.
#include <gmock/gmock.h>

#include <fstream>
#include <string>

#include "absl/strings/str_cat.h"
#include "tests/folders.h"
#include "tests/test_folder.h"
#include "tools/cell/cell.h"

namespace silhouette {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

absl::StatusOr<Cell> CellOf(const std::string& text) {
  const std::filesystem::path file = FreshFolder() / "cell.yaml";
  std::ofstream(file) << text;
  return LoadCell(file.string());
}

std::string RefusalOf(const std::string& text) {
  return std::string(CellOf(text).status().message());
}

const std::string kModelCell = "name: x\nrobot:\n  urdf: " + SourceFolder() +
                               "/capture/sim/robots/rx130.urdf\n  joints: [{name: joint_1}]\n"
                               "  fixed: {joint_2: 0, joint_3: 0, joint_4: 0, joint_5: 0, "
                               "joint_6: 0}\n"
                               "grid: {steps: {joint_1: 4}}\nviews: [{name: top}]\n";
const std::string kSeparationCell = kModelCell + "sound: {least_obstacle: 0.1}\n";

TEST(SeparationOfCell, HasLevelsAndAZoneAndNeedsSound) {
  const std::string& model = kModelCell;
  const std::string& sound = kSeparationCell;
  const std::string levels =
      "levels: [{name: slow, speed: 0.25, stopping_time: 150 ms, stopping_distance: 0.02}, "
      "{name: fast, speed: 1, stopping_time: 0.4, stopping_distance: 0.3}]";
  EXPECT_FALSE(CellOf(sound)->separation.has_value());
  const auto cell = CellOf(sound + "separation: {" + levels +
                           ", reaction_time: 50 ms, unseen: empty, "
                           "zone: {lower: [-2, -2, 0], upper: [2, 2, 2]}, voxel_edge: 0.05}\n");
  ASSERT_TRUE(cell.ok() && cell->separation) << cell.status();
  const SeparationCell& separation = *cell->separation;
  ASSERT_EQ(separation.settings.levels.size(), 2u);
  EXPECT_EQ(separation.settings.levels[0], (SpeedLevel{"slow", 0.25, 0.15, 0.02}));
  EXPECT_EQ(separation.settings.reaction_time, 0.05);
  EXPECT_EQ(separation.settings.human_speed, 1.6);
  EXPECT_TRUE(separation.unseen_is_empty);
  EXPECT_EQ(separation.zone->max().z(), 2);
  EXPECT_EQ(separation.voxel_edge, 0.05);

  EXPECT_THAT(RefusalOf(model + "separation: {" + levels + "}\n"),
              HasSubstr("it needs the section 'sound'"));
  EXPECT_THAT(RefusalOf(sound + "separation: {levels: []}\n"), HasSubstr("at least one"));
  EXPECT_THAT(RefusalOf(sound + "separation: {" + levels + ", unseen: perhaps}\n"),
              HasSubstr("possible"));
  EXPECT_THAT(RefusalOf(sound + "separation: {" + levels + ", human_speed: -1}\n"),
              HasSubstr("greater than 0"));

  const auto with = [&](const std::string& more) {
    return CellOf(sound + "separation: {" + levels + ", " + more + "}\n");
  };
  EXPECT_EQ(with("human_speed: 2.5")->separation->settings.near_human_speed, 2.5);
  const auto slower = Contains(HasSubstr("slower than people walk"));
  EXPECT_THAT(Doubts(*with("human_speed: 1.6")), Not(slower));
  EXPECT_THAT(Doubts(*with("human_speed: 0.0016")), slower);
}

TEST(SeparationOfCell, RefusesWhatIsInMillimetresOrMilliseconds) {
  const auto refusal = [](const std::string& level, const std::string& more) {
    return RefusalOf(absl::StrCat(kSeparationCell, "separation: {levels: [{name: slow, ", level,
                                  "}], ", more, "}\n"));
  };
  const std::string level = "speed: 0.25, stopping_time: 0.15, stopping_distance: 0.02";
  EXPECT_EQ(refusal(level, "uncertainty: 0.1"), "");
  for (const char* more : {"human_speed: 1600", "near_human_speed: 2000"}) {
    EXPECT_THAT(refusal(level, more), HasSubstr("at most 20 m/s")) << more;
  }
  for (const char* more : {"uncertainty: 50", "intrusion: 120"}) {
    EXPECT_THAT(refusal(level, more), HasSubstr("at most 2 m")) << more;
  }
  EXPECT_THAT(refusal(level, "zone: {lower: [-2000, -2000, 0], upper: [2000, 2000, 2000]}"),
              HasSubstr("more than 100 m"));
  EXPECT_THAT(refusal("speed: 250, stopping_time: 0.15, stopping_distance: 0.02", "intrusion: 0"),
              HasSubstr("at most 20 m/s"));
  EXPECT_THAT(refusal("speed: 0.25, stopping_time: 150, stopping_distance: 0.02", "intrusion: 0"),
              HasSubstr("'150 ms'"));
  EXPECT_THAT(refusal("speed: 0.25, stopping_time: 0.15, stopping_distance: 20", "intrusion: 0"),
              HasSubstr("at most 10 m"));
}

}  // namespace
}  // namespace silhouette
