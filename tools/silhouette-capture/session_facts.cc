// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-capture/session_facts.h"

#include <algorithm>
#include <fstream>
#include <set>

#include "absl/strings/str_cat.h"
#include "capture/session/capture_plan.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

constexpr size_t kStoryLines = 200;

absl::StatusOr<std::vector<Standing>> StandingsOf(const Database& database,
                                                  const SessionFacts& facts) {
  ASSIGN_OR_RETURN(const auto records, ReadRecords(database));
  std::vector<Standing> standings;
  for (const StoredRecord record : records) {
    standings.push_back(record == StoredRecord::kDamaged    ? Standing::kDamaged
                        : record == StoredRecord::kExcluded ? Standing::kExcluded
                        : record == StoredRecord::kCaptured ? Standing::kCaptured
                                                            : Standing::kMissing);
  }
  for (const Outlier& outlier : facts.outliers) {
    Standing& standing = standings[outlier.number];
    if (outlier.reason != OutlierReason::kDamaged)
      standing = std::max(standing, Standing::kOutlier);
  }
  for (const ConfigurationNumber number : facts.suspects) {
    standings[number] = std::max(standings[number], Standing::kSuspect);
  }
  return standings;
}

absl::StatusOr<std::vector<VariantFacts>> FactsOfVariants(const Database& database) {
  ASSIGN_OR_RETURN(const auto names, database.Variants());
  std::vector<VariantFacts> variants;
  for (const std::string& name : names) {
    ASSIGN_OR_RETURN(const auto variant, database.OpenVariant(name));
    ASSIGN_OR_RETURN(auto facts, FactsOf(*variant));
    variants.push_back(std::move(facts));
  }
  return variants;
}

void ReadStory(const std::string& log, SessionFacts& facts) {
  std::ifstream in(log);
  for (std::string line; std::getline(in, line); ++facts.story_lines) facts.story.push_back(line);
  if (facts.story.size() > kStoryLines) {
    facts.story.erase(facts.story.begin(),
                      facts.story.end() - static_cast<std::ptrdiff_t>(kStoryLines));
  }
}

std::vector<std::string> RepairOf(const CellArguments& arguments, const SessionFacts& facts) {
  std::vector<std::string> repair;
  const std::string run = arguments.Command("run");
  if (!facts.suspects.empty() || facts.alarmed()) repair.push_back(run + " --only sentinels");
  if (!facts.suspects.empty()) repair.push_back(run + " --only suspect");
  if (facts.mendable() > 0) repair.push_back(run + " --only outliers");
  if (facts.statistics.missing > 0 && facts.suspects.empty() && facts.mendable() == 0) {
    repair.push_back(run);
  }
  return repair;
}

}  // namespace

absl::StatusOr<VariantFacts> FactsOf(const Database& variant) {
  VariantFacts facts;
  facts.name = variant.variant();
  ASSIGN_OR_RETURN(const auto records, ReadRecords(variant));
  const auto count = [&](StoredRecord kind) {
    return static_cast<uint64_t>(std::ranges::count(records, kind));
  };
  facts.captured = count(StoredRecord::kCaptured);
  facts.excluded = count(StoredRecord::kExcluded);
  facts.damaged = count(StoredRecord::kDamaged);
  facts.missing = variant.grid().size() - facts.captured - facts.excluded - facts.damaged;
  ASSIGN_OR_RETURN(const auto snapshot, variant.Read());
  ASSIGN_OR_RETURN(const auto suspects, SuspectNumbers(snapshot));
  facts.suspect = suspects.size();
  return facts;
}

nlohmann::ordered_json JsonOf(const VariantFacts& facts) {
  return {{"captured", facts.captured},
          {"excluded", facts.excluded},
          {"damaged", facts.damaged},
          {"missing", facts.missing},
          {"suspect", facts.suspect}};
}

std::vector<ConfigurationNumber> Mendable(const std::vector<Outlier>& outliers) {
  std::set<ConfigurationNumber> numbers;
  for (const Outlier& outlier : outliers) {
    if (outlier.reason != OutlierReason::kTouchesBorder) numbers.insert(outlier.number);
  }
  return {numbers.begin(), numbers.end()};
}

absl::StatusOr<SessionFacts> GatherFacts(const CellArguments& arguments, const Database& database,
                                         const Snapshot& snapshot, const std::string& log) {
  SessionFacts facts;
  facts.variant = database.variant();
  ASSIGN_OR_RETURN(facts.variants, FactsOfVariants(database));
  ASSIGN_OR_RETURN(facts.statistics,
                   StatisticsOf(snapshot, database.grid(), database.mask_sizes()));
  ASSIGN_OR_RETURN(facts.outliers, FindOutliers(snapshot, database.grid()));
  ASSIGN_OR_RETURN(facts.suspects, SuspectNumbers(snapshot));
  ASSIGN_OR_RETURN(facts.history, snapshot.CaptureHistory());
  facts.repeatability = RepeatabilityOf(facts.history, database.cell());
  ASSIGN_OR_RETURN(const auto raw_images, snapshot.RawImageNumbers());
  facts.raw_images = raw_images.size();
  facts.touching.resize(database.mask_sizes().size());
  for (const Outlier& outlier : facts.outliers) {
    if (outlier.reason != OutlierReason::kTouchesBorder || outlier.view < 0) continue;
    ++facts.touching[static_cast<size_t>(outlier.view)];
  }
  ASSIGN_OR_RETURN(facts.standings, StandingsOf(database, facts));
  ReadStory(log, facts);
  facts.repair = RepairOf(arguments, facts);
  return facts;
}

}  // namespace silhouette
