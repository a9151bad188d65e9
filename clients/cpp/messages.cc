// SPDX-License-Identifier: Apache-2.0
#include "silhouette/messages.h"

#include <bit>
#include <span>
#include <stdexcept>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "clients/cpp/server_clock.h"

namespace silhouette::client {
namespace {

// The bits of one state of a tile.
absl::StatusOr<TileBits> BitsFrom(const std::string& bytes, uint64_t tile) {
  TileBits bits{};
  if (bytes.size() != kTileSize / 8) {
    return absl::InternalError(absl::StrCat("tile ", tile, " has ", bytes.size(),
                                            " bytes of bits instead of ", kTileSize / 8));
  }
  for (size_t i = 0; i < bytes.size(); ++i) {
    bits[i / 8] |= uint64_t{static_cast<uint8_t>(bytes[i])} << (8 * (i % 8));
  }
  return bits;
}

}  // namespace

v1::Configuration ToMessage(const Configuration& configuration) {
  v1::Configuration message;
  message.mutable_positions()->Add(configuration.begin(), configuration.end());
  return message;
}

v1::Policy ToMessage(const Policy& policy) {
  v1::Policy message;
  message.set_preset(policy.preset);
  if (policy.min_views) message.set_min_views(*policy.min_views);
  if (policy.max_occluded_views) message.set_max_occluded_views(*policy.max_occluded_views);
  if (policy.off_grid) {
    message.set_off_grid(*policy.off_grid == OffGrid::kCell ? v1::OFF_GRID_CELL
                                                            : v1::OFF_GRID_NEAREST);
  }
  return message;
}

v1::Mask ToMessage(const Mask& mask) {
  v1::Mask message;
  message.set_width(mask.width());
  message.set_height(mask.height());
  message.set_bits(mask.ToBytes());
  return message;
}

google::protobuf::Timestamp ToMessage(absl::Time time) {
  google::protobuf::Timestamp message;
  const int64_t seconds = absl::ToUnixSeconds(time);
  message.set_seconds(seconds);
  message.set_nanos(
      static_cast<int32_t>(absl::ToInt64Nanoseconds(time - absl::FromUnixSeconds(seconds))));
  return message;
}

google::protobuf::Duration ToMessage(absl::Duration duration) {
  google::protobuf::Duration message;
  absl::Duration rest;
  message.set_seconds(absl::IDivDuration(duration, absl::Seconds(1), &rest));
  message.set_nanos(static_cast<int32_t>(absl::ToInt64Nanoseconds(rest)));
  return message;
}

Policy FromMessage(const v1::Policy& message) {
  Policy policy{.preset = message.preset()};
  if (message.has_min_views()) policy.min_views = message.min_views();
  if (message.has_max_occluded_views()) policy.max_occluded_views = message.max_occluded_views();
  if (message.off_grid() == v1::OFF_GRID_CELL) policy.off_grid = OffGrid::kCell;
  if (message.off_grid() == v1::OFF_GRID_NEAREST) policy.off_grid = OffGrid::kNearest;
  return policy;
}

Mask FromMessage(const v1::Mask& mask) {
  const std::string& bits = mask.bits();
  return Mask::FromBytes({.width = mask.width(), .height = mask.height()},
                         {reinterpret_cast<const uint8_t*>(bits.data()), bits.size()});
}

absl::Time FromMessage(const google::protobuf::Timestamp& time) {
  return absl::FromUnixSeconds(time.seconds()) + absl::Nanoseconds(time.nanos());
}

absl::Duration FromMessage(const google::protobuf::Duration& duration) {
  return absl::Seconds(duration.seconds()) + absl::Nanoseconds(duration.nanos());
}

Basis FromMessage(const v1::Basis& basis, RunningClock::time_point asked) {
  Basis result{.database_generation = basis.database_generation(),
               .scene_id = basis.scene_id(),
               .variant = basis.variant(),
               .asked = asked,
               .valid_until = After(asked, FromMessage(basis.valid_for()))};
  for (const v1::SceneDefect& defect : basis.defects()) {
    result.defects.push_back({FromMessage(defect.reason()), defect.message()});
  }
  result.unverified_model = basis.unverified_model();
  if (basis.scene_id() == 0) return result;
  result.scene_time = FromMessage(basis.scene_time());
  result.scene_age = FromMessage(basis.scene_age());
  result.regions = {basis.regions().begin(), basis.regions().end()};
  result.scene_variant = basis.scene_variant();
  return result;
}

Reason FromMessage(v1::Verdict::Reason reason) {
  return v1::Verdict::Reason_IsValid(reason) ? static_cast<Reason>(reason) : Reason::kUnspecified;
}

Verdict FromMessage(const v1::Verdict& message, const Basis& basis) {
  Verdict verdict;
  if (basis.scene_id == 0) {
    verdict.reason = Reason::kNoScene;
  } else if (message.state() == v1::Verdict::STATE_FREE) {
    verdict.state = State::kFree;
  } else if (message.state() == v1::Verdict::STATE_OCCUPIED) {
    verdict.state = State::kOccupied;
  }
  if (verdict.state == State::kUnknown && message.state() == v1::Verdict::STATE_UNKNOWN) {
    verdict.reason = FromMessage(message.reason());
  }
  const bool decided = verdict.state != State::kUnknown;
  if (decided && message.has_clearance()) verdict.clearance = message.clearance();
  for (const v1::ViewEvidence& view : message.views()) {
    verdict.views.push_back({.view = view.view(),
                             .obstacle_pixels = view.obstacle_pixels(),
                             .unknown_pixels = view.unknown_pixels(),
                             .error_pixels = view.error_pixels(),
                             .missing = view.missing()});
    if (decided && view.has_distance()) verdict.views.back().distance = view.distance();
  }
  verdict.hidden_possible = message.hidden_possible();
  verdict.regions = {message.regions().begin(), message.regions().end()};
  return verdict;
}

absl::StatusOr<ConfigurationGrid> FromMessage(const v1::Grid& grid) {
  std::vector<GridJoint> joints;
  for (const v1::GridJoint& joint : grid.joints()) {
    joints.push_back({.name = joint.name(),
                      .lower = joint.lower(),
                      .upper = joint.upper(),
                      .steps = joint.steps(),
                      .continuous = joint.continuous()});
  }
  if (static_cast<size_t>(grid.tile_edges_size()) != joints.size()) {
    return absl::InternalError("the grid has no tile edges");
  }
  try {
    return ConfigurationGrid(std::move(joints),
                             {grid.tile_edges().begin(), grid.tile_edges().end()});
  } catch (const std::invalid_argument& error) {
    return absl::InternalError(absl::StrCat("the grid cannot be: ", error.what()));
  }
}

absl::StatusOr<ConfigurationSpaceTile> FromMessage(const v1::ConfigurationSpaceTile& message) {
  const absl::StatusOr<TileBits> free = BitsFrom(message.free(), message.tile());
  if (!free.ok()) return free.status();
  const absl::StatusOr<TileBits> occupied = BitsFrom(message.occupied(), message.tile());
  if (!occupied.ok()) return occupied.status();
  ConfigurationSpaceTile tile{.tile = message.tile(), .free = *free, .occupied = *occupied};
  for (const std::string& bytes : message.clearances()) {
    const absl::StatusOr<TileBits> above = BitsFrom(bytes, message.tile());
    if (!above.ok()) return above.status();
    tile.above.push_back(*above);
  }
  if (!message.free_cells().empty()) {
    const absl::StatusOr<TileBits> free_cells = BitsFrom(message.free_cells(), message.tile());
    if (!free_cells.ok()) return free_cells.status();
    tile.free_cells = *free_cells;
  }
  return tile;
}

}  // namespace silhouette::client
