// SPDX-License-Identifier: Apache-2.0
// Allowed regions: parts of the images in which obstacles are expected for a while, such as the
// part that the robot is about to grasp.
//
// Inside a region in force an obstacle pixel becomes unknown: it neither shows an obstacle nor
// proves that there is none. Everything else stays as it is. A region has an end, by the clock that
// never steps back; it belongs to one database.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "db/mask/mask.h"
#include "server/collision/collision_images.h"
#include "server/scene/clock.h"

namespace silhouette {

struct AllowedRegion {
  std::string name;
  // Per view of the database: the pixels; nothing where the region does not reach.
  std::vector<std::optional<Mask>> pixels;
  // When it ends: by the running clock, and about then by the wall clock.
  absl::Duration end;
  absl::Time end_time;
};

// The regions in force at one moment. Immutable; equal revisions have equal regions.
struct RegionSet {
  uint64_t revision = 0;
  std::vector<AllowedRegion> regions;  // by name
};

// What the regions in force did to one scene.
struct RegionEffect {
  std::string name;
  // Per view: the obstacle pixels that it took away, those of the safety margin around them
  // included; nothing where there are none.
  std::vector<std::optional<Mask>> taken;

  // Whether any of them lies inside the test robot image, one mask per view or nothing.
  bool Touches(std::span<const std::optional<Mask>> test_robot) const;
};

// Turns the obstacle pixels inside the regions into unknown ones, and makes `images` of
// `without_margins` again, with the views' `margins` in pixels: what a region takes away has no
// margin any more, what is beside it keeps its own, into the region too. Tells, for every region
// that took obstacle pixels of `images` away, which.
std::vector<RegionEffect> Apply(const RegionSet& regions, std::span<const double> margins,
                                ObstacleImages& without_margins, ObstacleImages& images);

// The pixels whose centres lie in a polygon, corners in mask pixels, integers at pixel centres.
// InvalidArgument unless there are 3 to 1000 corners, all in the mask: -0.5 to its width - 0.5, and
// so its height.
absl::StatusOr<Mask> PixelsInPolygon(MaskSize size,
                                     std::span<const std::pair<double, double>> corners);

// The regions of one database. Not thread-safe: SceneStore guards it.
class AllowedRegions {
 public:
  static constexpr absl::Duration kLongest = absl::Minutes(10);
  static constexpr size_t kMost = 64;
  static constexpr size_t kLongestName = 64;

  // Puts a region into force for `duration` from `now` on, in place of the one of its name.
  // InvalidArgument: no name, one that is too long or has control characters, no pixel in any view,
  // or a duration that is not between 0 and kLongest. ResourceExhausted: there are kMost regions.
  absl::StatusOr<AllowedRegion> Allow(const std::string& name,
                                      std::vector<std::optional<Mask>> pixels,
                                      absl::Duration duration, const Moment& now);

  // Ends a region at once; whether it was in force.
  bool Revoke(const std::string& name, const Moment& now);

  void Clear();

  // Those allowed and not revoked; the end of some may have come.
  const std::shared_ptr<const RegionSet>& set() const { return set_; }

  // Those whose end has not come.
  std::shared_ptr<const RegionSet> InForce(const Moment& now);

  // Those whose end came, or that Clear() ended, since the last call.
  std::vector<AllowedRegion> TakeEnded(const Moment& now);

 private:
  void Replace(std::vector<AllowedRegion> regions);

  std::vector<AllowedRegion> ended_;
  std::shared_ptr<const RegionSet> set_ = std::make_shared<const RegionSet>();
};

}  // namespace silhouette
