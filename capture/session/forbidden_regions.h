// The regions of a cell that the robot must never enter, asked for places and for moves.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "capture/session/capture_settings.h"
#include "db/mask/configuration_grid.h"

namespace silhouette {

// Bounds belong to their region. On a continuous joint a region holds every turn of its values.
// Cannot be changed once made.
class ForbiddenRegions {
 public:
  // Throws std::invalid_argument if a region names a joint that the grid does not have, bounds
  // none, or has a range whose bounds are not finite and in order.
  ForbiddenRegions(std::span<const ForbiddenRegion> regions, const ConfigurationGrid& grid);

  bool empty() const { return regions_.empty(); }

  // The name of a region that holds the configuration; nothing if none does.
  std::optional<std::string> At(std::span<const double> configuration) const;

  // The name of a region that a move between two configurations may touch; nothing if none. The
  // joints may move at any speed against each other, but each stays between its two values: the
  // whole box that the two configurations span is looked at.
  std::optional<std::string> Between(std::span<const double> from,
                                     std::span<const double> to) const;

 private:
  struct Range {
    size_t joint = 0;
    bool continuous = false;
    double lower = 0;
    double upper = 0;

    bool Meets(double from, double to) const;
  };
  struct Region {
    std::string name;
    std::vector<Range> ranges;
  };
  std::vector<Region> regions_;
};

}  // namespace silhouette
