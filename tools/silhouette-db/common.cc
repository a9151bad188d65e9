// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-db/common.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/numbers/numbers.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/program/for_shell.h"
#include "tools/silhouette-db/commands.h"

namespace silhouette {
namespace {

using Json = nlohmann::ordered_json;

std::string StateName(const CollisionIndexSummary& summary) {
  if (summary.tiles == 0) return "no robot images";
  if (summary.missing == summary.tiles) return "none";
  if (summary.fresh == summary.tiles) return "fresh";
  return summary.damaged > 0 ? "damaged" : "stale";
}

}  // namespace

absl::StatusOr<OpenedDatabase> OpenForReading(const std::string& path, const std::string& variant) {
  ASSIGN_OR_RETURN(std::unique_ptr<Database> database,
                   Database::Open(path, Database::Access::kRead));
  ASSIGN_OR_RETURN(database, database->OpenVariant(variant));
  ASSIGN_OR_RETURN(Snapshot snapshot, database->Read());
  return OpenedDatabase{std::move(database), std::move(snapshot)};
}

absl::StatusOr<std::unique_ptr<Database>> OpenOfCell(const std::string& path, const Cell& cell) {
  auto database = Database::Open(path, Database::Access::kWrite);
  if (!database.ok()) return database;
  const std::vector<std::string> differences =
      Differences(DescriptionOf(cell), "the cell file", (*database)->cell(), "the database");
  if (differences.empty()) return database;
  return absl::FailedPreconditionError(absl::StrCat("database '", path,
                                                    "' is not that of cell file '", cell.file,
                                                    "': ", absl::StrJoin(differences, "; ")));
}

absl::StatusOr<std::map<std::string, storage::v1::DrawnImages>> DrawnByVariant(
    const Database& database) {
  std::map<std::string, storage::v1::DrawnImages> drawn_by_variant;
  ASSIGN_OR_RETURN(const std::vector<VariantState> variants, database.ReadVariants());
  for (const VariantState& variant : variants) {
    ASSIGN_OR_RETURN(const auto drawn, variant.snapshot.DrawnImages());
    if (drawn) drawn_by_variant[variant.database->variant()] = *drawn;
  }
  return drawn_by_variant;
}

void AddVariantOption(CLI::App& command, std::string& variant) {
  command.add_option("--variant", variant, "The variant, by its name")->capture_default_str();
}

absl::StatusOr<int> ViewOf(const storage::v1::CellDescription& cell, const std::string& name) {
  std::vector<std::string> known;
  for (int i = 0; i < cell.views_size(); ++i) {
    if (name.empty() || cell.views(i).name() == name) return i;
    known.push_back(cell.views(i).name());
  }
  return absl::InvalidArgumentError(
      absl::StrCat("there is no view '", name, "'; the views are ", absl::StrJoin(known, ", ")));
}

bool ShowsNoRobot(const RobotImage& image) {
  return !image.excluded && std::ranges::all_of(image.masks, &Mask::Empty);
}

std::string JointText(const ConfigurationGrid& grid, ConfigurationNumber number) {
  const Configuration q = grid.At(number);
  std::vector<std::string> parts;
  for (size_t j = 0; j < q.size(); ++j) {
    parts.push_back(absl::StrFormat("%s = %.6g", grid.joints()[j].name, q[j]));
  }
  return absl::StrJoin(parts, ", ");
}

Json JointJson(const ConfigurationGrid& grid, ConfigurationNumber number) {
  const Configuration q = grid.At(number);
  Json joints = Json::object();
  for (size_t j = 0; j < q.size(); ++j) joints[grid.joints()[j].name] = q[j];
  return joints;
}

std::string TimeText(absl::Time time) {
  if (time == absl::UnixEpoch()) return "";
  return absl::FormatTime("%Y-%m-%dT%H:%M:%E*SZ", time, absl::UTCTimeZone());
}

std::string MiB(uint64_t bytes) {
  return absl::StrFormat("%.1f MiB", static_cast<double>(bytes) / (1 << 20));
}

std::vector<int> MovingJoints(const ConfigurationGrid& grid) {
  std::vector<int> moving;
  for (int j = 0; j < grid.dimensions(); ++j) {
    if (grid.joints()[static_cast<size_t>(j)].steps > 1) moving.push_back(j);
  }
  return moving;
}

Picture EnlargedTo(int side, const Picture& picture) {
  return Enlarged(picture, std::max(1, side / std::max(picture.cols, picture.rows)));
}

std::string StateText(const CollisionIndexSummary& summary, const std::string& database) {
  const std::string name = StateName(summary);
  if (summary.tiles == 0) return "none, there are no robot images";
  const std::string mend = absl::StrCat("silhouette-db index ", ForShell(database));
  if (name == "none") return absl::StrCat("none; build it with: ", mend);
  if (name == "fresh") {
    return absl::StrCat("fresh, ", Counted(summary.tiles, "tile"), ", ", MiB(summary.bytes),
                        summary.unreadable == 0 ? ""
                                                : absl::StrCat("; without ", summary.unreadable,
                                                               " records that cannot be read"));
  }
  std::vector<std::string> parts;
  for (const auto& [tiles, what] : {std::pair(summary.damaged, "damaged"),
                                    {summary.stale, "stale"},
                                    {summary.missing, "missing"}}) {
    if (tiles > 0) parts.push_back(absl::StrCat(tiles, " ", what));
  }
  return absl::StrCat("of ", Counted(summary.tiles, "tile"), " ", absl::StrJoin(parts, ", "),
                      "; build them with: ", mend);
}

Json StateJson(const CollisionIndexSummary& summary) {
  return {{"state", StateName(summary)},      {"tiles", summary.tiles},
          {"fresh", summary.fresh},           {"stale", summary.stale},
          {"missing", summary.missing},       {"damaged", summary.damaged},
          {"unreadable", summary.unreadable}, {"bytes", summary.bytes}};
}

std::string VariantsText(const Database::Usage& usage, const ConfigurationGrid& grid) {
  Table table{.headings = {"variants", "recorded", "records", "index"}};
  for (const Database::Usage::Variant& variant : usage.variants) {
    table.rows.push_back({variant.name,
                          absl::StrFormat("%.1f %%", Percent(variant.records, grid.size())),
                          MiB(variant.record_bytes), MiB(variant.index_bytes)});
  }
  return TextOf(table);
}

Json VariantsJson(const Database::Usage& usage) {
  Json variants = Json::array();
  for (const Database::Usage::Variant& variant : usage.variants) {
    variants.push_back({{"name", variant.name},
                        {"records", variant.records},
                        {"record_bytes", variant.record_bytes},
                        {"index_bytes", variant.index_bytes}});
  }
  return variants;
}

absl::Status Stopped(const std::string& how_to_go_on) {
  return absl::CancelledError("stopped; " + how_to_go_on);
}

}  // namespace silhouette
