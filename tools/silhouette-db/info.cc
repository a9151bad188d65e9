// SPDX-License-Identifier: Apache-2.0
// silhouette-db info: what a database holds, without reading its robot images' masks.
#include <iostream>
#include <memory>
#include <optional>

#include "absl/strings/str_format.h"
#include "db/status/status_macros.h"
#include "db/store/schema.h"
#include "tools/silhouette-db/commands.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

struct InfoOptions {
  std::string database;
  std::string format = "text";
};

struct Facts {
  uint64_t generation = 0;
  uint64_t records = 0;
  Database::Usage usage;
  bool references = false;
  std::optional<storage::v1::Calibration> calibration;
  storage::v1::ProvenanceLog provenance;
  CollisionIndexSummary index;
};

std::string InfoTimeOf(const storage::v1::Provenance& entry) {
  return absl::FormatTime("%Y-%m-%d %H:%M:%S UTC", absl::FromUnixSeconds(entry.time().seconds()),
                          absl::UTCTimeZone());
}

// "cameras", "fundamental matrices" or "none".
std::string InfoKindOf(const std::optional<storage::v1::Calibration>& calibration) {
  if (!calibration) return "none";
  return calibration->cameras().empty() ? "fundamental matrices" : "cameras";
}

std::string TextOf(const Database& database, const Facts& facts) {
  std::string text;
  const storage::v1::CellDescription& cell = database.cell();
  const ConfigurationGrid& grid = database.grid();
  absl::StrAppendFormat(
      &text,
      "database        %s (format %d, generation %d)\n"
      "cell            %s\n"
      "configurations  %d of %d recorded (%.1f %%)\n"
      "references      %s\n"
      "calibration     %s\n"
      "collision index %s\n"
      "on disk         %.1f MiB, %.1f MiB of it in use\n",
      database.path(), schema::kFormatVersion, facts.generation, cell.name(), facts.records,
      grid.size(), 100.0 * static_cast<double>(facts.records) / static_cast<double>(grid.size()),
      facts.references ? "yes" : "none", InfoKindOf(facts.calibration),
      StateText(facts.index, database.path()),
      static_cast<double>(facts.usage.file_bytes) / (1 << 20),
      static_cast<double>(facts.usage.used_bytes) / (1 << 20));
  absl::StrAppend(&text,
                  "\ngrid joints                lower       upper  steps        step  tile edge\n");
  for (size_t j = 0; j < grid.joints().size(); ++j) {
    const GridJoint& joint = grid.joints()[j];
    absl::StrAppendFormat(&text, "  %-20s %10.5g  %10.5g  %5d  %10.5g  %9d%s\n", joint.name,
                          joint.lower, joint.upper, joint.steps, joint.step(), grid.tile_edges()[j],
                          joint.continuous ? "  continuous" : "");
  }
  if (!cell.fixed_joints().empty()) absl::StrAppend(&text, "\nfixed joints            position\n");
  for (const auto& joint : cell.fixed_joints()) {
    absl::StrAppendFormat(&text, "  %-20s %10.5g\n", joint.name(), joint.position());
  }
  absl::StrAppend(&text, "\nviews                   mask       image\n");
  for (const auto& view : cell.views()) {
    const std::string image =
        view.image_width() > 0 ? absl::StrFormat("%dx%d", view.image_width(), view.image_height())
                               : "none";
    absl::StrAppendFormat(&text, "  %-20s  %-9s  %s\n", view.name(),
                          absl::StrFormat("%dx%d", view.mask_width(), view.mask_height()), image);
  }
  absl::StrAppend(&text, "\n", VariantsText(facts.usage, grid));
  if (!facts.provenance.entries().empty()) {
    absl::StrAppend(&text, "\nwritten by                robot images\n");
  }
  for (const auto& entry : facts.provenance.entries()) {
    absl::StrAppendFormat(&text, "  %s %12d  %s%s\n", InfoTimeOf(entry), entry.robot_images(),
                          entry.program(),
                          entry.variant().empty() ? "" : ", variant '" + entry.variant() + "'");
  }
  return text;
}

nlohmann::json JsonOf(const Database& database, const Facts& facts) {
  const storage::v1::CellDescription& cell = database.cell();
  const ConfigurationGrid& grid = database.grid();
  nlohmann::json json = {{"database", database.path()},
                         {"format_version", schema::kFormatVersion},
                         {"generation", facts.generation},
                         {"cell", cell.name()},
                         {"configurations", grid.size()},
                         {"records", facts.records},
                         {"references", facts.references},
                         {"calibration", InfoKindOf(facts.calibration)},
                         {"collision_index", StateJson(facts.index)},
                         {"file_bytes", facts.usage.file_bytes},
                         {"used_bytes", facts.usage.used_bytes},
                         {"segmentation", cell.segmentation()},
                         {"variants", VariantsJson(facts.usage)},
                         {"grid_joints", nlohmann::json::array()},
                         {"fixed_joints", nlohmann::json::object()},
                         {"views", nlohmann::json::array()},
                         {"provenance", nlohmann::json::array()}};
  for (size_t j = 0; j < grid.joints().size(); ++j) {
    const GridJoint& joint = grid.joints()[j];
    json["grid_joints"].push_back({{"name", joint.name},
                                   {"lower", joint.lower},
                                   {"upper", joint.upper},
                                   {"steps", joint.steps},
                                   {"continuous", joint.continuous},
                                   {"tile_edge", grid.tile_edges()[j]}});
  }
  for (const auto& joint : cell.fixed_joints()) {
    json["fixed_joints"][joint.name()] = joint.position();
  }
  for (const auto& view : cell.views()) {
    json["views"].push_back({{"name", view.name()},
                             {"mask_size", {view.mask_width(), view.mask_height()}},
                             {"image_size", {view.image_width(), view.image_height()}}});
  }
  for (const auto& entry : facts.provenance.entries()) {
    json["provenance"].push_back(
        {{"time", InfoTimeOf(entry)},
         {"program", entry.program()},
         {"variant", entry.variant().empty() ? schema::kDefaultVariant : entry.variant()},
         {"robot_images", entry.robot_images()}});
  }
  return json;
}

absl::StatusOr<ExitCode> Info(const InfoOptions& options) {
  ASSIGN_OR_RETURN(OpenedDatabase opened, OpenForReading(options.database));
  ASSIGN_OR_RETURN(const Database::Usage usage, opened.database->GetUsage());
  ASSIGN_OR_RETURN(const auto references, opened.snapshot.References());
  ASSIGN_OR_RETURN(const auto calibration, opened.snapshot.Calibration());
  ASSIGN_OR_RETURN(const storage::v1::ProvenanceLog provenance, opened.snapshot.Provenance());
  ASSIGN_OR_RETURN(const auto index, CollisionIndex::Open(std::move(opened.snapshot)));
  const Facts facts{
      index->generation(), index->snapshot().size(), usage, references.has_value(), calibration,
      provenance,          index->Summary()};
  Print(options.format, TextOf(*opened.database, facts), JsonOf(*opened.database, facts));
  return kDone;
}

}  // namespace

void AddInfo(CLI::App& app, Work& work) {
  auto [command, options] = AddCommand(app, work, "info", "What a database holds", Info);
  AddDatabaseArgument(command, options.database);
  AddFormatOption(command, options.format);
  command.footer("Example:\n  silhouette-db info cell.lmdb");
}

}  // namespace silhouette
