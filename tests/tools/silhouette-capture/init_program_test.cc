// SPDX-License-Identifier: Apache-2.0
// silhouette-capture init and check, as the user of a new cell runs them.
#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/calib/robot/urdf_files.h"
#include "tests/capture/session/program_cell.h"
#include "tools/cell/cell.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

class NewCell : public testing::Test {
 protected:
  // Of the simulated cell, without its cell.yaml.
  NewCell() { std::filesystem::remove(cell_.cell()); }

  Outcome Init(const std::vector<std::string>& more,
               const std::string& urdf = SourceFolder() + "/capture/sim/robots/rx130.urdf") const {
    std::vector<std::string> arguments = {"init", "--urdf", urdf, "--out", cell_.cell()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return cell_.Run(arguments);
  }
  Outcome InitSimulated(const std::string& front = "sim") const {
    return Init({"--joint", "joint_1=-150deg:150deg", "--joint", "joint_3", "--driver", "sim",
                 "--simulation", cell_ / "simulation.yaml", "--view", "top=sim", "--view",
                 "front=" + front, "--image-size", "160", "120"});
  }

  ProgramCell cell_;
};

TEST_F(NewCell, ItsFileIsWrittenLoadedAndChecked) {
  const Outcome made = InitSimulated();
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr("silhouette-capture check --cell"));
  const auto cell = LoadCell(cell_.cell());
  ASSERT_TRUE(cell.ok()) << cell.status();
  ASSERT_EQ(cell->grid.dimensions(), 2);
  EXPECT_EQ(cell->grid.joints()[0].name, "joint_1");
  EXPECT_NEAR(cell->grid.joints()[0].upper, 150 * 3.14159265 / 180, 1e-6);
  EXPECT_EQ(cell->fixed_joints.size(), 4u);
  ASSERT_EQ(cell->views.size(), 2u);

  const Outcome checked = cell_.Run(cell_.Arguments("check", {"--format", "json"}));
  ASSERT_EQ(checked.exit_code, 0) << checked.out << checked.err;
  const auto json = nlohmann::json::parse(checked.out);
  std::vector<std::string> whats;
  for (const auto& finding : json["findings"]) whats.push_back(finding["what"]);
  EXPECT_THAT(whats, ElementsAre("grid", "robot", "view front", "view top", "cameras", "database",
                                 "disk", "forbidden regions"));
}

TEST_F(NewCell, ItsMasksHaveTheShapeAndAQuarterOfTheImagesAndTheSectionSoundIsThereAsAComment) {
  const auto init = [&](const std::string& width, const std::string& height) {
    std::filesystem::remove(cell_.cell());
    EXPECT_EQ(
        Init({"--joint", "joint_1", "--view", "top=/dev/video0", "--image-size", width, height})
            .exit_code,
        0);
    return LoadCell(cell_.cell())->views[0].mask_size;
  };
  EXPECT_EQ(init("60", "48"), (MaskSize{60, 48}));
  EXPECT_EQ(init("256", "256"), (MaskSize{64, 64}));
  EXPECT_EQ(init("320", "240"), (MaskSize{80, 60}));
  EXPECT_EQ(init("1080", "1920"), (MaskSize{72, 128}));
  EXPECT_EQ(init("640", "480"), (MaskSize{128, 96}));
  EXPECT_FALSE(LoadCell(cell_.cell())->sound.has_value());
  std::string text = ReadText(cell_.cell());
  const size_t comment = text.find("# sound: {");
  ASSERT_NE(comment, std::string::npos) << text;
  WriteText(cell_.cell(), text.erase(comment, 2));
  const auto cell = LoadCell(cell_.cell());
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_EQ(cell->sound->least_obstacle, 0.15);
  EXPECT_TRUE(SoundCellOf(*cell).ok());
}

TEST_F(NewCell, ManyJointsAreDrawn) {
  const Outcome made = Init({"--view", "top=/dev/video0", "--view", "front=rtsps://127.0.0.1/x"});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const auto cell = LoadCell(cell_.cell());
  ASSERT_TRUE(cell.ok()) << cell.status();
  EXPECT_TRUE(cell->robot.drawn.has_value());
  EXPECT_EQ(cell->grid.dimensions(), 6);
  EXPECT_THAT(ReadText(cell_.cell()),
              AllOf(HasSubstr("{v4l2: \"/dev/video0\"}"), HasSubstr("{rtsp: \"rtsps:")));
}

TEST_F(NewCell, MistakesNameTheMendAndLeaveNoFile) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> mistakes = {
      {{"--joint", "elbow", "--view", "top=sim"}, "it has 'joint_1', 'joint_2'"},
      {{"--joint", "joint_1=3", "--view", "top=sim"}, "joint_1=-90deg:90deg"},
      {{"--joint", "joint_1=1:-1", "--view", "top=/dev/video0"},
       "silhouette-capture: the options make no valid cell file: grid: joint 'joint_1'"},
      {{"--joint", "joint_1=-90:90", "--view", "top=/dev/video0"},
       "--joint joint_1=-90:90: -90 is more than two turns (joint values are radians; did you mean "
       "degrees? Write 90deg)"},
      {{"--joint", "joint_1=low:1", "--view", "top=/dev/video0"}, "'low' is no joint value"},
      {{"--view", "top"}, "write name=source"},
      {{"--view", "top=/dev/video0", "--view", "top=/dev/video1"}, "stands twice"},
      {{"--view", "top={usb: 3}"}, "usb"}};
  for (const auto& [arguments, mend] : mistakes) {
    const Outcome made = Init(arguments);
    EXPECT_EQ(made.exit_code, 2) << mend;
    EXPECT_THAT(made.err, HasSubstr(mend));
    EXPECT_FALSE(std::filesystem::exists(cell_.cell())) << mend;
  }
}

TEST_F(NewCell, PackageOfAMeshIsAskedForByTheNameOfTheOption) {
  const std::string urdf =
      WriteFile(cell_ / "meshes.urdf",
                "<robot name='r'><link name='a'><visual><geometry>"
                "<mesh filename='package://arm/a.stl'/></geometry></visual></link></robot>");
  const Outcome made = Init({"--view", "top=/dev/video0"}, urdf);
  EXPECT_EQ(made.exit_code, 2) << made.out;
  EXPECT_THAT(made.err, HasSubstr("holds the package 'arm' to --package-path (now: none)"));
}

TEST_F(NewCell, RobotOfMoreJointsThanCanMoveIsRefusedWithTheirNames) {
  const std::string urdf = WriteFile(cell_ / "gripper.urdf", GripperUrdf());
  const Outcome made = Init({"--view", "top=/dev/video0"}, urdf);
  EXPECT_EQ(made.exit_code, 2) << made.out;
  EXPECT_THAT(made.err, HasSubstr("8 joints of the robot move, at most 7 may; name those with "
                                  "--joint, each by itself: 'joint0', 'joint1'"));
}

TEST_F(NewCell, CheckNamesLinksThatAlwaysTouchByTheModel) {
  const auto check = [&](const std::string& axis) {
    std::filesystem::remove(cell_.cell());
    const std::string urdf = WriteFile(
        cell_ / "robot.urdf",
        "<robot name='r'><link name='base'/><link name='bridge'>" + axis +
            "</link>"
            "<link name='trolley'/><link name='z axis'>" +
            axis +
            "</link>"
            "<joint name='x' type='prismatic'><parent link='base'/><child link='bridge'/>"
            "<limit lower='-1' upper='1'/></joint>"
            "<joint name='y' type='prismatic'><parent link='bridge'/><child link='trolley'/>"
            "<limit lower='-0.1' upper='0.1'/></joint>"
            "<joint name='z' type='revolute'><parent link='trolley'/><child link='z axis'/>"
            "<limit lower='-0.1' upper='0.1'/></joint></robot>");
    EXPECT_EQ(Init({"--images", "drawn", "--view", "top=/dev/video0"}, urdf).exit_code, 0);
    return cell_.Run(cell_.Arguments("check")).out;
  };
  EXPECT_THAT(check("<visual><geometry><box size='1 1 1'/></geometry></visual>"),
              AllOf(HasSubstr("ok     robot images: drawn, of 2 parts"),
                    HasSubstr("NOTE   links: by the model these links touch"),
                    HasSubstr("--not-checked 'z axis' 'bridge'")));
  EXPECT_THAT(check(""), HasSubstr("FAULT  robot images: the robot 'r' has no visual"));
}

TEST_F(NewCell, CheckNamesLimitsInDegreesAndALinkBeyondTheWorkspace) {
  const auto check = [&](const std::string& limits) {
    std::filesystem::remove(cell_.cell());
    const std::string urdf = cell_ / "turn.urdf";
    WriteText(urdf,
              "<robot name='r'><link name='base'/><link name='arm'><visual><geometry>"
              "<box size='1 1 1'/></geometry></visual></link>"
              "<joint name='turn' type='revolute'><parent link='base'/><child link='arm'/>"
              "<limit " +
                  limits + "/></joint></robot>");
    EXPECT_EQ(Init({"--images", "drawn", "--view", "top=/dev/video0"}, urdf).exit_code, 0);
    WriteText(cell_.cell(),
              ReadText(cell_.cell()) + "\nworkspace: {lower: [-2, -2, 0], upper: [2, 2, 2]}\n");
    return cell_.Run(cell_.Arguments("check")).out;
  };
  EXPECT_THAT(check("lower='-137.5' upper='137.5'"),
              AllOf(HasSubstr("FAULT  joint turn: its limits, -137.5 to 137.5, are 44 turns"),
                    HasSubstr("{name: turn, lower: -137.5 deg, upper: 137.5 deg}")));
  // Of a joint that turns often, and of one that turns twice.
  EXPECT_THAT(check("lower='-18.85' upper='18.85'"), HasSubstr("ok     joint turn: its limits"));
  EXPECT_THAT(check("lower='-12.566' upper='12.566'"), Not(HasSubstr("joint turn")));
  EXPECT_THAT(check("lower='-1' upper='1'"),
              AllOf(HasSubstr("FAULT  links: 'arm' with its tolerance is beyond the lower face of "
                              "'workspace' across z, or nearer than 3 mm to it"),
                    HasSubstr("correct 'workspace' in the cell file")));
}

TEST_F(NewCell, CheckNamesAWorkspaceThatACapturedRobotLeavesAndWhatItDoubts) {
  ASSERT_EQ(InitSimulated().exit_code, 0);
  const std::string text = ReadText(cell_.cell());
  const auto check = [&](const std::string& more) {
    WriteText(cell_.cell(), text + more);
    return cell_.Run(cell_.Arguments("check"));
  };
  Outcome checked = check("workspace: {lower: [-0.5, -0.5, 0], upper: [0.5, 0.5, 0.5]}\n");
  EXPECT_EQ(checked.exit_code, 1);
  EXPECT_THAT(checked.out, AllOf(HasSubstr("FAULT  workspace: "),
                                 HasSubstr("m beyond the upper face of 'workspace' across z")));
  checked = check("workspace: {lower: [-2, -2, -2], upper: [2, 2, 3]}\nserver: {max_age: 500}\n");
  EXPECT_EQ(checked.exit_code, 0) << checked.out;
  EXPECT_THAT(checked.out, AllOf(HasSubstr("ok     workspace: holds the robot"),
                                 HasSubstr("NOTE   cell file: server: max_age: free verdicts may "
                                           "rest on images 8 min 20 s old")));
}

TEST_F(NewCell, CheckSaysHowFarADrawnRobotLeavesItsWorkspace) {
  ASSERT_EQ(InitSimulated().exit_code, 0);
  const std::string text =
      absl::StrReplaceAll(ReadText(cell_.cell()), {{"images: captured", "images: drawn"}});
  const auto check = [&](const std::string& upper) {
    WriteText(cell_.cell(),
              absl::StrCat(text, "workspace: {lower: [-2, -2, -2], upper: ", upper, "}\n"));
    return cell_.Run(cell_.Arguments("check")).out;
  };
  EXPECT_THAT(check("[2, 2, 3]"), HasSubstr("ok     workspace: holds the robot"));
  EXPECT_THAT(check("[2, 0.7, 3]"),
              AllOf(HasSubstr("NOTE   workspace: "),
                    HasSubstr("m beyond the upper face of 'workspace' across y at joint_1 = ")));
}

TEST_F(NewCell, AFileThatIsThereIsKept) {
  WriteText(cell_.cell(), "mine");
  EXPECT_EQ(InitSimulated().exit_code, 2);
  EXPECT_EQ(ReadText(cell_.cell()), "mine");
}

TEST_F(NewCell, CheckNamesImagesThatAreTooDark) {
  ASSERT_EQ(InitSimulated().exit_code, 0);
  WriteText(cell_ / "simulation.yaml", ReadText(cell_ / "simulation.yaml") + "exposure: 0.1\n");
  const Outcome checked = cell_.Run(cell_.Arguments("check"));
  EXPECT_EQ(checked.exit_code, 1) << checked.out << checked.err;
  EXPECT_THAT(checked.out, AllOf(HasSubstr("FAULT  view top"), HasSubstr("too dark"),
                                 HasSubstr("ok     robot")));
}

TEST_F(NewCell, CheckNotesAViewWhoseSourceStatesNoExposure) {
  const auto check = [&](const std::string& source) {
    std::filesystem::remove(cell_.cell());
    EXPECT_EQ(Init({"--joint", "joint_1", "--view", "top=" + source}).exit_code, 0);
    return cell_.Run(cell_.Arguments("check")).out;
  };
  const auto doubtful_views = [&] {
    const Outcome checked = cell_.Run(cell_.Arguments("check", {"--format", "json"}));
    std::vector<std::string> doubtful;
    const auto json = nlohmann::json::parse(checked.out);
    for (const auto& finding : json["findings"]) {
      if (finding["what"] == "view top" && finding["doubtful"].get<bool>()) {
        doubtful.push_back(finding["text"]);
      }
    }
    return doubtful;
  };
  const std::string note = "NOTE   view top: its source states no exposure";
  EXPECT_THAT(check("/dev/video99"), HasSubstr(note));
  EXPECT_THAT(doubtful_views(), ElementsAre(HasSubstr("its source states no exposure")));
  EXPECT_THAT(check("{v4l2: {device: /dev/video99, exposure: 5 ms}}"), Not(HasSubstr(note)));
  EXPECT_THAT(doubtful_views(), ElementsAre());
}

TEST_F(NewCell, CheckSaysWhatToDoAboutImagesThatAreTooFarApart) {
  std::filesystem::create_directory(cell_ / "images");
  WriteText(cell_ / "images/1.pgm", "P5\n160 120\n255\n" + std::string(160 * 120, 'x'));
  const Outcome made =
      InitSimulated(absl::StrCat("{folder: {path: '", cell_ / "images", "', repeat: true}}"));
  ASSERT_EQ(made.exit_code, 0) << made.err;
  WriteText(cell_.cell(), ReadText(cell_.cell()) + "\nserver: {max_skew: 0 s}\n");
  const Outcome checked = cell_.Run(cell_.Arguments("check"));
  EXPECT_EQ(checked.exit_code, 1);
  EXPECT_THAT(checked.out, AllOf(HasSubstr("FAULT  cameras: "),
                                 HasSubstr("trigger the cameras together, or raise 'server: "
                                           "max_skew' in the cell file if nothing in the cell")));
}

TEST_F(NewCell, CheckLooksAtTheRobotAndEveryCameraThoughOthersDoNotAnswer) {
  const Outcome made = InitSimulated("{grpc: \"127.0.0.1:1\"}");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const Outcome checked = cell_.Run(cell_.Arguments("check"));
  EXPECT_EQ(checked.exit_code, 1);
  EXPECT_THAT(checked.out,
              AllOf(HasSubstr("ok     robot: answers"), HasSubstr("ok     view top: 160 x 120"),
                    HasSubstr("FAULT  view front: no camera driver answers at")));
}

TEST_F(NewCell, CheckLooksAtTheCamerasThoughTheRobotDoesNotAnswer) {
  ASSERT_EQ(Init({"--joint", "joint_1", "--driver", "{grpc: {address: \"127.0.0.1:1\"}}", "--view",
                  "top=/dev/video99", "--view", "front=/dev/video98"})
                .exit_code,
            0);
  const Outcome checked = cell_.Run(cell_.Arguments("check"));
  EXPECT_EQ(checked.exit_code, 1);
  EXPECT_THAT(checked.out, AllOf(HasSubstr("FAULT  robot: "), HasSubstr("FAULT  view top: "),
                                 HasSubstr("FAULT  view front: ")));
}

TEST_F(NewCell, CheckNamesADriverThatDoesNotAnswer) {
  ASSERT_EQ(Init({"--joint", "joint_1", "--driver", "{grpc: {address: \"127.0.0.1:1\"}}", "--view",
                  "top={grpc: \"127.0.0.1:1\"}"})
                .exit_code,
            0);
  const Outcome checked = cell_.Run(cell_.Arguments("check"));
  EXPECT_EQ(checked.exit_code, 1) << checked.out << checked.err;
  EXPECT_THAT(checked.out, AllOf(HasSubstr("FAULT  robot"), HasSubstr("FAULT  view top"),
                                 HasSubstr("driver answers at 127.0.0.1:1; start it")));
}

}  // namespace
}  // namespace silhouette
