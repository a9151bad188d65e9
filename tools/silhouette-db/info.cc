// SPDX-License-Identifier: Apache-2.0
// silhouette-db info: what a database holds, without reading its robot images' masks.
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/numbers/numbers.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "db/store/schema.h"
#include "db/store/shards.h"
#include "tools/silhouette-db/commands.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

using Json = nlohmann::ordered_json;

std::string Shortest(double value) { return absl::StrFormat("%.5g", value); }

// Text of a table under an empty line; none without rows.
std::string Paragraph(const Table& table) { return table.rows.empty() ? "" : "\n" + TextOf(table); }

void AppendJoints(const Database& database, std::string& text, Json& json) {
  const ConfigurationGrid& grid = database.grid();
  Table moving{.headings = {"grid joints", "lower", "upper", "steps", "step", "tile edge", ""}};
  json["grid_joints"] = Json::array();
  for (size_t j = 0; j < grid.joints().size(); ++j) {
    const GridJoint& joint = grid.joints()[j];
    const int edge = grid.tile_edges()[j];
    moving.rows.push_back({joint.name, Shortest(joint.lower), Shortest(joint.upper),
                           absl::StrCat(joint.steps), Shortest(joint.step()), absl::StrCat(edge),
                           joint.continuous ? "continuous" : ""});
    json["grid_joints"].push_back({{"name", joint.name},
                                   {"lower", joint.lower},
                                   {"upper", joint.upper},
                                   {"steps", joint.steps},
                                   {"continuous", joint.continuous},
                                   {"tile_edge", edge}});
  }
  Table fixed{.headings = {"fixed joints", "position"}};
  json["fixed_joints"] = Json::object();
  for (const auto& joint : database.cell().fixed_joints()) {
    fixed.rows.push_back({joint.name(), Shortest(joint.position())});
    json["fixed_joints"][joint.name()] = joint.position();
  }
  text += Paragraph(moving) + Paragraph(fixed);
}

void AppendViews(const storage::v1::CellDescription& cell, std::string& text, Json& json) {
  Table views{.headings = {"views", "mask", "image"}};
  json["views"] = Json::array();
  for (const auto& view : cell.views()) {
    const auto size = [](int width, int height) {
      return width > 0 ? absl::StrCat(width, "x", height) : "none";
    };
    views.rows.push_back({view.name(), size(view.mask_width(), view.mask_height()),
                          size(view.image_width(), view.image_height())});
    json["views"].push_back({{"name", view.name()},
                             {"mask_size", {view.mask_width(), view.mask_height()}},
                             {"image_size", {view.image_width(), view.image_height()}}});
  }
  text += Paragraph(views);
}

std::string StampText(const google::protobuf::Timestamp& time) {
  return absl::FormatTime("%Y-%m-%d %H:%M:%S UTC", absl::FromUnixSeconds(time.seconds()),
                          absl::UTCTimeZone());
}

void AppendProvenance(const storage::v1::ProvenanceLog& log, std::string& text, Json& json) {
  Table entries{.headings = {"written at", "robot images", "variant", "by"}};
  json["provenance"] = Json::array();
  for (const auto& entry : log.entries()) {
    const std::string time = StampText(entry.time());
    const std::string variant = entry.variant().empty() ? schema::kDefaultVariant : entry.variant();
    entries.rows.push_back({time, absl::StrCat(entry.robot_images()), variant, entry.program()});
    json["provenance"].push_back({{"time", time},
                                  {"program", entry.program()},
                                  {"variant", variant},
                                  {"robot_images", entry.robot_images()}});
  }
  text += Paragraph(entries);
}

// A line; empty without a verification of the model.
std::string VerificationText(const std::optional<storage::v1::ModelVerification>& verification) {
  if (!verification) return "";
  std::string growth;
  for (const storage::v1::LinkGrowth& link : verification->link_growth()) {
    if (link.growth() == 0) continue;
    absl::StrAppendFormat(&growth, ", %s grown by %.1f cm", link.link(), 100 * link.growth());
  }
  std::string ranges;
  for (const storage::v1::VerifiedRange& range : verification->ranges()) {
    absl::StrAppendFormat(&ranges, ", %s from %g to %g", range.joint(), range.lower(),
                          range.upper());
  }
  if (ranges.empty()) ranges = ", without joint ranges, so it does not count";
  return absl::StrFormat("model verified  %s, by %d configurations%s%s\n",
                         StampText(verification->time()), verification->configurations(), ranges,
                         growth);
}

Json VerificationJson(const std::optional<storage::v1::ModelVerification>& verification) {
  if (!verification) return nullptr;
  Json json = {{"time", StampText(verification->time())},
               {"digest", verification->digest()},
               {"configurations", verification->configurations()},
               {"ranges", Json::object()},
               {"link_growth", Json::object()},
               {"held_out_masks", verification->held_out_masks()},
               {"held_out_missing", verification->held_out_missing()},
               {"additional", verification->additional()}};
  for (const storage::v1::VerifiedRange& range : verification->ranges()) {
    json["ranges"][range.joint()] = {range.lower(), range.upper()};
  }
  for (const storage::v1::LinkGrowth& link : verification->link_growth()) {
    json["link_growth"][link.link()] = link.growth();
  }
  return json;
}

// What robot images were drawn from; nothing of captured ones.
void AppendDrawn(const std::map<std::string, storage::v1::DrawnImages>& drawn_by_variant,
                 std::string& text, Json& json) {
  Table table{.headings = {"drawn images", "tolerance", "shard", "digest"}};
  json["drawn"] = Json::array();
  for (const auto& [variant, drawn] : drawn_by_variant) {
    const std::string shard = drawn.shards() > 1 ? NameOfShard(drawn) : "whole";
    table.rows.push_back(
        {variant, absl::StrFormat("%g mm", 1000 * drawn.tolerance()), shard, drawn.digest()});
    json["drawn"].push_back({{"variant", variant},
                             {"tolerance", drawn.tolerance()},
                             {"shard", drawn.shard()},
                             {"shards", drawn.shards()},
                             {"digest", drawn.digest()}});
  }
  text += Paragraph(table);
}

absl::StatusOr<ExitCode> Info(const DatabaseOptions& options) {
  ASSIGN_OR_RETURN(OpenedDatabase opened, OpenForReading(options.database));
  const Database& database = *opened.database;
  ASSIGN_OR_RETURN(const Database::Usage usage, database.GetUsage());
  ASSIGN_OR_RETURN(const auto references, opened.snapshot.References());
  ASSIGN_OR_RETURN(const auto calibration, opened.snapshot.Calibration());
  ASSIGN_OR_RETURN(const auto verification, opened.snapshot.Verification());
  ASSIGN_OR_RETURN(const storage::v1::ProvenanceLog provenance, opened.snapshot.Provenance());
  ASSIGN_OR_RETURN(const auto drawn, DrawnByVariant(database));
  ASSIGN_OR_RETURN(const auto index, CollisionIndex::Open(std::move(opened.snapshot)));
  const uint64_t records = index->snapshot().size();
  const uint64_t size = database.grid().size();
  const CollisionIndexSummary summary = index->Summary();
  const std::string kind = !calibration                     ? "none"
                           : calibration->cameras().empty() ? "fundamental matrices"
                                                            : "cameras";
  std::string text = absl::StrFormat(
      "database        %s (format %d, generation %d)\n"
      "cell            %s\n"
      "configurations  %d of %d recorded (%.1f %%)\n"
      "references      %s\n"
      "calibration     %s\n"
      "%s"
      "collision index %s\n"
      "on disk         %s, %s of it in use\n",
      database.path(), schema::kFormatVersion, index->generation(), database.cell().name(), records,
      size, Percent(records, size), references ? "yes" : "none", kind,
      VerificationText(verification), StateText(summary, database.path()), MiB(usage.file_bytes),
      MiB(usage.used_bytes));
  Json json = {{"database", database.path()},
               {"format_version", schema::kFormatVersion},
               {"generation", index->generation()},
               {"cell", database.cell().name()},
               {"configurations", size},
               {"records", records},
               {"references", references.has_value()},
               {"calibration", kind},
               {"verification", VerificationJson(verification)},
               {"collision_index", StateJson(summary)},
               {"file_bytes", usage.file_bytes},
               {"used_bytes", usage.used_bytes},
               {"segmentation", database.cell().segmentation()},
               {"variants", VariantsJson(usage)}};
  AppendJoints(database, text, json);
  AppendViews(database.cell(), text, json);
  text += "\n" + VariantsText(usage, database.grid());
  AppendDrawn(drawn, text, json);
  AppendProvenance(provenance, text, json);
  PrintResult(options.format, json, text);
  return kDone;
}

}  // namespace

void AddInfo(CLI::App& app, Work& work) {
  auto [command, options] = AddCommand(app, work, "info", "What a database holds", Info);
  AddFormatOption(command, options.format);
  command.footer("Example:\n  silhouette-db info cell.lmdb");
}

}  // namespace silhouette
