// SPDX-License-Identifier: Apache-2.0
// RobotBody: where a robot's body certainly is, and where it may be, at any joint values.
#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "calib/robot/distance_field.h"
#include "calib/robot/robot_model.h"

namespace silhouette {

// The robot at some joint values, or anywhere between some. Refers to the body, which must outlive
// it. Points are in the robot's base frame, metres.
class PosedBody {
 public:
  // The distance of a point from what is certain of the robot, negative inside, or more: never
  // less, whatever the joint values in their ranges. The true robot has every point at which it is
  // negative. `hint`: the link that was the nearest to some point near by, 0 to begin with; on
  // return, to this one.
  double AtMost(const Eigen::Vector3d& point, size_t& hint) const;

  // Whether any point of the true robot, tool and payload included, may lie within `radius` of the
  // point; of RobotBody::Between, at any of its joint values.
  bool MayReach(const Eigen::Vector3d& point, double radius) const;

  // Whether a ball of `radius`, its centre anywhere within `room` of `centre`, that the robot does
  // not touch with the joints at the `from` of RobotBody::Between, may be met by any link while
  // they move on towards `to`. Where a link first touches the ball, a point of it lies on the
  // ball's surface and moves no farther away from its centre: such points of the links, enlarged by
  // the tolerance, are looked for. What moves away is not met, however near it is.
  bool MayMeet(const Eigen::Vector3d& centre, double room, double radius) const;

  // The links, of the same body, that stand elsewhere than in `other`, or move. `other`: of
  // RobotBody::At.
  PosedBody MovedFrom(const PosedBody& other) const;

 private:
  friend class RobotBody;

  // How a joint that moves carries the points of a link.
  struct Motion {
    Eigen::Vector3d axis;    // unit, in the base frame; as the joint moves from `from` to `to`
    Eigen::Vector3d origin;  // a point of it
    bool slides = false;
    // How far the joints before it turn the axis, radians, and move the origin, at most.
    double turn = 0;
    double shift = 0;
  };
  struct Link {
    size_t number = 0;  // in the model
    // Null: nothing. A link may be a frame alone, which carries tool or payload.
    const DistanceField* certain = nullptr;
    const DistanceField* whole = nullptr;
    double tolerance = 0;  // by how much the true link may reach beyond `whole`
    double payload_radius = 0;
    Eigen::Vector3d origin;  // in the base frame
    Eigen::Isometry3d link_from_base;
    Eigen::AlignedBox3d box;  // of the whole, in the base frame
    double movement = 0;      // no point of it is ever farther from where it is here
    std::vector<Motion> motions;
  };
  struct Ball {
    Eigen::Vector3d centre;
    double room = 0;
    double radius = 0;
  };
  // MayMeet, by the points that a square of a cube around the ball shows from its centre: `middle`
  // of the square, and half its edges.
  bool MayMeetOn(const Link& link, const Ball& ball, const Eigen::Vector3d& middle,
                 const Eigen::Vector3d& right, const Eigen::Vector3d& up, int halvings) const;
  std::vector<Link> links_;
  double tolerance_ = 0;
};

// The shapes of a robot's links (RobotLink::body) with distance fields. Of a mesh that is not
// closed nothing is certain, and all of its convex hull may be touched. Cannot be changed once
// made; used by any number of threads.
class RobotBody {
 public:
  // Lengths in metres.
  struct Settings {
    // Of the links.
    BodyGeometry geometry = BodyGeometry::kVisual;
    // By how much a point of the true robot's surface may be away from the model's.
    double tolerance = 0;
    // How far tool and payload reach beyond the outermost links.
    double payload_radius = 0;
    // As DistanceField has them; distances beyond `range` are less exact.
    double range = 0.1;
    double step = 0.01;
  };

  // Throws std::invalid_argument if tolerance or payload_radius is negative, or range or step not
  // positive.
  RobotBody(const RobotModel& robot, const Settings& settings);

  // Names of the links that have a shape whose mesh is not closed, or has hollows or pieces that
  // are inside out.
  const std::vector<std::string>& open_links() const { return open_links_; }

  // The body with the joints at `positions`, in the order of the model's joints, each up to its
  // half range to either side; none: at them. As many, else std::invalid_argument is thrown.
  PosedBody At(std::span<const double> positions, std::span<const double> half_ranges = {}) const;

  // The body wherever every joint is between `from` and `to`: for MayReach and MayMeet alone. It is
  // that of some joint values in between, grown by how far its links move from there at most; of no
  // more than kMostPoses of them, and more than one only while a link moves by more than `fine`,
  // metres.
  static constexpr size_t kMostPoses = 16;
  PosedBody Between(std::span<const double> from, std::span<const double> to, double fine) const;

 private:
  // Adds the links with the joints at `positions`, each up to `half_ranges` to either side; those
  // that do not move only if `still`.
  void AddLinks(std::span<const double> positions, std::span<const double> half_ranges, bool still,
                PosedBody& body) const;
  // How far any of the points of the link moves at most while the joints move by up to
  // `half_ranges`, of either sign.
  double MovementOf(std::span<const Eigen::Vector3d> points, int link,
                    std::span<const Eigen::Isometry3d> base_from_link,
                    std::span<const double> half_ranges) const;
  // The same of all points of the link.
  double MovementOf(size_t link, std::span<const Eigen::Isometry3d> base_from_link,
                    std::span<const double> half_ranges) const;
  std::vector<PosedBody::Motion> MotionsOf(size_t link,
                                           std::span<const Eigen::Isometry3d> base_from_link,
                                           std::span<const double> half_ranges) const;

  RobotModel robot_;
  Settings settings_;
  // Of a link; one field where they are the same.
  struct Fields {
    std::shared_ptr<const DistanceField> certain;
    std::shared_ptr<const DistanceField> whole;
    double bulge = 0;  // by how much round shapes reach beyond `whole`
  };
  static Fields FieldsOf(const RobotLink& link, const Settings& settings);

  std::vector<Fields> fields_;         // by link
  std::vector<double> payload_radii_;  // by link
  std::vector<std::string> open_links_;
};

}  // namespace silhouette
