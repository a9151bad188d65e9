// SPDX-License-Identifier: Apache-2.0
#include "capture/session/capture_plan.h"

#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

// Of four cameras: images, differences, storing.
constexpr absl::Duration kImageTime = absl::Milliseconds(50);

// By number.
absl::StatusOr<std::vector<bool>> Listed(const ConfigurationGrid& grid,
                                         const CaptureSelection& selection) {
  std::vector<bool> listed(grid.number_limit(), selection.kind == CaptureSelection::Kind::kAll);
  if (selection.kind != CaptureSelection::Kind::kListed) return listed;
  for (const ConfigurationNumber number : selection.listed) {
    if (!grid.Contains(number)) {
      return absl::InvalidArgumentError(
          absl::StrCat("configuration ", number, " is not in the grid"));
    }
    listed[number] = true;
  }
  return listed;
}

// An upper bound of what a record takes: it is stored compressed, where that helps.
uint64_t BytesPerRecord(const storage::v1::CellDescription& cell,
                        const std::vector<MaskSize>& mask_sizes) {
  constexpr uint64_t kPage = 4096;
  uint64_t bytes = 64;
  for (const MaskSize& size : mask_sizes) bytes += size.bytes() + 8;
  bytes += 16 * static_cast<uint64_t>(cell.grid_joints_size() + cell.fixed_joints_size());
  // Short records share a page, long ones have pages of their own.
  return bytes < kPage / 2 ? bytes * 3 / 2 : (bytes + kPage) / kPage * kPage + 64;
}

absl::Duration TravelDuration(const Travel& travel, const CaptureSettings& settings,
                              const std::vector<ConfigurationNumber>& captures) {
  absl::Duration duration;
  std::optional<ConfigurationNumber> at;
  for (const ConfigurationNumber target : captures) {
    if (at) {
      const auto route = travel.Route(*at, target);
      if (!route.ok()) continue;  // in another part
      Configuration here = travel.grid().At(*at);
      for (const Configuration& next : *route) {
        duration += TravelTime(here, next, settings.joint_speed);
        here = next;
      }
    }
    at = target;
  }
  return duration;
}

}  // namespace

absl::StatusOr<std::vector<StoredRecord>> ReadRecords(const Database& database) {
  ASSIGN_OR_RETURN(const Snapshot snapshot, database.Read());
  std::vector<StoredRecord> records = NoRecords(database.grid());
  absl::Status status =
      snapshot.ForEach([&](ConfigurationNumber number, const absl::StatusOr<RobotImage>& image) {
        records[number] = !image.ok()       ? StoredRecord::kDamaged
                          : image->excluded ? StoredRecord::kExcluded
                                            : StoredRecord::kCaptured;
        return true;
      });
  if (!status.ok()) return status;
  return records;
}

std::vector<StoredRecord> NoRecords(const ConfigurationGrid& grid) {
  return std::vector<StoredRecord>(grid.number_limit(), StoredRecord::kNone);
}

absl::StatusOr<CapturePlan> PlanCapture(const storage::v1::CellDescription& cell,
                                        const Travel& travel,
                                        const std::vector<StoredRecord>& records,
                                        const CaptureSettings& settings,
                                        const CaptureSelection& selection) {
  ASSIGN_OR_RETURN(const auto mask_sizes, MaskSizesOf(cell));
  ASSIGN_OR_RETURN(const auto listed, Listed(travel.grid(), selection));
  CapturePlan plan;
  uint64_t captured_in_region = 0;
  std::string region;
  for (const ConfigurationNumber number : travel.Serpentine()) {
    const StoredRecord record = records[number];
    if (travel.Forbidden(number)) {
      if (record == StoredRecord::kExcluded) {
        ++plan.kept;
        continue;
      }
      plan.exclusions.push_back(number);
      if (record == StoredRecord::kNone) continue;
      ++captured_in_region;
      region = travel.regions().At(travel.grid().At(number)).value();
    } else if (selection.kind != CaptureSelection::Kind::kNothing &&
               (record == StoredRecord::kNone || record == StoredRecord::kExcluded ||
                listed[number])) {
      plan.captures.push_back(number);
    } else if (record != StoredRecord::kNone) {
      ++plan.kept;
      if (record == StoredRecord::kCaptured || record == StoredRecord::kDamaged) ++plan.kept_images;
    }
  }
  if (captured_in_region > 0 && !selection.exclude_captured) {
    return absl::FailedPreconditionError(
        absl::StrCat(captured_in_region, " configurations that have robot images lie in a region ",
                     "that is forbidden now ('", region, "')"));
  }
  plan.parts = travel.parts();
  plan.check_sentinels = selection.kind == CaptureSelection::Kind::kNothing;
  plan.new_sentinels = selection.new_sentinels || selection.kind == CaptureSelection::Kind::kAll;
  plan.duration = TravelDuration(travel, settings, plan.captures) +
                  static_cast<int64_t>(plan.captures.size()) *
                      (settings.settle + settings.still_images * kImageTime);
  plan.bytes =
      plan.captures.size() * BytesPerRecord(cell, mask_sizes) + plan.exclusions.size() * 128;
  return plan;
}

}  // namespace silhouette
