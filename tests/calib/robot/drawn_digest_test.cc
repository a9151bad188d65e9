// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/drawn_digest.h"

#include <gtest/gtest.h>

#include <functional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace silhouette {
namespace {

// What a drawn robot is made of, to be changed.
struct Pieces {
  std::vector<ChainJoint> joints = {{.name = "one", .lower = -1, .upper = 1},
                                    {.name = "two", .lower = 0, .upper = 0.5}};
  std::vector<ChainLink> links = std::vector<ChainLink>(3);
  std::vector<RobotPart> parts = std::vector<RobotPart>(2);
  CameraIntrinsics intrinsics{
      .width = 64, .height = 48, .fx = 60, .fy = 61, .cx = 31, .cy = 23, .distortion = {}};
  Eigen::Isometry3d camera_from_world = Eigen::Isometry3d(Eigen::Translation3d(0, 0, 3));
  MaskSize size{64, 48};
  double margin = 0.5;

  Pieces() {
    for (int i : {1, 2}) links[static_cast<size_t>(i)].parent = i - 1;
    for (int i : {1, 2}) links[static_cast<size_t>(i)].joint = i - 1;
    for (size_t i : {0, 1}) {
      parts[i].link = parts[i].moves_with = i + 1;
      parts[i].points = Eigen::Matrix3Xd::Random(3, 4);
      parts[i].inner = 0.5 * parts[i].points;
      parts[i].radius = 0.1;
    }
  }

  std::string Digest() const {
    const PartDrawer view({intrinsics, camera_from_world}, size, margin);
    return DigestOf(DrawnRobot(KinematicChain(joints, links), parts, {view, view}));
  }
};

TEST(DrawnDigest, EqualRobotsHaveOneDigest) {
  const Pieces pieces;
  EXPECT_EQ(pieces.Digest(), pieces.Digest());
  EXPECT_EQ(pieces.Digest().size(), 32u);
  Pieces rounded = pieces;
  rounded.parts[0].points(1, 2) *= 1 + 1e-15;
  rounded.links[1].offset = -0.0;
  EXPECT_EQ(rounded.Digest(), pieces.Digest());
}

TEST(DrawnDigest, EverySingleChangeGivesAnotherDigest) {
  const Pieces pieces;
  const std::vector<std::function<void(Pieces&)>> changes = {
      [](Pieces& p) { p.joints[0].name = "three"; },
      [](Pieces& p) { p.joints[0].lower = -1.01; },
      [](Pieces& p) { p.joints[1].upper = 0.501; },
      [](Pieces& p) { p.joints[1].continuous = true; },
      [](Pieces& p) { p.links[2].parent = 0; },
      [](Pieces& p) { p.links[2].joint = 0; },
      [](Pieces& p) { p.links[2].slides = true; },
      [](Pieces& p) { p.links[2].factor = -1; },
      [](Pieces& p) { p.links[2].offset = 1e-6; },
      [](Pieces& p) { p.links[1].axis = Eigen::Vector3d::UnitX(); },
      [](Pieces& p) { p.links[1].parent_from_link.translation().y() += 1e-6; },
      [](Pieces& p) {
        p.links[1].parent_from_link.rotate(Eigen::AngleAxisd(1e-6, Eigen::Vector3d::UnitZ()));
      },
      [](Pieces& p) { p.links.push_back(p.links[2]); },
      [](Pieces& p) { p.parts.pop_back(); },
      [](Pieces& p) { p.parts[1].link = 0; },
      [](Pieces& p) { p.parts[1].moves_with = 0; },
      [](Pieces& p) { p.parts[1].radius += 1e-6; },
      [](Pieces& p) { p.parts[1].points(2, 3) += 1e-6; },
      [](Pieces& p) { p.parts[1].inner(2, 3) += 1e-6; },
      [](Pieces& p) { p.parts[1].inner.resize(3, 0); },
      [](Pieces& p) { std::swap(p.parts[0], p.parts[1]); },
      [](Pieces& p) { p.intrinsics.fx += 1e-6; },
      [](Pieces& p) { p.intrinsics.cy += 1e-6; },
      [](Pieces& p) { p.intrinsics.distortion[7] += 1e-6; },
      [](Pieces& p) { p.camera_from_world.translation().x() += 1e-6; },
      [](Pieces& p) {
        p.camera_from_world.rotate(Eigen::AngleAxisd(1e-6, Eigen::Vector3d::UnitX()));
      },
      [](Pieces& p) {
        p.size = {32, 24};
      },
      [](Pieces& p) { p.margin = 0.51; },
  };
  std::set<std::string> digests = {pieces.Digest()};
  for (size_t i = 0; i < changes.size(); ++i) {
    Pieces changed = pieces;
    changes[i](changed);
    EXPECT_TRUE(digests.insert(changed.Digest()).second) << "change " << i;
  }
}

}  // namespace
}  // namespace silhouette
