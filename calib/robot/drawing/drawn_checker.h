// SPDX-License-Identifier: Apache-2.0
// DrawnChecker: which views show an obstacle inside the robot's image, at any joint values. Uses
// the standard library and Eigen alone.
//
// A view shows one exactly if DrawnRobot::AddTouched sets a pixel that its plane has. Parts are
// first looked up as balls in the distances of the plane, a vector of them as one. If a ball within
// a part reaches a pixel, the view shows one. Else only parts that may meet the plane are drawn,
// where an octagon about them meets it, in the rows that the plane has. A part that is grown by
// more than half of a ball about it is not drawn but taken for its balls, which are larger: no view
// is missed, some may be added. A checker takes 2 1/8 bytes a pixel.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "calib/robot/drawing/drawn_robot.h"
#include "calib/robot/drawing/plane_distances.h"
#include "db/mask/mask.h"

namespace silhouette {

// For one thread at a time; after a few checks nothing allocates.
struct DrawnCheckScratch {
  // A view whose plane the robot may meet.
  struct NearView {
    size_t view = 0;
    int vectors = 0;  // of balls that may meet it: the more, the likelier it shows an obstacle
  };

  // A view that drawing decides.
  struct OpenView {
    size_t view = 0;
    size_t begin = 0;  // of its balls in `seen`
    size_t end = 0;
    int depth = 0;  // the greatest: the greater, the likelier it shows an obstacle
  };

  // A part that may meet the plane of a view.
  struct Candidate {
    size_t part = 0;
    int depth = 0;  // of its balls, the greatest
  };

  DrawingScratch drawing;
  std::vector<Eigen::Isometry3d> base_from_link;
  PlacedBalls balls;
  std::vector<uint32_t> near_groups;  // by view, then vector of groups: a bit for each
  std::vector<NearView> near;
  std::vector<SeenBalls> seen;  // of open views
  std::vector<OpenView> open;
  std::vector<Candidate> candidates;  // of one view
};

// The planes that show obstacles in one scene, prepared for questions about a robot at any joint
// values. Cannot be changed once made; used by any number of threads, each with scratch of its own.
class DrawnChecker {
 public:
  // `shown`: one per view of the robot; nothing: the view is missing, it counts as showing an
  // obstacle. Throws std::invalid_argument if there is no robot, or there are more or fewer planes
  // than views, or one of another size.
  DrawnChecker(std::shared_ptr<const DrawnRobot> robot, std::vector<std::optional<Mask>> shown);

  const DrawnRobot& robot() const { return *robot_; }

  // How many views show an obstacle inside the robot's image at `q`, each part grown by `growth`:
  // `enough`: as many or more; less: fewer than `enough`, and 0 only if none does. Of a robot that
  // is grown 0 says no more than any number below `enough`: what it touches, the robot may not.
  // Joint values that are not finite: all views. Limits are not looked at. Throws
  // std::invalid_argument if `enough` is below 1, there is not a value for each joint, or `growth`
  // has not a finite number that is not negative for each part.
  int Showing(std::span<const double> q, Growth growth, int enough,
              DrawnCheckScratch& scratch) const;

  // Whether at least `views` views show one: Showing() >= views, and faster.
  bool ShownBy(int views, std::span<const double> q, Growth growth,
               DrawnCheckScratch& scratch) const;

 private:
  // Showing; 0 says no more than any number below `enough` unless `any_counts`.
  int Count(std::span<const double> q, Growth growth, int enough, bool any_counts,
            DrawnCheckScratch& scratch) const;
  // Finds the views whose planes the robot may meet, the likeliest to show an obstacle first.
  void FindNear(DrawnCheckScratch& scratch) const;
  // Whether the view certainly shows one. If not, appends the balls that may meet its plane.
  bool Look(size_t view, DrawnCheckScratch& scratch) const;
  bool IsMet(const DrawnCheckScratch::OpenView& open, Growth growth,
             DrawnCheckScratch& scratch) const;

  struct Plane {
    PlaneDistances distances;
    DrawnPlane pixels;
  };

  std::shared_ptr<const DrawnRobot> robot_;
  std::vector<std::optional<Plane>> planes_;  // by view; nothing: it shows nothing, or is missing
  int missing_ = 0;                           // views
};

}  // namespace silhouette
