// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/robot_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <numbers>
#include <tuple>
#include <variant>

#include "absl/strings/str_replace.h"
#include "tests/calib/robot/urdf_files.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::string ErrorOf(const std::string& urdf, std::vector<std::string> package_paths = {}) {
  const auto model =
      RobotModel::FromUrdf(WriteFile(FreshFolder() / "bad.urdf", urdf), package_paths);
  return model.ok() ? "no error" : std::string(model.status().message());
}

std::string OneJoint(const std::string& joint) {
  return "<robot name='r'>\n<link name='a'/>\n<link name='b'/>\n" + joint + "\n</robot>\n";
}

std::string WithMesh(const std::string& file) {
  return "<robot name='r'><link name='a'><visual><geometry><mesh filename='" + file +
         "' scale='2 2 0.5'/></geometry></visual></link></robot>";
}

TEST(RobotModel, JointsStandFromTheBaseOutward) {
  const RobotModel robot = ThreeJoints();
  ASSERT_EQ(robot.joints().size(), 3u);
  EXPECT_EQ(robot.joints()[0].name, "turn");
  EXPECT_EQ(robot.joints()[0].lower, -2);
  EXPECT_EQ(robot.joints()[1].type, JointType::kContinuous);
  EXPECT_DOUBLE_EQ(robot.joints()[1].upper, std::numbers::pi);
  EXPECT_EQ(robot.joints()[2].type, JointType::kPrismatic);
  EXPECT_EQ(robot.JointIndex("slide"), 2u);
  EXPECT_FALSE(robot.JointIndex("base").has_value());
}

TEST(RobotModel, LinkPosesFollowTheJoints) {
  const RobotModel robot = ThreeJoints();
  const std::vector<double> positions{std::numbers::pi / 2, -std::numbers::pi / 2, 0.1};
  const auto poses = robot.LinkPoses(positions);
  ASSERT_EQ(poses.size(), 4u);
  // Turned left, bent up: the forearm stands upright 0.5 m along y.
  EXPECT_TRUE(poses[2].translation().isApprox(Eigen::Vector3d(0, 0.5, 1), 1e-12));
  EXPECT_TRUE(poses[3].translation().isApprox(Eigen::Vector3d(0, 0.5, 1.5), 1e-12));
  EXPECT_TRUE((poses[3].linear() * Eigen::Vector3d::UnitX()).isApprox(Eigen::Vector3d::UnitZ()));
  EXPECT_THROW(robot.LinkPoses(std::vector<double>{0, 0}), std::invalid_argument);
}

TEST(RobotModel, FramesThatNoJointMovesCarryNoPayload) {
  const auto robot = RobotModel::FromUrdf(WriteFile(FreshFolder() / "robot.urdf", R"(
      <robot name="r"><link name="foot"/><link name="base"/><link name="arm"/><link name="tool"/>
      <joint name="frame" type="fixed"><parent link="foot"/><child link="base"/></joint>
      <joint name="turn" type="continuous"><parent link="foot"/><child link="arm"/>
        <axis xyz="0 0 1"/></joint>
      <joint name="flange" type="fixed"><parent link="arm"/><child link="tool"/></joint></robot>)"));
  ASSERT_TRUE(robot.ok()) << robot.status();
  const std::vector<bool> outermost = robot->Outermost();
  for (size_t link = 0; link < outermost.size(); ++link) {
    EXPECT_EQ(outermost[link], robot->links()[link].name == "tool") << robot->links()[link].name;
  }
}

TEST(RobotModel, BodyIsVisualElseCollisionGeometry) {
  const RobotModel robot = ThreeJoints();
  EXPECT_EQ(robot.links()[0].body().size(), 0u);
  ASSERT_EQ(robot.links()[1].body().size(), 1u);
  EXPECT_TRUE(std::holds_alternative<BoxShape>(robot.links()[1].body()[0].shape));
  EXPECT_EQ(robot.links()[1].body()[0].colour, Eigen::Vector3d(1, 0.75, 0.5));
  ASSERT_EQ(robot.links()[2].body().size(), 1u);
  EXPECT_TRUE(std::holds_alternative<CylinderShape>(robot.links()[2].body()[0].shape));
}

TEST(RobotModel, PositionsAreLookedUpByNameAndChecked) {
  const RobotModel robot = ThreeJoints();
  const std::vector<std::string> names{"slide", "turn", "bend"};
  const auto positions = robot.Positions(names, std::vector<double>{0.1, 0.2, 4});
  ASSERT_TRUE(positions.ok()) << positions.status();
  EXPECT_EQ(*positions, (std::vector<double>{0.2, 4, 0.1}));

  const auto error = [&](std::vector<std::string> n, std::vector<double> v) {
    return std::string(robot.Positions(n, v).status().message());
  };
  EXPECT_THAT(error({"slide", "turn"}, {0, 0}), HasSubstr("'bend'"));
  EXPECT_THAT(error({"slide", "turn", "elbow"}, {0, 0, 0}),
              AllOf(HasSubstr("no joint 'elbow'"), HasSubstr("'turn', 'bend', 'slide'")));
  EXPECT_THAT(error({"turn", "turn", "bend"}, {0, 0, 0}), HasSubstr("twice"));
  EXPECT_THAT(error(names, {0.1, 2.1, 0}), HasSubstr("'turn' cannot stand at 2.1"));
}

TEST(RobotModel, MeshesAreFoundScaledAndTriangulated) {
  const auto folder = FreshFolder();
  WriteFile(folder / "roots/arm_description/meshes/link.stl", TetrahedronStl());
  const std::string urdf =
      WriteFile(folder / "robot.urdf", WithMesh("package://arm_description/meshes/link.stl"));
  for (const auto& root :
       {folder / "roots", folder / "roots/arm_description", folder / "roots/arm_description/"}) {
    const std::vector<std::string> roots{(folder / "elsewhere").string(), root.string()};
    const auto robot = RobotModel::FromUrdf(urdf, roots);
    ASSERT_TRUE(robot.ok()) << robot.status();
    const TriangleMesh mesh = Tessellate(robot->links()[0].visual[0].shape);
    EXPECT_EQ(mesh.triangles.size(), 4u);
    EXPECT_EQ(mesh.vertices.size(), 4u);
    Eigen::Vector3d upper = Eigen::Vector3d::Zero();
    for (const auto& vertex : mesh.vertices) upper = upper.cwiseMax(vertex);
    EXPECT_TRUE(upper.isApprox(Eigen::Vector3d(2, 2, 0.5)));
  }
  // Relative to the file.
  const std::string relative =
      WriteFile(folder / "b.urdf", WithMesh("roots/arm_description/meshes/link.stl"));
  EXPECT_TRUE(RobotModel::FromUrdf(relative).ok());
}

TEST(RobotModel, ColladasUnitCountsAndItsUpAxisDoesNot) {
  const auto folder = FreshFolder();
  for (const std::string up : {"Y_UP", "Z_UP"}) {
    WriteFile(folder / "link.dae", TriangleDae(up));
    const auto robot = RobotModel::FromUrdf(WriteFile(
        folder / "robot.urdf",
        "<robot name='r'><link name='a'><visual><geometry><mesh filename='link.dae'/></geometry>"
        "</visual></link></robot>"));
    ASSERT_TRUE(robot.ok()) << robot.status();
    const TriangleMesh mesh = Tessellate(robot->links()[0].visual[0].shape);
    ASSERT_EQ(mesh.vertices.size(), 3u);
    Eigen::Vector3d upper = Eigen::Vector3d::Zero();
    for (const auto& vertex : mesh.vertices) upper = upper.cwiseMax(vertex);
    EXPECT_TRUE(upper.isApprox(Eigen::Vector3d(1, 0, 2), 1e-6)) << up << ": " << upper.transpose();
  }
}

TEST(RobotModel, MissingPackageIsNamedWithTheMend) {
  EXPECT_THAT(ErrorOf(WithMesh("package://arm_description/link.stl"), {"/nowhere"}),
              AllOf(HasSubstr("link 'a'"),
                    HasSubstr("add the folder that holds the package 'arm_description' to "
                              "package_paths (now: /nowhere)")));
  EXPECT_THAT(ErrorOf(WithMesh("meshes/link.stl")), HasSubstr("meshes/link.stl' does not exist"));
}

TEST(RobotModel, MeshesAreFoundByAllNamesThatUrdfsHaveForThem) {
  const auto folder = FreshFolder() / "my arm";
  WriteFile(folder / "meshes" / "a link.stl", TetrahedronStl());
  const auto message = [&](const std::string& name) {
    const auto robot =
        RobotModel::FromUrdf(WriteFile(folder / "urdf" / "robot.urdf", WithMesh(name)));
    return robot.ok() ? "no error" : std::string(robot.status().message());
  };
  const std::string absolute = (folder / "meshes" / "a link.stl").string();
  for (const std::string& name :
       {std::string("../meshes/a link.stl"), absolute, "file://" + absolute,
        "file://localhost" + absolute, std::string("file://../meshes/a link.stl"),
        std::string("..\\meshes\\a link.stl"),
        "file://" + absl::StrReplaceAll(absolute, {{" ", "%20"}}),
        // Of packages, the folders above the URDF are known.
        std::string("package://my arm/meshes/a link.stl"),
        std::string("package://my%20arm/meshes/a%20link.stl"),
        std::string("model://my arm/meshes/a link.stl")}) {
    EXPECT_EQ(message(name), "no error") << name;
  }
  EXPECT_THAT(message("package://my arm/meshes/b.stl"),
              AllOf(HasSubstr("my arm' has no 'meshes/b.stl'; correct the name")));
  EXPECT_THAT(message("https://example.org/a.stl"), HasSubstr("cannot be fetched; copy it here"));
}

TEST(RobotModel, MeshInOtherUpperAndLowerCaseIsNamed) {
  const auto folder = FreshFolder() / "arm";
  WriteFile(folder / "Meshes" / "Link1.STL", TetrahedronStl());
  for (const std::string name : {"meshes/link1.stl", "package://arm/meshes/link1.stl"}) {
    const auto robot = RobotModel::FromUrdf(WriteFile(folder / "robot.urdf", WithMesh(name)));
    EXPECT_THAT(std::string(robot.status().message()),
                HasSubstr("arm/Meshes/Link1.STL', in other upper and lower case; correct"));
  }
  const auto other =
      RobotModel::FromUrdf(WriteFile(folder / "robot.urdf", WithMesh("meshes/link2.stl")));
  EXPECT_THAT(std::string(other.status().message()),
              HasSubstr("meshes/link2.stl' does not exist; correct"));
}

TEST(RobotModel, PackageIsFoundByTheNameInItsManifest) {
  const auto folder = FreshFolder() / "Arm_ROS2_Description";
  WriteFile(folder / "package.xml",
            "<?xml version='1.0'?><package format='3'><name>arm_description</name></package>");
  WriteFile(folder / "meshes/link.stl", TetrahedronStl());
  const std::string urdf =
      WriteFile(folder / "urdf/arm.urdf", WithMesh("package://arm_description/meshes/link.stl"));
  const auto robot = RobotModel::FromUrdf(urdf);
  EXPECT_TRUE(robot.ok()) << robot.status();
  WriteFile(folder / "package.xml", "<package>");
  EXPECT_THAT(std::string(RobotModel::FromUrdf(urdf).status().message()),
              HasSubstr("the folder that holds the package 'arm_description'"));
}

TEST(RobotModel, MeshThatIsScaledTwiceIsNamed) {
  const auto folder = FreshFolder();
  WriteFile(folder / "link.stl", TetrahedronStl());
  const std::string urdf =
      absl::StrReplaceAll(WithMesh("link.stl"), {{"2 2 0.5", "1e-6 1e-6 1e-6"}});
  const auto robot = RobotModel::FromUrdf(WriteFile(folder / "robot.urdf", urdf));
  EXPECT_THAT(std::string(robot.status().message()),
              AllOf(HasSubstr("link 'a'"), HasSubstr("1e-06 m long"), HasSubstr("scaled twice")));
}

TEST(RobotModel, MeshInMillimetresIsRefusedThoughItIsAsShortAsAGripper) {
  const auto folder = FreshFolder();
  WriteFile(folder / "link.stl", TetrahedronStl());
  const auto message = [&](const std::string& scale) {
    const std::string urdf = absl::StrReplaceAll(WithMesh("link.stl"), {{"2 2 0.5", scale}});
    const auto robot = RobotModel::FromUrdf(WriteFile(folder / "robot.urdf", urdf));
    return std::string(robot.status().message());
  };
  EXPECT_EQ(message("9 9 9"), "");
  EXPECT_THAT(message("90 90 90"),
              AllOf(HasSubstr("of link 'a' is 90 m, more than 10 m"),
                    HasSubstr("a mesh in millimetres needs scale=\"0.001 0.001 0.001\"")));
}

TEST(RobotModel, LimitsNeedARangeAndNothingElse) {
  const auto joint = [](const std::string& type, const std::string& more) {
    return OneJoint("<joint name='j' type='" + type + "'><parent link='a'/><child link='b'/>" +
                    more + "</joint>");
  };
  for (const std::string type : {"revolute", "prismatic"}) {
    EXPECT_EQ(ErrorOf(joint(type, "<limit lower='-1' upper='2'/>")), "no error");
    EXPECT_EQ(ErrorOf(joint(type, "<limit lower='-1' upper='2' effort='3'/>")), "no error");
    for (const std::string limit : {"", "<limit/>", "<limit effort='1' velocity='1'/>"}) {
      EXPECT_THAT(ErrorOf(joint(type, limit)),
                  AllOf(HasSubstr("joint 'j' has no limits; state <limit lower="),
                        HasSubstr(type == "revolute" ? "/>, or type=\"continuous\" if it turns"
                                                     : "/>, or type=\"fixed\" if it does not")));
    }
  }
  EXPECT_EQ(ErrorOf(joint("continuous", "<limit effort='1'/>")), "no error");
  // A joint that mimics another has that one's.
  EXPECT_EQ(ErrorOf("<robot name='r'><link name='a'/><link name='b'/><link name='c'/>"
                    "<joint name='j' type='prismatic'><parent link='a'/><child link='b'/>"
                    "<mimic joint='k'/></joint>"
                    "<joint name='k' type='prismatic'><parent link='a'/><child link='c'/>"
                    "<limit lower='0' upper='1'/></joint></robot>"),
            "no error");
}

TEST(RobotModel, RotationsInDegreesAreNamed) {
  const auto joint = [](const std::string& rpy) {
    return OneJoint(
        "<joint name='j' type='fixed'><parent link='a'/><child link='b'/><origin rpy='" + rpy +
        "'/></joint>");
  };
  EXPECT_EQ(ErrorOf(joint("0 -6.2832 0")), "no error");
  EXPECT_THAT(
      ErrorOf(joint("0 90 0")),
      HasSubstr("rpy=\"0 90 0\" turns by more than two turns; rotations in URDF are radians"));
  EXPECT_THAT(ErrorOf("<robot name='r'>\n<link name='a'><visual><origin rpy='0 0 -45'/><geometry>"
                      "<sphere radius='1'/></geometry></visual></link></robot>"),
              HasSubstr("bad.urdf:2: rpy=\"0 0 -45\""));
}

TEST(RobotModel, BrokenMeshIsNamed) {
  const auto folder = FreshFolder();
  WriteFile(folder / "link.stl", "this is no mesh");
  const auto robot = RobotModel::FromUrdf(WriteFile(folder / "robot.urdf", WithMesh("link.stl")));
  EXPECT_EQ(robot.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(robot.status().message()),
              AllOf(HasSubstr("link 'a'"), HasSubstr("link.stl")));
}

TEST(RobotModel, BadFilesAreOneSentence) {
  const auto missing = RobotModel::FromUrdf("/nowhere/robot.urdf");
  EXPECT_EQ(missing.status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(missing.status().message()), HasSubstr("/nowhere/robot.urdf"));
  EXPECT_THAT(ErrorOf("<robot name='r'>\n<link name='a'>\n</robot>"),
              HasSubstr("bad.urdf:3: not well-formed XML"));
  EXPECT_THAT(ErrorOf("<robot name='r'>\n<link name='a'>te"),
              AllOf(HasSubstr("bad.urdf"), HasSubstr("not well-formed XML"),
                    testing::Not(HasSubstr(":0:"))));
  EXPECT_THAT(ErrorOf("<world/>"), HasSubstr("not a valid URDF"));
  EXPECT_THAT(ErrorOf(""), HasSubstr("bad.urdf: the file is empty"));
  EXPECT_THAT(ErrorOf("<robot name='r'><link name='a'><visual>\n<geometry>"
                      "<mesh filename='a.stl' scale='x 1 1'/></geometry></visual></link></robot>"),
              HasSubstr("bad.urdf:2: scale=\"x 1 1\" is not three numbers"));
  EXPECT_THAT(ErrorOf("<robot name='r'><link name='a'/><link name='a'/></robot>"),
              HasSubstr("not unique"));
}

TEST(RobotModel, UnsupportedJointsAreNamed) {
  const std::string links = "<parent link='a'/><child link='b'/>";
  EXPECT_THAT(ErrorOf(OneJoint("<joint name='j' type='floating'>" + links + "</joint>")),
              HasSubstr("joint 'j' is of a type that is not supported; make it fixed"));
  EXPECT_THAT(ErrorOf(OneJoint("<joint name='j' type='revolute'>" + links +
                               "<limit lower='1' upper='-1' effort='1' velocity='1'/></joint>")),
              HasSubstr("lower limit of joint 'j'"));
  EXPECT_THAT(ErrorOf(OneJoint("<joint name='j' type='continuous'>" + links +
                               "<axis xyz='0 0 0'/></joint>")),
              HasSubstr("axis of joint 'j'"));
}

TEST(RobotModel, WhatOnlyDynamicsNeedNeedNotBeComplete) {
  EXPECT_EQ(ErrorOf("<robot name='r'><link name='a'><inertial/></link><link name='b'/>"
                    "<joint name='j' type='revolute'><parent link='a'/><child link='b'/>"
                    "<limit lower='-1' upper='2'/><dynamics/><calibration/>"
                    "<safety_controller soft_lower_limit='-1'/></joint></robot>"),
            "no error");
}

TEST(RobotModel, TextThatIsNotUtf8IsRefusedWithTheMend) {
  EXPECT_THAT(ErrorOf("<robot name='Gr\xfcn'><link name='a'/></robot>"),
              HasSubstr("not UTF-8; convert it, as in: iconv -f ISO-8859-1"));
  EXPECT_THAT(ErrorOf("\xff\xfe<"), HasSubstr("UTF-16; convert it, as in: iconv -f UTF-16"));
  EXPECT_EQ(ErrorOf("<robot name='Gr\xc3\xbcn'><link name='Arm 1/\xc3\xb6'/></robot>"), "no error");
}

TEST(RobotModel, CapsulesAreACylinderBetweenTwoSpheres) {
  const auto robot = RobotModel::FromUrdf(
      WriteFile(FreshFolder() / "r.urdf",
                "<robot name='r'><link name='a'>"
                "<visual><geometry><capsule radius='0.1' length='0.6'/></geometry>"
                "<origin xyz='1 2 3' rpy='0 1.5707963267948966 0.1'/></visual>"
                "<collision><geometry><capsule radius='0.2' length='1'/></geometry></collision>"
                "</link></robot>"));
  ASSERT_TRUE(robot.ok()) << robot.status();
  for (const auto& [bodies, radius, length] :
       {std::tuple(robot->links()[0].visual, 0.1, 0.6), {robot->links()[0].collision, 0.2, 1.0}}) {
    ASSERT_EQ(bodies.size(), 3u);
    const auto* cylinder = std::get_if<CylinderShape>(&bodies[0].shape);
    ASSERT_NE(cylinder, nullptr);
    EXPECT_EQ(cylinder->radius, radius);
    EXPECT_EQ(cylinder->length, length);
    for (const size_t end : {1u, 2u}) {
      const auto* sphere = std::get_if<SphereShape>(&bodies[end].shape);
      ASSERT_NE(sphere, nullptr);
      EXPECT_EQ(sphere->radius, radius);
      const double z = (end == 1 ? -0.5 : 0.5) * length;
      EXPECT_TRUE((bodies[0].link_from_shape * Eigen::Vector3d(0, 0, z))
                      .isApprox(bodies[end].link_from_shape.translation(), 1e-12));
    }
  }
  for (const std::string capsule : {"<capsule radius='0.1'/>", "<capsule length='0.1'/>",
                                    "<capsule radius='0,1' length='1'/>"}) {
    EXPECT_THAT(ErrorOf("<robot name='r'><link name='a'><visual><geometry>" + capsule +
                        "</geometry></visual></link></robot>"),
                HasSubstr("correct the element, or leave it out"));
  }
}

TEST(RobotModel, TextMeshThatIsCutOffIsNotTakenForAWholeOne) {
  const auto folder = FreshFolder();
  const std::string whole = TetrahedronStl();
  const std::string urdf = WriteFile(folder / "robot.urdf", WithMesh("link.STL"));
  const std::vector<std::string> texts = {whole, absl::StrReplaceAll(whole, {{"\n", "\r\n"}}),
                                          absl::StrReplaceAll(whole, {{"endsolid", "ENDSOLID"}}),
                                          whole + "\n\n"};
  for (const std::string& text : texts) {
    WriteFile(folder / "link.STL", text);
    EXPECT_TRUE(RobotModel::FromUrdf(urdf).ok()) << RobotModel::FromUrdf(urdf).status();
  }
  const auto error = [&](size_t size) {
    WriteFile(folder / "link.STL", whole.substr(0, size));
    return std::string(RobotModel::FromUrdf(urdf).status().message());
  };
  for (const size_t size : {whole.rfind("facet normal"), whole.rfind("solid"), whole.size() - 9,
                            whole.rfind("vertex")}) {
    EXPECT_THAT(error(size), HasSubstr("link.STL' is cut off: it does not end with 'endsolid'"))
        << size;
  }
  WriteFile(folder / "link.STL", whole + whole.substr(0, whole.find("facet")));
  EXPECT_THAT(std::string(RobotModel::FromUrdf(urdf).status().message()), HasSubstr("is cut off"))
      << "the second solid";
}

// What a robot with this mesh is refused for; empty: it is not.
std::string RefusalOf(const std::string& file, const std::string& mesh) {
  const auto folder = FreshFolder();
  WriteFile(folder / file, mesh);
  const auto robot = RobotModel::FromUrdf(WriteFile(folder / "robot.urdf", WithMesh(file)));
  return std::string(robot.status().message());
}

TEST(RobotModel, BinaryMeshWithBytesTooFewOrTooManyIsRefusedForThat) {
  for (const std::string begin : {"part", "solid part"}) {
    std::string mesh = begin + std::string(80 - begin.size(), ' ');
    const auto add = [&mesh](uint32_t bits) {
      for (int i = 0; i < 4; ++i) mesh += static_cast<char>(bits >> 8 * i & 255);
    };
    const std::vector<std::array<int, 3>> triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
    add(static_cast<uint32_t>(triangles.size()));
    for (const std::array<int, 3>& corners : triangles) {
      for (int axis = 0; axis < 3; ++axis) add(0);  // the normal
      for (const int corner : corners) {
        for (int axis = 1; axis <= 3; ++axis) add(corner == axis ? 0x3f800000 : 0);
      }
      mesh += std::string(2, '\0');
    }
    EXPECT_EQ(RefusalOf("link.stl", mesh), "");
    EXPECT_THAT(RefusalOf("link.stl", mesh + "\n"), HasSubstr("has bytes after its last triangle"));
    for (const size_t less : {1, 50, 51}) {
      EXPECT_THAT(RefusalOf("link.stl", mesh.substr(0, mesh.size() - less)),
                  HasSubstr("is cut off"));
    }
  }
}

TEST(RobotModel, MeshWithAVertexThatIsNoNumberIsRefusedWhereverItStands) {
  const std::string mesh = TetrahedronStl();
  for (const std::string number : {"nan", "-nan", "1.#QNAN", "inf"}) {
    for (size_t at = mesh.find("vertex"); at != mesh.npos; at = mesh.find("vertex", at + 1)) {
      std::string bad = mesh;
      bad.replace(bad.find(' ', at) + 1, 1, number);
      EXPECT_THAT(RefusalOf("link.stl", bad), HasSubstr("no number; export"))
          << number << " at " << at;
    }
  }
}

TEST(RobotModel, LinksThatHaveOneMeshInTwoSizesHaveTheirOwn) {
  const auto folder = FreshFolder();
  WriteFile(folder / "link.stl", TetrahedronStl());
  std::string urdf = "<robot name=\"r\">";
  for (const std::string scale : {"1 1 1", "2 2 2", "1 1 1"}) {
    const std::string name = "l" + std::to_string(urdf.size());
    urdf += "<link name=\"" + name + "\"><visual><geometry><mesh filename=\"link.stl\" scale=\"" +
            scale + "\"/></geometry></visual></link>";
    if (name != "l16") {
      urdf += "<joint name=\"j" + name + "\" type=\"fixed\"><parent link=\"l16\"/><child link=\"" +
              name + "\"/></joint>";
    }
  }
  const auto robot = RobotModel::FromUrdf(WriteFile(folder / "robot.urdf", urdf + "</robot>"));
  ASSERT_TRUE(robot.ok()) << robot.status();
  std::vector<double> sizes;
  for (const RobotLink& link : robot->links()) {
    const auto& mesh = std::get<MeshShape>(link.body()[0].shape).mesh;
    Eigen::AlignedBox3d box;
    for (const auto& vertex : mesh->vertices) box.extend(vertex);
    sizes.push_back(box.sizes().maxCoeff());
  }
  ASSERT_EQ(sizes.size(), 3u);
  EXPECT_EQ(sizes[1], 2 * sizes[0]);
  EXPECT_EQ(sizes[2], sizes[0]);
}

// The rest of such faces would be missing from the robot.
TEST(RobotModel, MeshWithFacesThatAreNotReadWholeIsRefused) {
  const std::string whole = TetrahedronStl();
  EXPECT_EQ(RefusalOf("link.stl", absl::StrReplaceAll(whole, {{"solid t", "solid vertex"}})), "");
  const std::string quad =
      absl::StrReplaceAll(whole, {{"vertex 0 0 0\n", "vertex 0 0 0\nvertex -1 0 0\n"}});
  EXPECT_THAT(RefusalOf("link.stl", quad),
              HasSubstr("link.stl' has a facet of other than three corners; export it again with "
                        "triangles only"));
  EXPECT_THAT(RefusalOf("link.ply",
                        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float "
                        "y\nproperty float z\nelement face 1\nproperty list uchar int "
                        "vertex_indices\nelement tristrips 1\nproperty list int int "
                        "vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n4 0 1 2 "
                        "3\n"),
              HasSubstr("link.ply' has triangle strips, which are not read; export it again with "
                        "faces"));
}

TEST(RobotModel, PlyMeshWithLessThanItsHeaderCountsIsRefused) {
  const auto header = [](const std::string& format) {
    return "ply\nformat " + format +
           " 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
           "element face 4\nproperty list uchar int vertex_indices\nend_header\n";
  };
  const std::string text =
      header("ascii") + "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
  EXPECT_EQ(RefusalOf("link.ply", text), "");
  EXPECT_THAT(RefusalOf("link.ply", text.substr(0, text.rfind('3') - 1)),
              HasSubstr("link.ply' is cut off: its header counts 4 'face', 3 are there"));
  EXPECT_THAT(RefusalOf("link.ply", text.substr(0, text.rfind("3 1"))),
              HasSubstr("counts 4 'face', 3 are there; copy or export it again"));

  for (const bool big : {false, true}) {
    std::string binary = header(big ? "binary_big_endian" : "binary_little_endian");
    const auto add = [&](uint32_t bits) {
      for (int i = 0; i < 4; ++i) {
        binary += static_cast<char>(bits >> 8 * (big ? 3 - i : i) & 255);
      }
    };
    for (int i = 0; i < 12; ++i) add(i == 3 || i == 7 || i == 11 ? 0x3f800000 : 0);
    for (const auto& corners :
         std::vector<std::array<uint32_t, 3>>{{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}) {
      binary += '\3';
      for (const uint32_t corner : corners) add(corner);
    }
    EXPECT_EQ(RefusalOf("link.ply", binary), "") << big;
    for (const size_t less : {1, 5, 13, 40}) {
      EXPECT_THAT(RefusalOf("link.ply", binary.substr(0, binary.size() - less)),
                  HasSubstr("is cut off"))
          << big << ", " << less;
    }
  }
}

TEST(RobotModel, ObjMeshWhoseEndIsMissingIsRefusedWhereItShows) {
  const std::string whole =
      "o t\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 1 1 1\n"
      "f 1 3\nf 1 3 2\nf 1/1/1 2//2 4\nf 1 4 3\nf -4 -3 -2\nf 2 3 \\\n5\n";
  EXPECT_EQ(RefusalOf("link.obj", whole), "");
  EXPECT_EQ(RefusalOf("link.obj", whole.substr(0, whole.size() - 1)), "") << "no last line feed";
  EXPECT_EQ(RefusalOf("link.obj",
                      "v 4 4 4\n" + whole.substr(0, whole.find("f 1 4")) + "f 2 3 5\nv 0 0 0\n"),
            "")
      << "vertices for markers";
  EXPECT_THAT(RefusalOf("link.obj", whole.substr(0, whole.find("f 1/")) + "v 1 1 2\nv 1 1 3\n"),
              HasSubstr("has 7 vertices, of which the last 4 are in no face; its end may be"));
  EXPECT_THAT(RefusalOf("link.obj", whole.substr(0, whole.rfind("3 \\"))),
              HasSubstr("has a last face of fewer than three corners in line 12"));
  EXPECT_THAT(RefusalOf("link.obj", whole + "f 1 2 6\n"),
              HasSubstr("has 5 vertices, but names number 6 in line 14"));
  EXPECT_THAT(RefusalOf("link.obj", whole.substr(0, whole.find("f 1"))),
              HasSubstr("the last 5 are in no face"));
}

TEST(RobotModel, ColladaMeshThatASkinPlacesIsRefused) {
  const auto skinned = [](const std::string& matrix, bool used = true) {
    return absl::StrReplaceAll(
        TriangleDae("Z_UP"),
        {{"<library_visual_scenes>",
          "<library_controllers><controller id=\"c\"><skin source=\"#g\">"
          "<bind_shape_matrix>" +
              matrix +
              "</bind_shape_matrix></skin></controller>"
              "</library_controllers><!-- " +
              (used ? "instance_controller" : "") + " --><library_visual_scenes>"}});
  };
  EXPECT_EQ(RefusalOf("link.dae", skinned("1 0 0 1.2e-7 0 1 0 0 0 0 1.0 0 0 0 0 1")), "");
  EXPECT_EQ(RefusalOf("link.dae", skinned("1 0 0 0.3 0 1 0 0 0 0 1 0 0 0 0 1", false)), "");
  EXPECT_THAT(RefusalOf("link.dae", skinned("1 0 0 0.3 0 1 0 0 0 0 1 0 0 0 0 1")),
              HasSubstr("link.dae' is placed by the bind_shape_matrix of a skin"));
}

TEST(RobotModel, MeshThatGitLfsHasNotFetchedIsNamedWithTheMend) {
  const auto folder = FreshFolder();
  WriteFile(folder / "link.stl", "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\n");
  const auto robot = RobotModel::FromUrdf(WriteFile(folder / "robot.urdf", WithMesh("link.stl")));
  EXPECT_THAT(std::string(robot.status().message()), HasSubstr("git lfs pull"));
}

TEST(RobotModel, AJointThatFollowsAnotherIsSaidToFollowIt) {
  const std::string urdf = TestFolder() / "r.urdf";
  std::ofstream(urdf) << "<robot name='r'><link name='a'/><link name='b'/><link name='c'/>"
                         "<joint name='j' type='prismatic'><parent link='a'/><child link='b'/>"
                         "<mimic joint='k'/></joint>"
                         "<joint name='k' type='prismatic'><parent link='a'/><child link='c'/>"
                         "<limit lower='0' upper='1'/></joint></robot>";
  const auto robot = RobotModel::FromUrdf(urdf);
  ASSERT_TRUE(robot.ok()) << robot.status();
  const std::vector<std::string> names = {"k", "j"};
  const std::vector<double> values = {0.5, 0.5};
  EXPECT_EQ(robot->Positions(names, values).status().message(),
            "the joint 'j' of the robot 'r' follows 'k' (mimic) and has no value of its own; "
            "leave it out");
}

TEST(RobotModel, MimicsOfWhatTheyCannotAreNamed) {
  const auto error = [](const std::string& first, const std::string& type,
                        const std::string& second, const std::string& own = "revolute") {
    const std::string limit = "<limit lower='-1' upper='1' effort='1' velocity='1'/>";
    return ErrorOf(
        "<robot name='r'><link name='a'/><link name='b'/><link name='c'/>"
        "<joint name='j' type='" +
        own + "'><parent link='a'/><child link='b'/>" + limit + first +
        "</joint><joint name='k' type='" + type + "'><parent link='a'/><child link='c'/>" + limit +
        second + "</joint></robot>");
  };
  EXPECT_EQ(error("<mimic joint='k'/>", "revolute", ""), "no error");
  EXPECT_EQ(error("<mimic joint='k'/>", "prismatic", ""), "no error");
  EXPECT_THAT(error("<mimic joint='x'/>", "revolute", ""),
              HasSubstr("joint 'j' mimics 'x', which is not there; name a joint that moves"));
  EXPECT_THAT(error("<mimic joint='j'/>", "revolute", ""),
              HasSubstr("joint 'j' mimics itself; name a joint"));
  EXPECT_THAT(error("<mimic joint='k'/>", "revolute", "<mimic joint='j'/>"),
              HasSubstr("mimics itself"));
  EXPECT_THAT(error("<mimic joint='k'/>", "fixed", ""),
              HasSubstr("joint 'j' mimics 'k', which is fixed"));
  EXPECT_THAT(error("<mimic joint='k'/>", "fixed", "<mimic joint='j'/>"), HasSubstr("is fixed"));
  // A whole turn of a continuous joint changes nothing.
  EXPECT_EQ(
      error("<mimic joint='k' multiplier='-2' offset='0.3'/>", "continuous", "", "continuous"),
      "no error");
  EXPECT_THAT(error("<mimic joint='k' multiplier='-2'/>", "continuous", ""),
              HasSubstr("joint 'j' has limits, but mimics 'k', which turns without end"));
  EXPECT_THAT(error("<mimic joint='k' multiplier='0.5'/>", "continuous", ""),
              HasSubstr("joint 'j' mimics 'k', which turns without end"));
  EXPECT_THAT(error("<mimic joint='k' multiplier='nan'/>", "revolute", ""), HasSubstr("bad.urdf"));
  EXPECT_THAT(error("<mimic joint='k' offset='3'/>", "revolute", ""),
              HasSubstr("joint 'j' is beyond its own limits wherever 'k', which it mimics, may"));
  EXPECT_THAT(error("<mimic joint='k' multiplier='0' offset='3'/>", "revolute", ""),
              HasSubstr("beyond its own limits"));
  EXPECT_THAT(error("<mimic joint='k' multiplier='1e300'/>", "revolute", ""),
              HasSubstr("joint 'j' mimics another by a multiplier or offset above 1000"));
}

TEST(RobotModel, FactorsOfMimicsInARowThatOverflowAreNamed) {
  std::string urdf = "<robot name='r'><link name='l0'/>";
  for (int i = 1; i <= 300; ++i) {
    const std::string number = std::to_string(i);
    urdf += "<link name='l" + number + "'/><joint name='j" + number +
            "' type='revolute'><parent link='l" + std::to_string(i - 1) + "'/><child link='l" +
            number + "'/><limit effort='1' velocity='1' lower='0' upper='0'/>" +
            (i == 300 ? "" : "<mimic multiplier='20' joint='j" + std::to_string(i + 1) + "'/>") +
            "</joint>";
  }
  EXPECT_THAT(ErrorOf(urdf + "</robot>"), HasSubstr("multiplier or offset above 1000"));
}

TEST(RobotModel, JointThatOthersMimicStaysWithinTheirLimits) {
  const auto limits = [](const std::string& limit, const std::string& mimic) {
    const std::string urdf =
        "<robot name='r'><link name='a'/><link name='b'/><link name='c'/>"
        "<joint name='j' type='revolute'><parent link='a'/><child link='b'/>" +
        limit + mimic +
        "</joint><joint name='k' type='revolute'><parent link='a'/><child link='c'/>"
        "<limit lower='0' upper='1' effort='1' velocity='1'/></joint></robot>";
    const auto robot = RobotModel::FromUrdf(WriteFile(FreshFolder() / "r.urdf", urdf));
    EXPECT_TRUE(robot.ok()) << robot.status();
    const RobotJoint& joint = robot->joints()[0];
    return std::pair(joint.lower, joint.upper);
  };
  const std::string of_j = "<limit lower='-0.5' upper='0.4' effort='1' velocity='1'/>";
  EXPECT_EQ(limits(of_j, "<mimic joint='k'/>"), std::pair(0.0, 0.4));
  EXPECT_EQ(limits(of_j, "<mimic joint='k' multiplier='-1'/>"), std::pair(0.0, 0.5));
  EXPECT_EQ(limits(of_j, "<mimic joint='k' multiplier='2' offset='-1'/>"), std::pair(0.25, 0.7));
  EXPECT_EQ(limits(of_j, "<mimic joint='k' multiplier='0.1'/>"), std::pair(0.0, 1.0));
  // Many files leave them out.
  EXPECT_EQ(limits("<limit effort='1' velocity='1'/>", "<mimic joint='k' multiplier='-1'/>"),
            std::pair(0.0, 1.0));
}

TEST(RobotModel, JointThatMimicsByNoNumbersMovesAsTheOther) {
  const std::string urdf =
      "<robot name='r'><link name='a'/><link name='b'/><link name='c'/>"
      "<joint name='j' type='revolute'><parent link='a'/><child link='b'/><mimic joint='k'/>"
      "<limit lower='0' upper='1' effort='1' velocity='1'/></joint>"
      "<joint name='k' type='revolute'><parent link='a'/><child link='c'/>"
      "<limit lower='0' upper='1' effort='1' velocity='1'/></joint></robot>";
  const auto robot = RobotModel::FromUrdf(WriteFile(FreshFolder() / "r.urdf", urdf));
  ASSERT_TRUE(robot.ok()) << robot.status();
  ASSERT_EQ(robot->joints().size(), 1u);
  EXPECT_EQ(robot->joints()[0].name, "k");
  const auto poses = robot->LinkPoses(std::vector<double>{0.7});
  EXPECT_TRUE(poses[1].isApprox(poses[2]));
  EXPECT_FALSE(poses[1].isApprox(poses[0]));
}

TEST(RobotModel, XacroIsToBeExpandedFirst) {
  const auto error = [](const std::string& name, const std::string& urdf) {
    const auto model = RobotModel::FromUrdf(WriteFile(FreshFolder() / name, urdf));
    return model.ok() ? "no error" : std::string(model.status().message());
  };
  const std::string with_macro =
      "<robot name='r' xmlns:xacro='http://ros.org/xacro'><xacro:arm prefix=''/></robot>";
  EXPECT_THAT(error("r.urdf.xacro", with_macro),
              testing::MatchesRegex(".*: this is xacro; expand it first: xacro .*/r.urdf.xacro > "
                                    "r.urdf"));
  EXPECT_THAT(error("r.xacro", with_macro), testing::EndsWith(" > r.urdf"));
  EXPECT_THAT(error("r.urdf", with_macro), testing::EndsWith(" > r_expanded.urdf"));
  EXPECT_THAT(error("r.urdf", "<robot name='r'><link name='${prefix}base'/></robot>"),
              HasSubstr("this is xacro"));
  // What xacro writes declares its namespace still.
  EXPECT_EQ(error("r.urdf",
                  "<robot name='r' xmlns:xacro='http://ros.org/xacro'><link name='a'/>"
                  "<gazebo><plugin filename='$(find x)'/></gazebo></robot>"),
            "no error");
}

TEST(RobotModel, ShapesWithoutSizeAreRefused) {
  EXPECT_THAT(ErrorOf("<robot name='r'><link name='a'><visual><geometry><box size='1 0 1'/>"
                      "</geometry></visual></link></robot>"),
              HasSubstr("a box of link 'a' has no size"));
}

TEST(RobotModel, ShapesThatCannotBeReadAreNamedAndNeverLeftOut) {
  for (const std::string number : {"nan", "inf", "wide"}) {
    EXPECT_THAT(ErrorOf("<robot name='r'><link name='a'><visual><geometry><box size='" + number +
                        " 1 1'/></geometry></visual></link></robot>"),
                AllOf(HasSubstr("[" + number + "]"), HasSubstr("Link [a]")));
    EXPECT_THAT(ErrorOf("<robot name='r'><link name='a'><visual><origin xyz='0 0 " + number +
                        "'/><geometry><box size='1 1 1'/></geometry></visual></link></robot>"),
                HasSubstr("[" + number + "]"));
  }
  EXPECT_THAT(ErrorOf("<robot name='r'><link name='a'><collision><geometry><torus radius='1' "
                      "length='2'/></geometry></collision></link></robot>"),
              HasSubstr("'torus'"));
  EXPECT_THAT(
      ErrorOf("<robot name='r'>\n<link name='a'><visual><geometry><box size='1 1 1'/>"
              "<sphere radius='1'/></geometry></visual></link></robot>"),
      HasSubstr("bad.urdf:2: link 'a' has a <visual> or <collision> of more than one shape"));
  EXPECT_THAT(
      ErrorOf("<robot name='r'><link name='a'><visual><geometry><box size='1 1 1'/></geometry>"
              "<geometry><sphere radius='1'/></geometry></visual></link></robot>"),
      HasSubstr("of more than one shape; give each one of its own"));
}

TEST(RobotModel, LengthsThatNoRobotHasAreNamedWithTheUnit) {
  const auto error = [](const std::string& origin, const std::string& geometry) {
    return ErrorOf("<robot name='r'><link name='a'><visual><origin xyz='" + origin +
                   "'/><geometry>" + geometry + "</geometry></visual></link></robot>");
  };
  const std::string box = "<box size='1 1 1'/>";
  EXPECT_EQ(error("0 0 0", box), "no error");
  EXPECT_THAT(error("0 0 0", "<box size='300 100 100'/>"),
              AllOf(HasSubstr("a box of link 'a' is 300 m"), HasSubstr("are metres")));
  EXPECT_THAT(error("0 0 0", "<cylinder radius='50' length='400'/>"), HasSubstr("is 400 m"));
  EXPECT_THAT(error("0 0 0", "<sphere radius='200'/>"), HasSubstr("is 200 m"));
  EXPECT_THAT(error("300 0 0", box), HasSubstr("origin in link 'a' is 300 m"));
  const std::string limit = "<limit lower='-1' upper='1' effort='1' velocity='1'/>";
  EXPECT_THAT(ErrorOf(OneJoint("<joint name='j' type='revolute'><parent link='a'/>"
                               "<child link='b'/><origin xyz='0 0 500'/>" +
                               limit + "</joint>")),
              HasSubstr("the origin of joint 'j' is 500 m"));
  EXPECT_THAT(ErrorOf(OneJoint("<joint name='j' type='prismatic'><parent link='a'/>"
                               "<child link='b'/><limit lower='-500' upper='500'/></joint>")),
              HasSubstr("the range of joint 'j' is 1000 m"));
  const auto folder = FreshFolder();
  WriteFile(folder / "link.stl", TetrahedronStl());
  const auto robot = RobotModel::FromUrdf(
      WriteFile(folder / "r.urdf",
                "<robot name='r'><link name='a'><visual><geometry><mesh filename='link.stl' "
                "scale='400 400 400'/></geometry></visual></link></robot>"));
  EXPECT_THAT(std::string(robot.status().message()),
              AllOf(HasSubstr("link.stl' of link 'a' is 400 m"), HasSubstr("scale=\"0.001")));
}

// Sum of the signed volumes of the tetrahedra between the origin and the triangles.
double Volume(const TriangleMesh& mesh) {
  double volume = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    volume += mesh.vertices[a].dot(mesh.vertices[b].cross(mesh.vertices[c])) / 6;
  }
  return volume;
}

TEST(TriangleMesh, PrimitivesAreClosedAndFaceOutward) {
  const double pi = std::numbers::pi;
  EXPECT_NEAR(Volume(BoxMesh({1, 2, 3})), 6, 1e-12);
  EXPECT_NEAR(Volume(CylinderMesh(0.5, 2)) / (pi * 0.25 * 2), 1, 0.005);
  EXPECT_NEAR(Volume(SphereMesh(0.5)) / (4 * pi / 3 * 0.125), 1, 0.01);
  EXPECT_NEAR(Volume(CapsuleMesh(0.5, 2)) / (4 * pi / 3 * 0.125 + pi * 0.25 * 2), 1, 0.01);
  for (const TriangleMesh& mesh :
       {BoxMesh({1, 2, 3}), CylinderMesh(1, 1), SphereMesh(1), CapsuleMesh(1, 1)}) {
    // Closed: the area vectors add up to nothing.
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const auto& [a, b, c] : mesh.triangles) {
      sum += (mesh.vertices[b] - mesh.vertices[a]).cross(mesh.vertices[c] - mesh.vertices[a]);
    }
    EXPECT_LT(sum.norm(), 1e-12);
  }
}

}  // namespace
}  // namespace silhouette
