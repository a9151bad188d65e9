// SPDX-License-Identifier: Apache-2.0
// URDF files and meshes for tests.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "calib/robot/robot_model.h"
#include "tests/test_folder.h"

namespace silhouette {

// A tetrahedron as text STL: corners (0,0,0), (1,0,0), (0,1,0), (0,0,1).
inline std::string TetrahedronStl() {
  const auto facet = [](const std::string& a, const std::string& b, const std::string& c) {
    return "facet normal 0 0 0\nouter loop\nvertex " + a + "\nvertex " + b + "\nvertex " + c +
           "\nendloop\nendfacet\n";
  };
  const std::string o = "0 0 0", x = "1 0 0", y = "0 1 0", z = "0 0 1";
  return "solid t\n" + facet(o, y, x) + facet(o, x, z) + facet(o, z, y) + facet(x, y, z) +
         "endsolid t\n";
}

// A triangle as Collada, in centimetres: corners (0,0,0), (100,0,0), (0,0,200). `up`: the file's up
// axis, "Y_UP" or "Z_UP".
inline std::string TriangleDae(const std::string& up) {
  return R"(<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit name="centimeter" meter="0.01"/><up_axis>)" +
         up + R"(</up_axis></asset>
  <library_geometries><geometry id="g" name="g"><mesh>
    <source id="p"><float_array id="a" count="9">0 0 0 100 0 0 0 0 200</float_array>
      <technique_common><accessor source="#a" count="3" stride="3">
        <param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
      </accessor></technique_common></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="s"><node id="n"><instance_geometry url="#g"/></node>
  </visual_scene></library_visual_scenes>
  <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>
)";
}

// Three links in a row: joint `turn` about z at height 1, joint `bend` about y 0.5 further out
// along x, then a forearm of 0.4 along x, joint `slide` along x at its end with a ball on it.
inline std::string ThreeJointUrdf() {
  return R"(<?xml version="1.0"?>
<robot name="three">
  <material name="sand"><color rgba="1 0.75 0.5 1"/></material>
  <link name="base"/>
  <link name="upper">
    <visual><geometry><box size="0.5 0.1 0.2"/></geometry><origin xyz="0.25 0 0"/>
      <material name="sand"/></visual>
  </link>
  <link name="forearm">
    <collision><geometry><cylinder radius="0.03" length="0.4"/></geometry>
      <origin xyz="0.2 0 0" rpy="0 1.5707963267948966 0"/></collision>
  </link>
  <link name="tool">
    <visual><geometry><sphere radius="0.05"/></geometry></visual>
  </link>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="upper"/><origin xyz="0 0 1"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/>
  </joint>
  <joint name="bend" type="continuous">
    <parent link="upper"/><child link="forearm"/><origin xyz="0.5 0 0"/><axis xyz="0 1 0"/>
  </joint>
  <joint name="slide" type="prismatic">
    <parent link="forearm"/><child link="tool"/><origin xyz="0.4 0 0"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0.3" effort="1" velocity="1"/>
  </joint>
</robot>
)";
}

inline RobotModel ThreeJoints() {
  return RobotModel::FromUrdf(WriteFile(FreshFolder() / "three.urdf", ThreeJointUrdf())).value();
}

// Seven joints, of which the first slides, and a gripper of two fingers, of which one mimics the
// other; a tip on it turns as that finger slides. `mimic`: else each is a joint of its own.
inline std::string GripperUrdf(bool mimic = true) {
  std::string urdf = "<robot name='gripper'><link name='link0'/>";
  const auto joint = [&](const std::string& name, const std::string& type,
                         const std::string& parent, const std::string& child,
                         const std::string& origin, const std::string& axis,
                         const std::string& mimicked) {
    const std::string limits =
        mimicked.empty() ? "lower='-0.1' upper='0.4'" : "lower='-2' upper='2'";
    urdf += "<link name='" + child + "'><visual><origin xyz='0.04 0.02 0.03' rpy='0.3 0.2 0.1'/>" +
            "<geometry><box size='0.12 0.05 0.07'/></geometry></visual></link><joint name='" +
            name + "' type='" + type + "'><parent link='" + parent + "'/><child link='" + child +
            "'/><origin " + origin + "/><axis xyz='" + axis + "'/><limit " + limits +
            " effort='1' velocity='1'/>" + (mimic ? mimicked : "") + "</joint>";
  };
  for (int i = 0; i < 7; ++i) {
    joint("joint" + std::to_string(i), i == 0 ? "prismatic" : "revolute",
          "link" + std::to_string(i), "link" + std::to_string(i + 1),
          "xyz='0.1 0 0.15' rpy='0 0.2 0.1'", i % 2 == 0 ? "0 0 1" : "0.6 0.8 0", "");
  }
  joint("left", "prismatic", "link7", "left_finger", "xyz='0 0 0.1'", "0 1 0", "");
  joint("right", "prismatic", "link7", "right_finger", "xyz='0 0 0.1'", "0 1 0",
        "<mimic joint='left' multiplier='-1' offset='0.01'/>");
  joint("tip", "revolute", "right_finger", "tip", "xyz='0 0 0.1'", "0 0 1",
        "<mimic joint='right' multiplier='3' offset='0.2'/>");
  return urdf + "</robot>";
}

inline RobotModel Gripper(bool mimic = true) {
  return RobotModel::FromUrdf(WriteFile(FreshFolder() / "gripper.urdf", GripperUrdf(mimic)))
      .value();
}

// The values of the joints of Gripper(false) at those of Gripper(true).
inline std::vector<double> WithMimics(std::vector<double> q) {
  q.push_back(0.01 - q.back());
  q.push_back(0.2 + 3 * q.back());
  return q;
}

}  // namespace silhouette
