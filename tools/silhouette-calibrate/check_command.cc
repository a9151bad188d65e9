// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate check
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/picture/files.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/program/program.h"
#include "tools/silhouette-calibrate/check_views.h"
#include "tools/silhouette-calibrate/commands.h"
#include "tools/silhouette-calibrate/files.h"
#include "tools/silhouette-calibrate/pictures.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

struct CheckArguments {
  CheckRequest request;
  std::string out;
  std::string draw;
  std::string format = "text";
};

absl::Status Draw(const std::string& folder, const Checked& checked) {
  RETURN_IF_ERROR(MakeFolder(folder));
  for (size_t i = 0; i < checked.drifts.size(); ++i) {
    const ViewDrift& drift = checked.drifts[i];
    const std::string file = (fs::path(folder) / absl::StrCat("check_", drift.view, ".png"));
    RETURN_IF_ERROR(
        WritePng(file, PaintDrift(drift, checked.sizes[i], checked.check.limit_mask_px)));
  }
  return absl::OkStatus();
}

double Degrees(double radians) { return radians * 180 / std::numbers::pi; }

std::string TextOf(const Checked& checked) {
  std::string text;
  for (size_t i = 0; i < checked.drifts.size(); ++i) {
    const ViewDrift& drift = checked.drifts[i];
    if (!drift.checked) {
      absl::StrAppend(&text, drift.view, ": not checked: ", drift.message, "\n");
      continue;
    }
    absl::StrAppendFormat(&text, "%s: %s by %.2f px (%.3f mask px): shift (%.2f, %.2f) px",
                          drift.view, checked.check.views[i].holds ? "holds, moved" : "MOVED",
                          drift.moved, drift.moved_mask, drift.shift.x(), drift.shift.y());
    if (drift.corners > 0) {
      absl::StrAppendFormat(&text, ", turn %.3f deg; %d corners, %.3f px rms left",
                            Degrees(drift.turn), drift.corners, drift.rms_left);
    }
    absl::StrAppend(&text, drift.message.empty() ? "" : "; ", drift.message, "\n");
  }
  absl::StrAppendFormat(&text, "limit %.3g mask px: the calibration %s\n",
                        checked.check.limit_mask_px,
                        checked.check.Holds() ? "holds" : "is not known to hold");
  return text;
}

nlohmann::ordered_json JsonOf(const Checked& checked) {
  auto json = nlohmann::ordered_json::parse(CheckFileText(checked.check));
  for (size_t i = 0; i < checked.drifts.size(); ++i) {
    const ViewDrift& drift = checked.drifts[i];
    nlohmann::ordered_json& view = json["views"][i];
    view["corners"] = drift.corners;
    view["shift_px"] = {drift.shift.x(), drift.shift.y()};
    view["turn_deg"] = Degrees(drift.turn);
    view["rms_left_px"] = drift.rms_left;
    view["odd_tags"] = drift.odd_tags;
  }
  return json;
}

absl::StatusOr<ExitCode> CheckWork(const CheckArguments& arguments) {
  CatchStopSignals();
  ASSIGN_OR_RETURN(const Checked checked, CheckViews(arguments.request));
  if (!arguments.out.empty()) {
    // In one step: a server may be reading it.
    RETURN_IF_ERROR(ReplaceFile(arguments.out, CheckFileText(checked.check)));
  }
  if (!arguments.draw.empty()) {
    RETURN_IF_ERROR(Draw(arguments.draw, checked));
  }
  PrintResult(arguments.format, JsonOf(checked), TextOf(checked));
  return checked.check.Holds() ? kDone : kNo;
}

}  // namespace

void AddCheckCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "check",
      "Check whether the stored calibration still holds: report how far each camera moved");
  auto arguments = std::make_shared<CheckArguments>();
  CheckArguments& a = *arguments;
  command->add_option("--database", a.request.database, "The folder of the database")->required();
  command->add_option("--corners", a.request.corners,
                      "Current corners (CSV) of tags that stay in the cell");
  command->add_option(
      "--reference", a.request.reference,
      "Corners of the same tags at calibration time; default: those in the imported "
      "calibration.yaml");
  command->add_option("--images", a.request.images,
                      "Folder with a current image of every view, VIEW.png: the silhouette of the "
                      "parked robot is compared with its mask");
  command->add_option("--number", a.request.number,
                      "The configuration in which the robot is parked, for --images or --live");
  auto* cell =
      command->add_option("--cell", a.request.cell, "The cell file, for --images and --live");
  auto* live = command
                   ->add_flag("--live", a.request.live,
                              "Take the images from the cell's cameras: for the tags of --boards, "
                              "and for the parked robot with --number")
                   ->needs(cell)
                   ->excludes("--corners")
                   ->excludes("--images");
  command
      ->add_option("--boards", a.request.boards,
                   "Live: the boards (YAML) whose tags stay in the cell; several files")
      ->needs(live);
  command
      ->add_option("--sets", a.request.sets, "Live: images of each view whose mean corners count")
      ->needs(live)
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command
      ->add_option("--limit", a.request.limit, "How much a camera may have moved, in mask pixels")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--out", a.out,
                      "JSON file of the result, for silhouette-server --calibration-check");
  command->add_option("--draw", a.draw, "Folder for a picture per view");
  AddFormatOption(*command, a.format);
  command->footer(
      "Checks tags, the silhouette of the robot, or both; of both, the larger motion counts.\n"
      "Exit code 1 if a camera moved by more than the limit, or could not be checked.\n"
      "Example:\n"
      "  silhouette-calibrate check --database cell.lmdb --corners now.csv --out check.json\n"
      "  silhouette-calibrate check --database cell.lmdb --cell cell.yaml --images now --number 0\n"
      "  silhouette-calibrate check --database cell.lmdb --cell cell.yaml --live --boards "
      "floor.yaml "
      "--out check.json");
  command->callback([arguments, &run] { run = [arguments] { return CheckWork(*arguments); }; });
}

}  // namespace silhouette
