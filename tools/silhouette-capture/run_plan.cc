// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-capture/run_plan.h"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "capture/session/history.h"
#include "capture/session/raw_archive.h"
#include "capture/session/sentinels.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "db/store/outliers.h"
#include "tools/program/progress.h"
#include "tools/silhouette-capture/session_facts.h"

namespace silhouette {
namespace {

using Numbers = std::vector<ConfigurationNumber>;

absl::StatusOr<Numbers> Outliers(const Database& database) {
  ASSIGN_OR_RETURN(const auto snapshot, database.Read());
  ASSIGN_OR_RETURN(const auto outliers, FindOutliers(snapshot, database.grid()));
  return Mendable(outliers);
}

absl::StatusOr<Numbers> Suspects(const Database& database) {
  ASSIGN_OR_RETURN(const auto snapshot, database.Read());
  return SuspectNumbers(snapshot);
}

// Nothing if they are not numbers.
std::optional<Numbers> ParseNumbers(const std::string& text) {
  Numbers numbers;
  for (const absl::string_view word : absl::StrSplit(text, ',')) {
    uint64_t number = 0;
    if (!absl::SimpleAtoi(word, &number)) return std::nullopt;
    numbers.push_back(number);
  }
  return numbers;
}

absl::StatusOr<CaptureSelection> Select(const PlanArguments& arguments, const Database* database) {
  using Kind = CaptureSelection::Kind;
  CaptureSelection selection{.new_sentinels = arguments.new_sentinels,
                             .exclude_captured = arguments.exclude_captured};
  if (arguments.only == "missing" || database == nullptr) return selection;
  if (arguments.only == "all") {
    selection.kind = Kind::kAll;
    return selection;
  }
  if (arguments.only == "sentinels") {
    selection.kind = Kind::kNothing;
    return selection;
  }
  selection.kind = Kind::kListed;
  if (arguments.only == "outliers") {
    ASSIGN_OR_RETURN(selection.listed, Outliers(*database));
  } else if (arguments.only == "suspect") {
    ASSIGN_OR_RETURN(selection.listed, Suspects(*database));
  } else {
    selection.listed = ParseNumbers(arguments.only).value_or(Numbers());
  }
  return selection;
}

// Adds `count` sentinels: those that the database knows, and others if these are too few.
absl::Status AddSentinels(const Database& database, const Travel& travel, int count,
                          CaptureSelection& selection) {
  ASSIGN_OR_RETURN(const auto snapshot, database.Read());
  ASSIGN_OR_RETURN(const auto history, snapshot.CaptureHistory());
  selection.kind = CaptureSelection::Kind::kListed;
  const auto may_visit = [&](ConfigurationNumber number) {
    return travel.grid().Contains(number) && !travel.Forbidden(number);
  };
  Numbers known;
  std::ranges::copy_if(history.sentinels(), std::back_inserter(known), may_visit);
  Numbers all;
  std::ranges::copy_if(travel.Serpentine(), std::back_inserter(all), may_visit);
  const Numbers sentinels = WellSpread(travel.grid(), all, count, std::move(known));
  selection.listed.insert(selection.listed.end(), sentinels.begin(), sentinels.end());
  return absl::OkStatus();
}

}  // namespace

std::string CheckOnly(const std::string& only) {
  static const std::set<std::string> words = {"missing", "outliers", "suspect", "all", "sentinels"};
  if (words.contains(only) || ParseNumbers(only)) return "";
  return absl::StrCat("'", only,
                      "': missing, outliers, suspect, all, sentinels, or configuration numbers "
                      "with commas are expected");
}

absl::StatusOr<CapturePlan> MakePlan(const PlanArguments& arguments,
                                     const CellArguments& cell_arguments, const Cell& cell,
                                     const Travel& travel, const Database* database) {
  ASSIGN_OR_RETURN(CaptureSelection selection, Select(arguments, database));
  std::vector<StoredRecord> records = NoRecords(travel.grid());
  if (database != nullptr) {
    ASSIGN_OR_RETURN(records, ReadRecords(*database));
    if (arguments.new_sentinels && selection.kind != CaptureSelection::Kind::kAll) {
      RETURN_IF_ERROR(AddSentinels(*database, travel, cell.capture.sentinels.count, selection));
    }
  }
  auto plan = PlanCapture(DescriptionOf(cell), travel, records, cell.capture, selection);
  if (absl::IsFailedPrecondition(plan.status())) {
    return absl::FailedPreconditionError(absl::StrCat(
        plan.status().message(), "; change the region, or drop these robot images and have the ",
        "configurations excluded: ", cell_arguments.Command("run"), " --exclude-captured"));
  }
  return plan;
}

DiskRoom RoomFor(const CapturePlan& plan, const CellFile& file, const Database* database) {
  DiskRoom room{
      .raw_bytes = 0, .available = std::nullopt, .keep_free = file.cell.capture.keep_free};
  const CaptureSettings& settings = file.cell.capture;
  uint64_t images = plan.captures.size();
  if (settings.raw_images == RawImages::kNone) images = 0;
  if (settings.raw_images == RawImages::kSentinels) {
    images = std::min<uint64_t>(images, static_cast<uint64_t>(settings.sentinels.count));
  }
  images *= static_cast<uint64_t>(settings.still_images);
  if (images > 0) room.raw_bytes = images * EstimateRawBytes(DescriptionOf(file.cell), database);
  // Where the folder is, or will be.
  std::error_code error;
  std::filesystem::path folder = std::filesystem::absolute(file.database, error);
  while (!std::filesystem::exists(folder, error) && folder.has_relative_path()) {
    folder = folder.parent_path();
  }
  const auto space = std::filesystem::space(folder, error);
  if (!error) room.available = space.available;
  return room;
}

namespace {

std::string SpokenBytes(uint64_t bytes) {
  const auto amount = static_cast<double>(bytes);
  return bytes < 1'000'000'000 ? absl::StrFormat("%.1f MB", amount / 1e6)
                               : absl::StrFormat("%.1f GB", amount / 1e9);
}

double PerSecond(const CaptureReport& report) {
  const double seconds = absl::ToDoubleSeconds(report.duration);
  return seconds > 0 ? static_cast<double>(report.captured) / seconds : 0;
}

std::string State(const CaptureReport& report) {
  if (!report.status.ok()) return "failed";
  if (!report.alarm.empty()) return "paused";
  if (report.stopped) return "stopped";
  return report.complete() ? "complete" : "incomplete";
}

}  // namespace

bool DiskRoom::Suffices(const CapturePlan& plan) const {
  return !available || *available >= plan.bytes + raw_bytes + keep_free;
}

std::string TooLittleRoom(const CapturePlan& plan, const DiskRoom& room) {
  return absl::StrFormat(
      "the disk has %s free; up to %s are needed%s, and %s are to stay free (keep_free): make "
      "room, "
      "or expect the session to end before the disk is full",
      SpokenBytes(room.available.value_or(0)), SpokenBytes(plan.bytes + room.raw_bytes),
      room.raw_bytes > 0
          ? absl::StrFormat(", about %s of it for raw images", SpokenBytes(room.raw_bytes))
          : "",
      SpokenBytes(room.keep_free));
}

std::string PlanText(const CapturePlan& plan, const DiskRoom& room) {
  std::string text =
      absl::StrFormat("to capture         %d configurations\n", plan.captures.size());
  if (!plan.exclusions.empty()) {
    absl::StrAppendFormat(&text, "to exclude         %d, in forbidden regions\n",
                          plan.exclusions.size());
  }
  absl::StrAppendFormat(&text, "there already      %d\n", plan.kept);
  const absl::Time now = absl::Now();
  absl::StrAppendFormat(
      &text,
      "time               about %s if the robot moves at joint_speed; begun now, done about %s\n",
      Spoken(plan.duration), ClockTime(now + plan.duration, now));
  absl::StrAppendFormat(&text, "room on disk       at most %s", SpokenBytes(plan.bytes));
  if (room.available) absl::StrAppendFormat(&text, "; %s are free", SpokenBytes(*room.available));
  text += "\n";
  if (room.raw_bytes > 0) {
    absl::StrAppendFormat(&text, "for raw images     about %s more\n", SpokenBytes(room.raw_bytes));
  }
  if (!room.Suffices(plan)) absl::StrAppend(&text, TooLittleRoom(plan, room), "\n");
  if (plan.parts > 1) {
    absl::StrAppendFormat(&text,
                          "the forbidden regions cut the grid into %d parts; the robot captures "
                          "the one it stands in\n",
                          plan.parts);
  }
  return text;
}

nlohmann::json PlanJson(const CapturePlan& plan, const DiskRoom& room) {
  nlohmann::json json = {{"dry_run", true},
                         {"configurations", plan.captures.size()},
                         {"exclusions", plan.exclusions.size()},
                         {"kept", plan.kept},
                         {"seconds", absl::ToDoubleSeconds(plan.duration)},
                         {"end", absl::FormatTime(absl::Now() + plan.duration)},
                         {"bytes", plan.bytes},
                         {"raw_image_bytes", room.raw_bytes},
                         {"fits_on_disk", room.Suffices(plan)},
                         {"parts", plan.parts}};
  if (room.available) json["available_bytes"] = *room.available;
  return json;
}

std::string ReportText(const CaptureReport& report) {
  std::string text =
      absl::StrFormat("captured           %d of %d configurations in %s (%.1f per second)\n",
                      report.captured, report.planned, Spoken(report.duration), PerSecond(report));
  const auto count = [&](const char* name, uint64_t value, const char* what) {
    if (value > 0) absl::StrAppendFormat(&text, "%-17s  %d %s\n", name, value, what);
  };
  count("there already", report.kept, "");
  count("excluded", report.excluded, "in forbidden regions");
  count("failed", report.failed, "where the robot was not within joint_tolerance");
  count("unreachable", report.unreachable, "to which no way leads around the forbidden regions");
  count("sentinels", report.sentinel_checks, "times visited");
  count("suspect", report.suspect, "captured while the cell may have changed");
  if (report.losses > 0) {
    absl::StrAppendFormat(&text, "waited             %s for lost devices, %d times\n",
                          Spoken(report.waited), report.losses);
  }
  if (report.captured == 0) return text;
  absl::StrAppendFormat(&text, "largest deviation  %.5f rad or m\n", report.max_deviation);
  text += "view                mean area  robot not seen  touching the border\n";
  for (const ViewQuality& view : report.views) {
    absl::StrAppendFormat(&text, "  %-16s %9.1f px  %14d  %19d\n", view.name, view.mean_area(),
                          view.empty, view.touching_border);
  }
  return text;
}

nlohmann::json ReportJson(const CaptureReport& report) {
  nlohmann::json json = {{"state", State(report)},
                         {"message", std::string(report.status.message())},
                         {"alarm", report.alarm},
                         {"sentinel_checks", report.sentinel_checks},
                         {"suspect", report.suspect},
                         {"losses", report.losses},
                         {"waited_seconds", absl::ToDoubleSeconds(report.waited)},
                         {"configurations", report.planned},
                         {"captured", report.captured},
                         {"excluded", report.excluded},
                         {"kept", report.kept},
                         {"failed", report.failed},
                         {"unreachable", report.unreachable},
                         {"max_deviation", report.max_deviation},
                         {"seconds", absl::ToDoubleSeconds(report.duration)},
                         {"per_second", PerSecond(report)},
                         {"views", report.views.size()},
                         {"view_quality", nlohmann::json::array()}};
  for (const ViewQuality& view : report.views) {
    json["view_quality"].push_back({{"name", view.name},
                                    {"images", view.images},
                                    {"mean_area", view.mean_area()},
                                    {"empty", view.empty},
                                    {"touching_border", view.touching_border}});
  }
  return json;
}

std::string IndexText(const IndexBuildReport& report) {
  return absl::StrFormat("collision index    %d of %s built%s\n", report.built,
                         Counted(report.tiles, "tile"),
                         report.stopped                ? ", stopped"
                         : report.built < report.tiles ? ", the others are fresh"
                                                       : "");
}

nlohmann::json IndexJson(const IndexBuildReport& report) {
  return {{"complete", !report.stopped},
          {"tiles", report.tiles},
          {"built", report.built},
          {"bytes", report.bytes}};
}

}  // namespace silhouette
