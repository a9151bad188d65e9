// SPDX-License-Identifier: Apache-2.0
// KinematicChain: where the links of a robot are at given joint values, and how far joints move
// them at most. Uses the standard library and Eigen alone.
//
// Lengths in metres, angles in radians. Cannot be changed once made; used by any number of threads.
#pragma once

#include <Eigen/Geometry>
#include <span>
#include <string>
#include <vector>

namespace silhouette {

// Values that are beyond a joint's limit by no more than this are at it.
inline constexpr double kLimitTolerance = 1e-6;

struct ChainJoint {
  std::string name;
  double lower = 0;
  double upper = 0;
  bool continuous = false;  // turns without end; limits do not count
};

// A link as it hangs on its parent.
struct ChainLink {
  int parent = -1;  // index of the parent link, which stands before this; -1: the base
  int joint = -1;   // index of the joint that moves it against its parent; -1: it is fixed
  bool slides = false;
  // The joint's value moves the link by factor * value + offset: of a joint that mimics another.
  double factor = 1;
  double offset = 0;
  Eigen::Isometry3d parent_from_link = Eigen::Isometry3d::Identity();  // moved by nothing
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();                     // unit, in the link's frame
};

// The link's pose in its parent's frame while its joint stands at `value`.
Eigen::Isometry3d ParentFromLink(const ChainLink& link, double value);

class KinematicChain {
 public:
  // Throws std::invalid_argument if a link stands before its parent, the first has one, another has
  // none, a joint is not there, limits are not in order, a number is not finite, an axis is not of
  // unit length, or a link slides without end.
  KinematicChain(std::vector<ChainJoint> joints, std::vector<ChainLink> links);

  std::span<const ChainJoint> joints() const { return joints_; }
  std::span<const ChainLink> links() const { return links_; }

  // Whether all values are within the joints' limits, to a millionth, and as many as joints. Of a
  // joint that turns without end: within a million radians, beyond which rounding moves the robot.
  bool Contains(std::span<const double> q) const;

  // Sets the pose of every link. Limits are not looked at. Throws std::invalid_argument if there
  // are not as many values as joints. Allocates only while `base_from_link` has no room.
  void Pose(std::span<const double> q, std::vector<Eigen::Isometry3d>& base_from_link) const;

  // How far a point of the link moves at most, metres, per radian or metre of the joint, whatever
  // the values: `radius`, how far the point is from the link's origin. The sum of the lengths in
  // between; 0 if the joint does not move the link.
  double LeverOf(size_t joint, size_t link, double radius) const;

 private:
  void Follow(std::span<const double> q, std::span<Eigen::Isometry3d> base_from_link) const;
  // How far its joint moves the link against its parent; 0 if there is none.
  double MovedBy(std::span<const double> q, size_t link) const;

  std::vector<ChainJoint> joints_;
  std::vector<ChainLink> links_;
  // By link: its pose in its parent's frame is
  //   parent_from_link + a * first + b * second
  // a: sin of the angle that it turns by, b: 1 - cos (Rodrigues). If it slides, a: how far, b: 0.
  struct Move {
    Eigen::Matrix4d first = Eigen::Matrix4d::Zero();
    Eigen::Matrix4d second = Eigen::Matrix4d::Zero();
  };
  std::vector<Move> moves_;
};

}  // namespace silhouette
