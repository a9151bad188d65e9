// SPDX-License-Identifier: Apache-2.0
// Clearance: by how many pixels the robot images of a configuration could grow, in all views at
// once, before it were occupied.
//
// Growing is that of Grown (db/mask/mask.h). A configuration that is free is not occupied with
// robot images grown by any radius up to its clearance - nor is any other whose robot images lie
// within those - and is with any greater radius. Where planes of the scene decide, growing these
// instead comes to the same: the clearance is the min_views-th smallest of the distances, in the
// views, between the test robot image and the nearest pixel that shows an obstacle.
//
//   uncalibrated presets   exact; to obstacle pixels
//   calibrated, in the obstacle images   exact; to pixels that show an obstacle once resolved
//   calibrated, in the intersection images   exact; robot images that grow take in pixels of the
//       lines, too, so that no plane decides: the test itself is made with them
//   sound presets   a lower bound; to whatever may hold an obstacle, seen or not. sound-planes
//       reaches it but for possible space that the robot covers in all views whatever it does:
//       only the robot's body decides there, of which images tell nothing. sound, which asks for
//       one and the same place in space, may have more
//
// What it does not say: anything about obstacles that no pixel shows (but under the sound presets).
// Unknown and error pixels do not make it smaller, unless the policy resolves them to obstacles;
// nor do pixels that are ignored or in an allowed region. It is measured in pixels of the masks,
// not in metres, and from the planes as the test has them: a safety margin is in them already.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "db/mask/mask.h"
#include "server/collision/collision_checker.h"
#include "server/collision/collision_images.h"
#include "server/collision/policy.h"
#include "server/collision/verdict.h"

namespace silhouette {

// How far every pixel of a view is from the set pixels of a plane.
//
// Distances are those of Grown (db/mask/mask.h), between the squares of pixels, in pixels: 0 for
// set pixels and their eight neighbours. They are kept squared, as whole numbers, and so are exact.
// Cannot be changed once made; read by any number of threads.
class DistanceImage {
 public:
  // The squared distance from a plane without set pixels.
  static constexpr uint32_t kInfinite = std::numeric_limits<uint32_t>::max();

  // Takes time in proportion to the number of pixels. Throws std::invalid_argument for a mask of no
  // size.
  explicit DistanceImage(const Mask& plane);

  MaskSize size() const { return size_; }

  // The least squared distance of the pixels that are set in `pixels`, words of a mask of the same
  // size; kInfinite if none is. Never allocates.
  uint32_t LeastSquared(MaskWords pixels) const;

  // The pixels at no more than this squared distance.
  Mask Within(uint32_t squared) const;

 private:
  MaskSize size_;
  std::vector<uint32_t> squared_;  // by pixel
};

// The distance in pixels of a squared distance, infinity for kInfinite; so rounded that Grown by it
// does not reach a pixel at that distance, and by anything greater, up to rounding, does.
double PixelsOf(uint32_t squared);

// Per view; nothing where the scene lacks the view.
using DistanceImages = std::vector<std::optional<DistanceImage>>;

DistanceImages DistancesTo(const CollisionImages& planes);
// The planes of obstacle pixels.
CollisionImages ObstaclePlanes(const ObstacleImages& images);

// The smallest clearance along a path, and where it is first.
struct PathClearance {
  uint32_t squared = DistanceImage::kInfinite;  // in pixels
  // Waypoint number and fraction of the way to the next one.
  int segment = 0;
  double fraction = 0;
  Configuration configuration;

  // May be infinite.
  double pixels() const { return PixelsOf(squared); }
};

// Refers to all that it is made of, which must outlive it. May be used by any number of threads.
class ClearanceMeter {
 public:
  // `test` was made with `obstacle_images`, `policy` and `support`. `distances`: to the pixels that
  // show an obstacle, those of the resolved images under a calibrated preset in the obstacle
  // images, else obstacle pixels; made once per scene and shared. Throws std::invalid_argument if
  // there is not one per view, of its size, where `obstacle_images` has one.
  ClearanceMeter(const CollisionChecker& test, const ObstacleImages& obstacle_images,
                 const Policy& policy, const TestSupport& support, const DistanceImages& distances);

  // The clearance of `q` in pixels, whose verdict is `verdict`: nothing if that is unknown, 0 if it
  // is occupied; 0, too, for a free one that touches what makes it occupied. Infinite if no radius
  // makes it occupied. `evidence`: empty, or one entry per view, whose distance is filled in unless
  // the view is missing or the verdict unknown.
  std::optional<double> Measure(std::span<const double> q, const Verdict& verdict,
                                std::span<ViewEvidence> evidence = {}) const;

  // How many of these levels, squared distances in pixels that ascend, the clearance of `q`
  // exceeds, whose verdict is free: what Measure says, at less cost where it takes long.
  size_t CountExceeded(std::span<const double> q, std::span<const uint32_t> levels) const;

  // For the places of a path, in their order, as CollisionChecker::CheckPath tests them: makes
  // `smallest` that of the place if it is smaller. What is left over once the path is free is its
  // clearance; of a drawn robot a lower bound, for it is grown there by what it moves, and 0 where
  // the path is sampled: there the grown one is not free.
  void Narrow(const TestedPlace& place, std::optional<PathClearance>& smallest) const;

 private:
  friend class LevelChecker;
  using RobotImages = std::vector<Mask>;

  // Squared: the clearance, or `limit` if it is greater.
  uint32_t Squared(const RobotImages& robot, uint32_t limit) const;
  uint32_t SquaredFromParts(const RobotImages& robot) const;
  uint32_t SquaredAlongLines(const RobotImages& robot, uint32_t least, uint32_t limit) const;
  bool OccupiedAlongLines(std::span<const DistanceImage> from_robot, uint32_t squared) const;
  // Per view the squared distance to the plane that decides, 0 if the view is missing.
  std::vector<uint32_t> ToPlanes(const RobotImages& robot) const;
  uint32_t MinViewsSmallest(std::vector<uint32_t> squared) const;

  const CollisionChecker& test_;
  const ObstacleImages& obstacle_images_;
  const DistanceImages& distances_;
  const EpipolarBands* searched_bands_ = nullptr;  // set if lines in intersection images decide
  const PossibleSpace* possible_space_ = nullptr;  // set if the preset is a sound one
};

}  // namespace silhouette
