// SPDX-License-Identifier: Apache-2.0
#include "tools/cell/cell.h"

#include <gmock/gmock.h>

#include <fstream>
#include <numbers>
#include <regex>

#include "db/store/store.h"
#include "tests/folders.h"
#include "tests/test_folder.h"
#include "tests/tools/cell/cell_file.h"

namespace silhouette {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Cell, BareJointsAndViewsWithoutASourceAreEnough) {
  const absl::StatusOr<Cell> cell = Load(kBareCell);
  ASSERT_TRUE(cell.ok()) << cell.status();
  ASSERT_EQ(cell->grid.dimensions(), 2);
  EXPECT_EQ(cell->grid.joints()[0].steps, 10);
  EXPECT_DOUBLE_EQ(cell->grid.joints()[0].upper, std::numbers::pi / 2);
  EXPECT_TRUE(cell->grid.joints()[1].continuous);
  EXPECT_DOUBLE_EQ(cell->grid.joints()[1].lower, -std::numbers::pi);
  ASSERT_EQ(cell->fixed_joints.size(), 1u);
  EXPECT_EQ(cell->fixed_joints[0].name, "c");
  EXPECT_EQ(cell->views[0].mask_size, (MaskSize{64, 64}));
  EXPECT_EQ(cell->views[1].mask_size, (MaskSize{32, 16}));
  EXPECT_EQ(cell->views[1].image_width, 32);
  EXPECT_EQ(DescriptionOf(*cell).segmentation(), "");
}

TEST(Cell, TilesAreThoseOfADatabaseThatIsThere) {
  const std::string path = Write(kBareCell);
  const std::string folder = FreshFolder() / "cell.lmdb";
  storage::v1::CellDescription description = DescriptionOf(*LoadCell(path, folder));
  const std::vector<int> chosen(description.tile_edges().begin(), description.tile_edges().end());
  description.clear_tile_edges();
  for (const int edge : {1, 4096}) description.add_tile_edges(edge);
  ASSERT_TRUE(Database::Create(folder, description).ok());

  const absl::StatusOr<Cell> cell = LoadCell(path, folder);
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_EQ(cell->database, folder);
  EXPECT_THAT(cell->grid.tile_edges(), ElementsAre(1, 4096));
  // Not of a grid that is another, nor where there is no database.
  const auto edges_of = [](const absl::StatusOr<Cell>& of) {
    return std::vector<int>(of->grid.tile_edges().begin(), of->grid.tile_edges().end());
  };
  const std::string other = Write(Changed("a: 10", "a: 11"));
  EXPECT_EQ(edges_of(LoadCell(other, folder)), edges_of(LoadCell(other)));
  EXPECT_EQ(edges_of(LoadCell(path, folder + "-not-there")), chosen);
}

TEST(Cell, TilesOfAWristAreLongAndThoseOfAnArmShort) {
  const absl::StatusOr<Cell> cell = Load(SixJoints("", "grid: {max_move: 0.3}\n"));
  ASSERT_TRUE(cell.ok()) << cell.status();
  const std::span<const int> edges = cell->grid.tile_edges();
  EXPECT_LE(edges[0] * edges[1] * edges[2], 16);
  EXPECT_GE(edges[3] * edges[4] * edges[5], 256);
}

TEST(Cell, TheCommentedSampleIsACellAndShowsTheDefaults) {
  std::ifstream in(SourceFolder() + "/docs/cell.yaml");
  std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  const std::string robots = SourceFolder() + "/capture/sim/robots/";
  text = std::regex_replace(text, std::regex("urdf: rx130"), "urdf: " + robots + "rx130");
  const absl::StatusOr<Cell> cell = Load(text);
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_EQ(cell->segmentation, SegmentationSettings{});
  EXPECT_EQ(Describe(cell->verification), Describe(ComparisonSettings{}));
  EXPECT_EQ(cell->policy, Policy{});
  EXPECT_TRUE(cell->choose_preset);
  EXPECT_EQ(cell->calibration.margin, CalibrationSettings{}.margin);
  EXPECT_EQ(cell->capture.settle, CaptureSettings{}.settle);
  EXPECT_EQ(cell->capture.settle_timeout, CaptureSettings{}.settle_timeout);
  EXPECT_EQ(cell->capture.still_images, CaptureSettings{}.still_images);
  EXPECT_EQ(cell->capture.joint_speed, CaptureSettings{}.joint_speed);
  EXPECT_EQ(cell->capture.arrival_timeout, CaptureSettings{}.arrival_timeout);
  EXPECT_EQ(cell->capture.reference_images, CaptureSettings{}.reference_images);
  EXPECT_EQ(cell->capture.raw_images, CaptureSettings{}.raw_images);
  EXPECT_EQ(cell->capture.sentinels.count, SentinelSettings{}.count);
  EXPECT_EQ(cell->capture.sentinels.every, SentinelSettings{}.every);
  EXPECT_EQ(cell->capture.sentinels.most_shift, SentinelSettings{}.most_shift);
  EXPECT_EQ(cell->capture.retry, CaptureSettings{}.retry);
  EXPECT_EQ(cell->capture.keep_free, CaptureSettings{}.keep_free);
  EXPECT_EQ(cell->server.listen, ServerSettings{}.listen);
  EXPECT_EQ(cell->server.scene.max_age, SceneSettings{}.max_age);
  EXPECT_EQ(cell->server.scene.max_skew, SceneSettings{}.max_skew);
  EXPECT_EQ(cell->server.scene.max_core_error, SceneSettings{}.max_core_error);
  EXPECT_EQ(cell->server.scene.weak_rim, SceneSettings{}.weak_rim);
  EXPECT_EQ(cell->capture.forbidden_regions.size(), 1u);
}

// The simulated arm of which two joints move, about z and at the elbow.
std::string TwoJoints(const std::string& in_robot, const std::string& grid,
                      const std::string& rest) {
  return "name: x\nrobot:\n  urdf: " + SourceFolder() +
         "/capture/sim/robots/rx130.urdf\n  joints: [{name: joint_1}, {name: joint_3}]\n"
         "  fixed: {joint_2: 0, joint_4: 0, joint_5: 0, joint_6: 0}\n" +
         in_robot + "grid: {" + grid + "}\nviews: [{name: top}]\n" + rest;
}

TEST(Cell, LengthsInMillimetresOrCentimetresWithoutTheirUnitAreRefused) {
  const std::string metres = "a number without a unit is in metres";
  const auto grid = [](const std::string& max_move) {
    return TwoJoints("", "max_move: " + max_move, "");
  };
  EXPECT_THAT(MessageOf(grid("350")),
              AllOf(HasSubstr("grid.max_move: that is 350 m; at most 0.5 m"), HasSubstr(metres)));
  EXPECT_THAT(MessageOf(grid("0")), HasSubstr("greater than 0"));
  EXPECT_TRUE(Load(grid("0.5")).ok());
  EXPECT_EQ(Load(grid("350 mm"))->grid.size(), Load(grid("0.35"))->grid.size());

  const auto sound = [](const std::string& keys) {
    return TwoJoints("", "max_move: 0.3", "sound: {" + keys + "}\n");
  };
  for (const char* least : {"15", "150", "1.01", "2 m"}) {
    EXPECT_THAT(MessageOf(sound(std::string("least_obstacle: ") + least)),
                AllOf(HasSubstr("sound.least_obstacle: that is"), HasSubstr(metres)));
  }
  EXPECT_EQ(Load(sound("least_obstacle: 15 cm, voxel_edge: 20 mm"))->sound->least_obstacle, 0.15);
  EXPECT_THAT(MessageOf(sound("least_obstacle: 0.15, voxel_edge: 2")), HasSubstr(metres));
  EXPECT_THAT(MessageOf(sound("least_obstacle: 0.15, model_tolerance: 5")), HasSubstr(metres));
  EXPECT_THAT(MessageOf(TwoJoints("  payload_radius: 100\n", "max_move: 0.3", "")),
              AllOf(HasSubstr("payload_radius: that is 100 m; at most 3 m"), HasSubstr(metres)));
}

TEST(Cell, LongTimesAndWideStepsAreDoubted) {
  EXPECT_THAT(Doubts(*Load(kBareCell)), ElementsAre());
  const std::string server = "server: {max_age: 10 s, max_skew: 1 s}\n";
  EXPECT_THAT(Doubts(*Load(std::string(kBareCell) + server)), ElementsAre());
  EXPECT_THAT(Doubts(*Load(std::string(kBareCell) + "server: {max_age: 500, max_skew: 50}\n")),
              ElementsAre(HasSubstr("max_age: free verdicts may rest on images 8 min 20 s old; "
                                    "a number without a unit is in seconds"),
                          HasSubstr("max_skew: free verdicts may rest on images 50 s apart")));
  EXPECT_THAT(Doubts(*Load(TwoJoints("", "max_move: 0.5", ""))), ElementsAre());
  const std::string sound =
      "workspace: {lower: [-1.8, -1.8, 0], upper: [1.8, 1.8, 2.4]}\nsound: {least_obstacle: ";
  EXPECT_THAT(Doubts(*Load(TwoJoints("", "max_move: 0.2", sound + "0.25}\n"))), ElementsAre());
  EXPECT_THAT(Doubts(*Load(TwoJoints("", "max_move: 0.2", sound + "0.3}\n"))),
              ElementsAre(HasSubstr("least_obstacle: 0.3 m is a radius")));
  EXPECT_THAT(Doubts(*Load(TwoJoints("", "steps: {joint_1: 8, joint_3: 8}", ""))),
              ElementsAre(HasSubstr("people are 0.3 to 0.5 m thick")));
}

TEST(Cell, CamerasThatMakeScenesStaleAreDoubtedInOneSentenceForAllViews) {
  const auto with = [](const std::string& times, const std::string& max_age) {
    const std::string source =
        "image_size: [640, 480], source: {rtsp: {url: 'rtsp://10.0.0.9/'" + times + "}}";
    return Doubts(*Load(Changed("  - {name: top}\n  - {name: side, mask_size: [32, 16]}\n",
                                "  - {name: top, " + source + "}\n  - {name: side, " + source +
                                    "}\nserver: {max_age: " + max_age + "}\n")));
  };
  EXPECT_THAT(
      with("", "1 s"),
      ElementsAre(
          HasSubstr("views 'top', 'side': with --live and a latency of 500 ms a scene is more "
                    "than 1 s old before the next one comes"),
          HasSubstr("views 'top', 'side': with --live a silent camera delays all views by its "
                    "timeout, 5 s")));
  EXPECT_THAT(with("", "3 s"), ElementsAre(HasSubstr("timeout, 5 s")));
  EXPECT_THAT(with(", timeout: 2 s", "3 s"), ElementsAre());
}

TEST(Cell, JointSpeedInDegreesIsRefused) {
  const auto with = [](const std::string& speed) {
    return std::string(kBareCell) + "capture: {joint_speed: " + speed + "}\n";
  };
  EXPECT_THAT(MessageOf(with("30")), HasSubstr("write degrees as '30 deg'"));
  EXPECT_NEAR(Load(with("30 deg"))->capture.joint_speed, 0.5236, 1e-4);
  EXPECT_EQ(Load(with("6"))->capture.joint_speed, 6);
}

TEST(Cell, TimesAfterWhichARobotIsStoppedAreDoubtedIfTheyAreLong) {
  const std::string long_times = "capture: {arrival_timeout: 5000}\n";
  EXPECT_THAT(Doubts(*Load(std::string(kBareCell) + long_times)),
              ElementsAre(AllOf(HasSubstr("capture: arrival_timeout: a robot that does not move on "
                                          "is stopped only after 1 h 23 min"),
                                HasSubstr("written as '500 ms'"))));
  std::string driven(kBareCell);
  const std::string joints = "  joints:";
  ASSERT_NE(driven.find(joints), std::string::npos);
  driven.insert(driven.find(joints), "  driver: {grpc: {address: 'localhost:1', timeout: 1000}}\n");
  EXPECT_THAT(Doubts(*Load(driven)),
              ElementsAre(HasSubstr("robot: driver: timeout: a robot that no longer reports its "
                                    "position is stopped only after ")));
}

TEST(Cell, SlideWithLimitsInMillimetresIsDoubted) {
  const auto with = [](const std::string& limits) {
    const std::string urdf = (TestFolder() / "slide.urdf").string();
    std::ofstream(urdf) << "<robot name='r'><link name='a'/><link name='b'><visual><geometry><box "
                           "size='0.1 0.1 0.1'/></geometry></visual></link><joint name='s' "
                           "type='prismatic'><parent link='a'/><child link='b'/><limit "
                        << limits << "/></joint></robot>";
    return Doubts(*Load("name: x\nrobot: {urdf: " + urdf +
                        ", joints: [{name: s}]}\ngrid: {steps: {s: 1000}}\n"
                        "views: [{name: top}]\n"));
  };
  EXPECT_THAT(with("lower='-0.05' upper='0.04'"), ElementsAre());
  EXPECT_THAT(with("lower='-50' upper='40'"),
              ElementsAre(AllOf(HasSubstr("joint 's': its limits, -50 to 40, are 90 m apart"),
                                HasSubstr("{name: s, lower: -50 mm, upper: 40 mm}"))));
}

TEST(Cell, ChecksThatAreSwitchedOffAreDoubtedInOneSentence) {
  EXPECT_THAT(Doubts(*Load(std::string(kBareCell) +
                           "server: {view_check: {least_gain: 0.1, most_shift: 5 px}}\n")),
              ElementsAre());
  EXPECT_THAT(
      Doubts(*Load(std::string(kBareCell) +
                   "server: {view_check: {least_gain: 0, greatest_gain: 100, most_saturated: 1, "
                   "least_structure: 0, most_shift: 1000 px, most_foreground: 1, "
                   "most_robot_missing: 1}, live: {least_noise: 0, least_change: 0}}\n")),
      ElementsAre(HasSubstr(
          "server: 'view_check: least_gain', 'view_check: greatest_gain', 'view_check: "
          "most_saturated', 'view_check: least_structure', 'view_check: most_shift', 'view_check: "
          "most_foreground', 'view_check: most_robot_missing', 'live: least_noise', 'live: "
          "least_change': these values switch checks off")));
}

TEST(Cell, MasksThatMissWhatCoversLittleAreRefusedWhereMuchRestsOnThemAndElseDoubted) {
  const std::string half = "segmentation: {min_cover: 0.5}\n";
  EXPECT_THAT(Doubts(*Load(std::string(kBareCell) + half)),
              ElementsAre(HasSubstr("min_cover: 0.5: what covers less of a mask pixel is missed")));
  const std::string refused = "min_cover must be 0 with the section 'sound' and with drawn";
  EXPECT_THAT(MessageOf(TwoJoints("", "max_move: 0.3", half + "sound: {least_obstacle: 0.15}\n")),
              HasSubstr(refused));
  EXPECT_THAT(MessageOf(TwoJoints("  images: drawn\n", "max_move: 0.3", half)), HasSubstr(refused));
}

TEST(Cell, PayloadThatIsDrawnAboutSeveralLinksIsDoubtedAndTheyAreNamed) {
  const std::string urdf = (TestFolder() / "track.urdf").string();
  const auto doubts = [&](const std::string& child, const std::string& radius) {
    std::ofstream(urdf) << "<robot name='r'><link name='rail'/><link name='foot'/>"
                           "<link name='base'/><link name='arm'/>"
                           "<joint name='s' type='prismatic'><parent link='rail'/>"
                           "<child link='foot'/><limit lower='0' upper='1'/></joint>"
                           "<joint name='t' type='revolute'><parent link='foot'/>"
                           "<child link='arm'/><limit lower='0' upper='1'/></joint>"
                           "<joint name='frame' type='fixed'><parent link='"
                        << child << "'/><child link='base'/></joint></robot>";
    return Doubts(*Load("name: x\nrobot: {urdf: " + urdf + ", payload_radius: " + radius +
                        ", images: drawn, joints: [{name: s}, {name: t}]}\nviews:\n"
                        "  - {name: a, image_size: [64, 64], mask_size: [64, 64]}\n"));
  };
  EXPECT_THAT(doubts("foot", "0.3"),
              ElementsAre(HasSubstr("payload_radius: 0.3 m is drawn about each of the links "
                                    "'base', 'arm': ")));
  EXPECT_THAT(doubts("foot", "0.1"), ElementsAre());
  EXPECT_THAT(doubts("rail", "0.3"), ElementsAre()) << "no joint moves it";
}

TEST(Cell, SegmentationThatDropsHandsOrPeopleIsDoubtedInTheViewsWhereItDoes) {
  // Mask pixels of 4 x 4 and of 10 x 10 camera pixels.
  const auto doubts = [](const std::string& segmentation) {
    return Doubts(*Load(Changed("  - {name: top}\n  - {name: side, mask_size: [32, 16]}\n",
                                "  - {name: top, image_size: [320, 240], mask_size: [80, 60]}\n"
                                "  - {name: side, image_size: [320, 160], mask_size: [32, 16]}\n"
                                "segmentation: {" +
                                    segmentation + "}\n")));
  };
  EXPECT_THAT(doubts("min_blob_pixels: 48, clean_up_radius: 3, noise_factor: 18"), ElementsAre());
  EXPECT_THAT(doubts("min_blob_pixels: 100"),
              ElementsAre("segmentation: min_blob_pixels: 100 drops areas of fewer camera pixels: "
                          "in view 'top' hands or whole people are missed; state 48 or less"));
  EXPECT_THAT(doubts("min_blob_pixels: 4000"),
              ElementsAre(HasSubstr("in views 'top', 'side' hands or whole people are missed; "
                                    "state 48 or less")));
  EXPECT_THAT(doubts("clean_up_radius: 4"),
              ElementsAre("segmentation: clean_up_radius: 4 removes what is thinner than 9 camera "
                          "pixels: in view 'top' hands or whole people are missed; state 3 or "
                          "less"));
  EXPECT_THAT(
      doubts("noise_factor: 60"),
      ElementsAre(HasSubstr("by less than 60 times the camera's noise are missed; state 18")));
  EXPECT_THAT(doubts("min_difference: 100"), ElementsAre()) << "faint_difference finds them";
  for (const char* faint : {"0", "100"}) {
    EXPECT_THAT(doubts(std::string("min_difference: 100, faint_difference: ") + faint),
                ElementsAre(HasSubstr("by less than 100 of 255 grey levels are missed")))
        << faint;
  }
}

TEST(Cell, CleanUpThatRemovesWholePeopleIsRefused) {
  const auto cell = [](const char* radius) {
    return std::string(kBareCell) + "segmentation: {clean_up_radius: " + radius + "}\n";
  };
  EXPECT_TRUE(Load(cell("15")).ok());
  for (const char* radius : {"16", "2000000000"}) {
    EXPECT_THAT(MessageOf(cell(radius)), AllOf(HasSubstr("clean_up_radius: at most 15 is expected"),
                                               HasSubstr("thinner than twice as many pixels")));
  }
}

TEST(Cell, StepsWiderThanTheLeastObstacleAreDoubtedWhereRobotImagesAreCaptured) {
  const auto doubts = [](const std::string& images, const std::string& least) {
    return Doubts(*Load(TwoJoints(images, "max_move: 0.2",
                                  "workspace: {lower: [-1.8, -1.8, 0], upper: [1.8, 1.8, 2.4]}\n"
                                  "sound: {least_obstacle: " +
                                      least + "}\n")));
  };
  EXPECT_THAT(doubts("", "0.1"),
              ElementsAre(AllOf(HasSubstr("more than sound: least_obstacle, 0.100 m: an obstacle"),
                                HasSubstr("lower max_move or add steps"))));
  EXPECT_THAT(doubts("", "0.25"), ElementsAre());
  EXPECT_THAT(doubts("  images: drawn\n", "0.1"), ElementsAre());
}

TEST(Cell, WideStepsOfADrawnRobotAreNotDoubted) {
  EXPECT_THAT(Doubts(*Load(TwoJoints("  images: drawn\n", "steps: {joint_1: 8, joint_3: 8}", ""))),
              ElementsAre());
}

TEST(Cell, WorkspaceThatTheRobotLeavesAtAnyJointValuesIsRefused) {
  const auto status = [](const std::string& upper, const std::string& more = "",
                         const std::string& lower = "-1.8, -1.8, 0") {
    const auto cell =
        Load(TwoJoints("", "max_move: 0.3",
                       "workspace: {lower: [" + lower + "], upper: [" + upper + "]}\n" + more));
    EXPECT_TRUE(cell.ok()) << cell.status();
    const absl::Status holds = WorkspaceHoldsRobot(*cell);
    EXPECT_EQ(WorkspaceOf(*cell).status(), holds);
    return holds;
  };
  EXPECT_TRUE(status("1.8, 1.8, 2.4").ok());
  EXPECT_TRUE(status("1.8, 1.8, 2.4", "", "-1.8, -1.8, 0.2").ok()) << "its foot may be below";
  const absl::Status low = status("1.8, 1.8, 1");
  EXPECT_EQ(low.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(low.message()),
              AllOf(HasSubstr("m beyond the upper face of 'workspace' across z at joint_1 = "),
                    HasSubstr("enlarge 'workspace', in metres")));
  EXPECT_THAT(std::string(status("1.8, 1.8, 2.4", "", "0, 0, 0").message()),
              HasSubstr("beyond the lower face of 'workspace' across"));
  // To one side only, where it must not go.
  const std::string forbidden =
      "capture: {forbidden_regions: [{name: left, joints: {joint_1: [0.1, 3]}}, "
      "{name: right, joints: {joint_1: [-3, -0.1]}}]}\n";
  const std::string side = "1.8, 0.7, 2.4";
  EXPECT_THAT(std::string(status(side).message()), HasSubstr("upper face of 'workspace' across y"));
  EXPECT_TRUE(status(side, forbidden).ok()) << status(side, forbidden);
}

TEST(Cell, FolderOrImpossibleNameInPlaceOfTheFileIsTheUsersMistake) {
  EXPECT_THAT(std::string(LoadCell(FreshFolder().string()).status().message()),
              HasSubstr("is a folder; name a file"));
  EXPECT_THAT(std::string(LoadCell(std::string(5000, 'x')).status().message()),
              HasSubstr("does not exist or cannot be read"));
}

TEST(Cell, MistakesAreToldWithLineAndMend) {
  EXPECT_THAT(MessageOf(Changed("views:", "vews:")),
              HasSubstr(".yaml:9: unknown key 'vews'; did you mean 'views'?"));
  EXPECT_THAT(MessageOf(Changed("a: 10, ", "")), HasSubstr("grid.steps: the key 'a' is missing"));
  EXPECT_THAT(MessageOf(Changed("a: 10", "a: 0")), HasSubstr("joint 'a'"));
  EXPECT_THAT(MessageOf(Changed("steps: {a: 10, b: 36}", "max_move: 0.1")),
              HasSubstr("max_move needs the robot's urdf"));
  EXPECT_THAT(MessageOf(Changed("steps: {a: 10, b: 36}", "{}")), HasSubstr("max_move or steps"));
  EXPECT_THAT(MessageOf(Changed("[32, 16]", "[32, 2000]")), HasSubstr("1 to 1024"));
  EXPECT_THAT(MessageOf(Changed("name: side", "name: top")),
              HasSubstr("another view called 'top'"));
  EXPECT_THAT(MessageOf(Changed("lower: 0", "lower: 100 deg")), HasSubstr("joint 'a'"));
  EXPECT_THAT(MessageOf(Changed("{name: a, lower: 0, ", "{name: a, ")),
              HasSubstr("'lower' is missing"));
  EXPECT_THAT(MessageOf(Changed("{c: 0.5}", "{a: 0.5}")), HasSubstr("moves; it cannot be fixed"));
  for (const char* degrees :
       {"capture: {joint_tolerance: 1}\n", "server: {fixed_joint_tolerance: 1}\n",
        "server: {max_joint_movement: 1}\n"}) {
    EXPECT_THAT(MessageOf(std::string(kBareCell) + degrees), HasSubstr("write degrees as '1 deg'"));
  }
  EXPECT_THAT(MessageOf(std::string(kBareCell) + "capture: {joint_tolerance: 0.01}\n"),
              HasSubstr("capture: joint_tolerance, 0.01, is more than the server's "
                        "fixed_joint_tolerance, 0.005"));
  EXPECT_TRUE(Load(std::string(kBareCell) + "capture: {joint_tolerance: 0.01}\n" +
                   "server: {fixed_joint_tolerance: 0.01}\n")
                  .ok());
  EXPECT_THAT(MessageOf(std::string(kBareCell) + "policy: {min_views: 3}\n"),
              HasSubstr("min_views"));
  EXPECT_THAT(MessageOf(std::string(kBareCell) + "policy: {preset: brave}\n"),
              HasSubstr("the presets are 'uncalibrated', 'paper'"));
  EXPECT_THAT(MessageOf(std::string(kBareCell) + "calibration: {margin: -1}\n"),
              HasSubstr("calibration.margin: a number not below 0 is expected"));
  EXPECT_THAT(MessageOf(std::string(kBareCell) +
                        "capture:\n  forbidden_regions: [{name: x, joints: {d: [0, 1]}}]\n"),
              HasSubstr("'d' is not a joint of the grid"));
  const auto forbidden = [](const std::string& bounds) {
    return MessageOf(std::string(kBareCell) +
                     "capture:\n  forbidden_regions: [{name: x, joints: {" + "a: [" + bounds +
                     "]}}]\n");
  };
  EXPECT_THAT(forbidden("120, 150"), HasSubstr("write degrees as '90 deg'"));
  EXPECT_THAT(forbidden("10, 12"), HasSubstr("the region protects nothing: 'a' goes from 0 to"));
  EXPECT_THAT(MessageOf(Changed("continuous: true", "continuous: true, lower: -180")),
              HasSubstr("write degrees as '90 deg'"));
  EXPECT_THAT(MessageOf(std::string(kBareCell) + "capture: {commit_interval: 5 s}\n"),
              HasSubstr("at most 2 s"));
  EXPECT_THAT(MessageOf(std::string(kBareCell) + "capture: {raw_images: some}\n"),
              HasSubstr("capture.raw_images: 'none', 'sentinels' or 'all' is expected"));
  EXPECT_THAT(MessageOf(std::string(kBareCell) + "capture: {sentinels: {most_shift: 2}}\n"),
              HasSubstr("most_shift: a number of pixels is expected, as in '1 px'"));
}

TEST(Cell, MissingFileIsTold) {
  EXPECT_EQ(LoadCell("/nowhere/cell.yaml").status().message(),
            "/nowhere/cell.yaml: the file does not exist or cannot be read");
}

}  // namespace
}  // namespace silhouette
