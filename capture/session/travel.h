// SPDX-License-Identifier: Apache-2.0
// Travel: in which order the robot visits the configurations of the grid, and on which way it gets
// from one to another without entering a forbidden region.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/session/capture_settings.h"
#include "db/mask/configuration_grid.h"
#include "db/mask/joint_regions.h"

namespace silhouette {

// The regions of a cell that the robot must never enter, by their names, asked for places and for
// moves. Cannot be changed once made.
class ForbiddenRegions {
 public:
  // Throws std::invalid_argument if a region names a joint that the grid does not have, bounds
  // none, or has a range whose bounds are not finite and in order.
  ForbiddenRegions(std::span<const ForbiddenRegion> regions, const ConfigurationGrid& grid);

  bool empty() const { return regions_.empty(); }
  const JointRegions& regions() const { return regions_; }

  // The name of a region that holds the configuration; nothing if none does.
  std::optional<std::string> At(std::span<const double> configuration) const;

  // The name of a region that a move between two configurations may touch, as JointRegions has it;
  // nothing if none.
  std::optional<std::string> Between(std::span<const double> from,
                                     std::span<const double> to) const;

 private:
  std::vector<std::string> names_;
  JointRegions regions_;
};

// Continuous joints are never driven across the end of their range: whether a robot takes the short
// way there is its own affair. Cannot be changed once made.
class Travel {
 public:
  // Most configurations that a grid may have; a robot would take years for them.
  static constexpr uint64_t kMostConfigurations = uint64_t{1} << 28;

  // Throws std::invalid_argument if the regions do not fit the grid, or the grid is larger than
  // kMostConfigurations.
  Travel(ConfigurationGrid grid, std::span<const ForbiddenRegion> regions);

  const ConfigurationGrid& grid() const { return grid_; }
  const ForbiddenRegions& regions() const { return regions_; }

  // Every configuration once, forbidden ones, too, each one step of one joint from the one before:
  // a serpentine whose fastest joint is the one with the smallest steps.
  std::vector<ConfigurationNumber> Serpentine() const;

  bool Forbidden(ConfigurationNumber number) const;

  // Into how many parts, between which there is no way along the grid, the regions cut the
  // configurations that are not forbidden.
  int parts() const { return parts_; }

  // The places to drive to, one after the other; the last is `to`. Straight if no region is in the
  // way, else around, along the grid. No move between them touches a region, whichever way the
  // joints keep step. FailedPrecondition, naming a region, if `to` is forbidden or there is no way.
  absl::StatusOr<std::vector<Configuration>> Route(ConfigurationNumber from,
                                                   ConfigurationNumber to) const;

  // The same from anywhere, e.g. from where the robot stands before the first move.
  absl::StatusOr<std::vector<Configuration>> RouteFrom(const Configuration& from,
                                                       ConfigurationNumber to) const;

 private:
  // The place of a configuration in a list with the last joint running fastest, without gaps.
  uint64_t PlaceOf(const GridIndex& index) const;
  GridIndex IndexAt(uint64_t place) const;

  bool Forbidden(const GridIndex& index) const;
  // Calls `visit` with each neighbour that a step along the grid leads to without touching a
  // region.
  template <typename Visit>
  void ForEachStep(const GridIndex& index, const Visit& visit) const;
  void FindParts();
  // Places along the grid, `from` left out; nothing if there is no way.
  std::optional<std::vector<GridIndex>> WalkAlongGrid(const GridIndex& from,
                                                      const GridIndex& to) const;

  ConfigurationGrid grid_;
  ForbiddenRegions regions_;
  // By place: 0 forbidden, else the number of the part. Empty without regions: all is one part.
  std::vector<int32_t> part_;
  int parts_ = 1;
};

// How long a move takes if every joint moves at `speed`, radians or metres per second.
absl::Duration TravelTime(std::span<const double> from, std::span<const double> to, double speed);

}  // namespace silhouette
