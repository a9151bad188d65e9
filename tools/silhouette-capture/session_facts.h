// SPDX-License-Identifier: Apache-2.0
// What there is to report of a database's capture sessions.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/session/history.h"
#include "db/store/outliers.h"
#include "db/store/statistics.h"
#include "db/store/store.h"
#include "tools/silhouette-capture/opened_cell.h"

namespace silhouette {

// The state of a configuration; the worst counts.
enum class Standing : uint8_t { kCaptured, kExcluded, kOutlier, kSuspect, kDamaged, kMissing };

// How complete a variant is.
struct VariantFacts {
  std::string name;
  uint64_t captured = 0;
  uint64_t excluded = 0;
  uint64_t damaged = 0;
  uint64_t missing = 0;
  uint64_t suspect = 0;  // of the captured ones

  bool good() const { return damaged == 0 && suspect == 0; }
};
absl::StatusOr<VariantFacts> FactsOf(const Database& variant);
// The counts by name.
nlohmann::ordered_json JsonOf(const VariantFacts& facts);

// The configurations of outliers that a new capture may mend, in order: an image that touches the
// border stays as it is.
std::vector<ConfigurationNumber> Mendable(const std::vector<Outlier>& outliers);

// Of one variant, but for `variants`.
struct SessionFacts {
  std::string variant;
  std::vector<VariantFacts> variants;  // all that the database has
  DatabaseStatistics statistics;
  // Robot images that touch the border, per view.
  std::vector<uint64_t> touching;
  std::vector<Outlier> outliers;
  std::vector<ConfigurationNumber> suspects;
  std::vector<Standing> standings;  // by number
  storage::v1::CaptureHistory history;
  CaptureRepeatability repeatability;
  uint64_t raw_images = 0;  // configurations that have them
  // The newest lines of the log, and how many there are.
  std::vector<std::string> story;
  size_t story_lines = 0;
  // Commands for the shell, the first one first; none: nothing is to be repaired.
  std::vector<std::string> repair;

  uint64_t configurations() const {
    return statistics.captured + statistics.excluded + statistics.damaged + statistics.missing;
  }
  // Whether the sentinels did not match when they were visited last.
  bool alarmed() const {
    return !history.checks().empty() && !history.checks().rbegin()->alarm().empty();
  }
  uint64_t mendable() const { return Mendable(outliers).size(); }
  bool good() const { return repair.empty(); }
};

// Reads all records of all variants. `log`: a file, which need not be there.
absl::StatusOr<SessionFacts> GatherFacts(const CellArguments& arguments, const Database& database,
                                         const Snapshot& snapshot, const std::string& log);

}  // namespace silhouette
