// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-db/common.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-db/commands.h"

namespace silhouette {
namespace {

absl::StatusOr<int> JointOf(const ConfigurationGrid& grid, const std::string& name) {
  std::vector<std::string> names;
  for (int j = 0; j < grid.dimensions(); ++j) {
    names.push_back(grid.joints()[static_cast<size_t>(j)].name);
    if (names.back() == name) return j;
  }
  return absl::InvalidArgumentError(absl::StrCat("the grid has no joint '", name,
                                                 "'; its joints are ", absl::StrJoin(names, ", ")));
}

struct FixedValue {
  int joint = 0;
  double value = 0;
};

absl::StatusOr<FixedValue> ParseFixed(const ConfigurationGrid& grid, const std::string& text) {
  const std::pair<std::string, std::string> parts = absl::StrSplit(text, absl::MaxSplits('=', 1));
  FixedValue fixed;
  ASSIGN_OR_RETURN(const int joint, JointOf(grid, parts.first));
  if (!absl::SimpleAtod(parts.second, &fixed.value)) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", text, "' is not joint=value with a value in radians or metres"));
  }
  fixed.joint = joint;
  return fixed;
}

}  // namespace

absl::StatusOr<OpenedDatabase> OpenForReading(const std::string& path, const std::string& variant) {
  absl::StatusOr<std::unique_ptr<Database>> database =
      Database::Open(path, Database::Access::kRead);
  if (database.ok()) database = (*database)->OpenVariant(variant);
  if (!database.ok()) return database.status();
  ASSIGN_OR_RETURN(Snapshot snapshot, (*database)->Read());
  return OpenedDatabase{*std::move(database), std::move(snapshot)};
}

void AddDatabaseArgument(CLI::App& command, std::string& database) {
  command.add_option("database,--database", database, "Folder of the database")->required();
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

std::string JointText(const ConfigurationGrid& grid, ConfigurationNumber number) {
  const Configuration q = grid.At(number);
  std::vector<std::string> parts;
  for (size_t j = 0; j < q.size(); ++j) {
    parts.push_back(absl::StrFormat("%s = %.6g", grid.joints()[j].name, q[j]));
  }
  return absl::StrJoin(parts, ", ");
}

nlohmann::json JointJson(const ConfigurationGrid& grid, ConfigurationNumber number) {
  const Configuration q = grid.At(number);
  nlohmann::json joints = nlohmann::json::object();
  for (size_t j = 0; j < q.size(); ++j) joints[grid.joints()[j].name] = q[j];
  return joints;
}

std::string TimeText(absl::Time time) {
  if (time == absl::UnixEpoch()) return "";
  return absl::FormatTime("%Y-%m-%dT%H:%M:%E*SZ", time, absl::UTCTimeZone());
}

std::vector<int> MovingJoints(const ConfigurationGrid& grid) {
  std::vector<int> moving;
  for (int j = 0; j < grid.dimensions(); ++j) {
    if (grid.joints()[static_cast<size_t>(j)].steps > 1) moving.push_back(j);
  }
  return moving;
}

ChartAxis AxisOf(const ConfigurationGrid& grid, int j) {
  const GridJoint& joint = grid.joints()[static_cast<size_t>(j)];
  return {.label = joint.name,
          .unit = "rad or m",  // the grid does not know which
          .first = joint.lower,
          .last = joint.lower + joint.step() * (joint.steps - 1),
          .cells = joint.steps};
}

absl::StatusOr<Slice> SliceOf(const ConfigurationGrid& grid, const std::vector<std::string>& along,
                              const std::vector<std::string>& fixed) {
  std::vector<int> axes;
  for (const std::string& name : along) {
    ASSIGN_OR_RETURN(const int joint, JointOf(grid, name));
    axes.push_back(joint);
  }
  if (axes.empty()) axes = MovingJoints(grid);
  if (axes.empty()) axes.push_back(0);
  if (axes.size() > 2) axes.resize(2);
  if (axes.size() == 2 && axes[0] == axes[1]) {
    return absl::InvalidArgumentError(absl::StrCat("joint '", along[0], "' is named twice"));
  }
  Slice slice;
  slice.across = axes[0];
  if (axes.size() == 2) slice.upwards = axes[1];
  for (int j = 0; j < grid.dimensions(); ++j) {
    slice.index[static_cast<size_t>(j)] = (grid.joints()[static_cast<size_t>(j)].steps - 1) / 2;
  }
  for (const std::string& text : fixed) {
    ASSIGN_OR_RETURN(const FixedValue value, ParseFixed(grid, text));
    const size_t j = static_cast<size_t>(value.joint);
    const GridJoint& joint = grid.joints()[j];
    if (std::find(axes.begin(), axes.end(), value.joint) != axes.end()) {
      return absl::InvalidArgumentError(
          absl::StrCat("joint '", joint.name, "' cannot be fixed and run along the sheet"));
    }
    const std::optional<double> place = grid.Place(value.joint, value.value);
    if (!place) {
      return absl::InvalidArgumentError(absl::StrCat("joint '", joint.name, "': ", value.value,
                                                     " is not within ", joint.lower, " to ",
                                                     joint.upper));
    }
    slice.index[j] = static_cast<int>(std::lround(*place)) % joint.steps;
  }
  const Configuration q = grid.At(slice.index);
  std::vector<std::string> others;
  for (int j = 0; j < grid.dimensions(); ++j) {
    if (std::find(axes.begin(), axes.end(), j) != axes.end()) continue;
    const size_t i = static_cast<size_t>(j);
    others.push_back(absl::StrFormat("%s = %.4g", grid.joints()[i].name, q[i]));
  }
  slice.others = absl::StrJoin(others, ", ");
  return slice;
}

std::string StateName(const CollisionIndexSummary& summary) {
  if (summary.tiles == 0) return "no robot images";
  if (summary.missing == summary.tiles) return "none";
  if (summary.fresh == summary.tiles) return "fresh";
  return summary.damaged > 0 ? "damaged" : "stale";
}

std::string StateText(const CollisionIndexSummary& summary, const std::string& database) {
  const std::string name = StateName(summary);
  if (summary.tiles == 0) return "none, there are no robot images";
  const std::string mend = absl::StrCat("silhouette-db index ", database);
  if (name == "none") return absl::StrCat("none; build it with: ", mend);
  std::string text;
  if (name == "fresh") {
    text = absl::StrFormat("fresh, %d tiles, %.1f MiB", summary.tiles,
                           static_cast<double>(summary.bytes) / (1 << 20));
    if (summary.unreadable > 0) {
      absl::StrAppend(&text, "; without ", summary.unreadable, " records that could not be read");
    }
    return text;
  }
  std::vector<std::string> parts;
  const auto count = [&](uint64_t tiles, const char* what) {
    if (tiles > 0) parts.push_back(absl::StrCat(tiles, " ", what));
  };
  count(summary.damaged, "damaged");
  count(summary.stale, "stale");
  count(summary.missing, "missing");
  return absl::StrCat("of ", summary.tiles, " tiles ", absl::StrJoin(parts, ", "),
                      "; build them with: ", mend);
}

nlohmann::json StateJson(const CollisionIndexSummary& summary) {
  return {{"state", StateName(summary)},      {"tiles", summary.tiles},
          {"fresh", summary.fresh},           {"stale", summary.stale},
          {"missing", summary.missing},       {"damaged", summary.damaged},
          {"unreadable", summary.unreadable}, {"bytes", summary.bytes}};
}

std::string VariantsText(const Database::Usage& usage, const ConfigurationGrid& grid) {
  std::string text = "variants                              recorded     records       index\n";
  for (const Database::Usage::Variant& variant : usage.variants) {
    absl::StrAppendFormat(
        &text, "  %-32s %6.1f %%  %6.1f MiB  %6.1f MiB\n", variant.name,
        100.0 * static_cast<double>(variant.records) / static_cast<double>(grid.size()),
        static_cast<double>(variant.record_bytes) / (1 << 20),
        static_cast<double>(variant.index_bytes) / (1 << 20));
  }
  return text;
}

nlohmann::json VariantsJson(const Database::Usage& usage) {
  nlohmann::json variants = nlohmann::json::array();
  for (const Database::Usage::Variant& variant : usage.variants) {
    variants.push_back({{"name", variant.name},
                        {"records", variant.records},
                        {"record_bytes", variant.record_bytes},
                        {"index_bytes", variant.index_bytes}});
  }
  return variants;
}

void Print(const std::string& format, const std::string& text, const nlohmann::json& json) {
  std::cout << (format == "json" ? json.dump(2) + "\n" : text) << std::flush;
}

absl::Status Stopped(const std::string& how_to_go_on) {
  return absl::CancelledError("stopped; " + how_to_go_on);
}

}  // namespace silhouette
