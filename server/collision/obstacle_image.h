// SPDX-License-Identifier: Apache-2.0
// The obstacle image: what one view knows of the cell at the moment of a scene (paper §3.1).
//
// Every pixel is one of background, obstacle, unknown and error, Table 1:
//
//   scene image   robot image   obstacle image
//   background    background    background
//   background    robot         error      the robot should be seen here, and is not
//   foreground    background    obstacle   something is here that is not the robot
//   foreground    robot         unknown    the robot, and perhaps something before or behind it
//
// The robot image is that of the robot's configuration when the scene was taken. An obstacle image
// cannot be changed once made.
#pragma once

#include <algorithm>
#include <cstdint>

#include "db/mask/mask.h"

namespace silhouette {

inline bool NothingSet(MaskWords words) {
  return std::all_of(words.begin(), words.end(), [](uint64_t word) { return word == 0; });
}

class ObstacleImage {
 public:
  // Table 1 with the robot on a grid point. Throws std::invalid_argument if the sizes differ.
  static ObstacleImage FromScene(const Mask& scene, const Mask& robot);

  // Table 1 with the robot between grid points, where its image is only known to lie between those
  // of the corners of its grid cell: no pixel of the corners' union `anywhere` is an obstacle, and
  // only pixels of their intersection `certain` are errors. Throws std::invalid_argument if the
  // sizes differ or `certain` is not within `anywhere`.
  static ObstacleImage FromScene(const Mask& scene, const Mask& anywhere, const Mask& certain);

  // From a sensor that separates obstacles from the robot by itself: pixels of the robot that are
  // not in `obstacles` stay unknown, as an obstacle may stand behind it; there are no errors.
  // Throws std::invalid_argument if the sizes differ.
  static ObstacleImage FromObstacles(const Mask& obstacles, const Mask& anywhere);

  // The image without what may be noise at the robot's rim: an obstacle component (connected over
  // edges and corners) is unknown if it has no more than kMostWeakPixels, all of them touch the
  // robot image `anywhere` and none is in `strong`, the pixels with strong evidence. At the faint
  // rim of the robot and of its shadow noise decides from image to image what is foreground. A hand
  // has more pixels.
  //
  // Unknown, never background: the result is that of a robot image that is larger by these pixels.
  // So whatever is possible behind the robot is possible there, and the sound presets lose nothing.
  // A preset that counts views loses at most what it loses to a robot that hides these pixels. What
  // reaches farther than one pixel from the robot, joins what does, or is plain in a single camera
  // pixel stays an obstacle. Throws std::invalid_argument if the sizes differ.
  static constexpr size_t kMostWeakPixels = 3;
  ObstacleImage WithoutWeakRim(const Mask& strong, const Mask& anywhere) const;

  // The image where the pixels of `ignored` prove nothing, such as those of a pillar before the
  // camera: they are unknown, whatever they were. Throws std::invalid_argument if the sizes differ.
  ObstacleImage Ignoring(const Mask& ignored) const;

  // The image with a safety margin, in pixels (Grown in db/mask/mask.h): obstacle pixels
  // grow over everything, unknown and error pixels over background, so that nothing within the
  // margin of what may be an obstacle proves that there is none. A margin of 0 changes nothing.
  // Throws std::invalid_argument if the margin is negative or not finite.
  ObstacleImage WithMargin(double margin) const;

  MaskSize size() const { return obstacle_.size(); }
  const Mask& obstacle() const { return obstacle_; }
  const Mask& unknown() const { return unknown_; }
  const Mask& error() const { return error_; }
  // The pixels of none of the other three planes.
  Mask Background() const;

 private:
  ObstacleImage(Mask obstacle, Mask unknown, Mask error);

  Mask obstacle_;
  Mask unknown_;
  Mask error_;
};

// The intersection image: what an obstacle image says about one test configuration (paper §3.2).
//
// Table 2: the value of the obstacle image where the robot image of the test configuration shows
// the robot, background elsewhere. An intersection image cannot be changed once made.
//
// Checks need no pictures, only whether and how much: CollisionChecker finds that without making
// any.
class IntersectionImage {
 public:
  // Throws std::invalid_argument if the sizes differ.
  IntersectionImage(const ObstacleImage& obstacle_image, const Mask& test_robot);

  MaskSize size() const { return obstacle_.size(); }
  const Mask& obstacle() const { return obstacle_; }
  const Mask& unknown() const { return unknown_; }
  const Mask& error() const { return error_; }

 private:
  Mask obstacle_;
  Mask unknown_;
  Mask error_;
};

}  // namespace silhouette
