// SPDX-License-Identifier: Apache-2.0
// Drawing the robot images of a grid into a database.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/robot/drawing/drawn_robot.h"
#include "db/mask/configuration_grid.h"
#include "db/mask/joint_regions.h"
#include "db/mask/mask.h"
#include "db/store/store.h"

namespace silhouette {

// The masks of all views at a configuration of the grid; nothing where the robot must never be.
// Called by any number of threads.
using DrawMasks = std::function<std::optional<std::vector<Mask>>(std::span<const double> q)>;

// Draws the whole robot. It must never be in forbidden regions, nor beyond the limits of a joint.
DrawMasks WholeRobot(std::shared_ptr<const DrawnRobot> robot, JointRegions forbidden);

// Draws nodes of an arm: `robot`, of the kind kOwn or kReach. No place of a node's cell may be
// forbidden.
DrawMasks ArmNodes(std::shared_ptr<const DrawnRobot> robot, ConfigurationGrid grid,
                   JointRegions forbidden);

struct DrawReport {
  uint64_t configurations = 0;  // that the database is to have
  uint64_t kept = 0;            // that it had, undamaged
  uint64_t drawn = 0;           // excluded ones included
  uint64_t damaged = 0;         // that it had damaged: drawn again
  uint64_t excluded = 0;        // of the drawn
  bool stopped = false;

  bool complete() const { return kept + drawn == configurations; }
};

struct DrawSettings {
  std::string program;  // for the provenance log
  size_t most_threads = std::numeric_limits<size_t>::max();
  // Called on the calling thread before the first tile and after each; false ends the drawing.
  std::function<bool(const DrawReport& so_far)> progress = nullptr;
};

// Draws what the variant lacks, or has damaged, of the configurations that `drawn` says it has, and
// commits it tile by tile. What is committed stays whatever happens afterwards: the same call goes
// on. Needs kWrite. The same configuration gives the same record, byte by byte. The collision index
// is not built. FailedPrecondition: Database::SetDrawnImages. ResourceExhausted: the disk is full.
absl::StatusOr<DrawReport> DrawInto(Database& database, const storage::v1::DrawnImages& drawn,
                                    const DrawMasks& draw, const DrawSettings& settings);

}  // namespace silhouette
