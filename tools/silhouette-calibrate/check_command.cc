// silhouette-calibrate check
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"
#include "tools/program/program.h"
#include "tools/silhouette-calibrate/check_views.h"
#include "tools/silhouette-calibrate/commands.h"
#include "tools/silhouette-calibrate/drift_pictures.h"

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

void PrintText(const Checked& checked) {
  for (size_t i = 0; i < checked.drifts.size(); ++i) {
    const ViewDrift& drift = checked.drifts[i];
    if (!drift.checked) {
      std::cout << drift.view << ": not checked: " << drift.message << "\n";
      continue;
    }
    std::cout << absl::StreamFormat(
        "%s: %s by %.2f px (%.3f mask px): shift (%.2f, %.2f) px", drift.view,
        checked.check.views[i].holds ? "holds, moved" : "MOVED", drift.moved, drift.moved_mask,
        drift.shift.x(), drift.shift.y());
    if (drift.corners > 0) {
      std::cout << absl::StreamFormat(", turn %.3f deg; %d corners, %.3f px rms left",
                                      Degrees(drift.turn), drift.corners, drift.rms_left);
    }
    std::cout << (drift.message.empty() ? "" : "; ") << drift.message << "\n";
  }
  std::cout << absl::StreamFormat("limit %.3g mask px: the calibration %s\n",
                                  checked.check.limit_mask_px,
                                  checked.check.Holds() ? "holds" : "is not known to hold");
}

void PrintJson(const Checked& checked) {
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
  std::cout << json.dump(2) << "\n";
}

absl::StatusOr<ExitCode> CheckWork(const CheckArguments& arguments) {
  CatchStopSignals();
  ASSIGN_OR_RETURN(const Checked checked, CheckViews(arguments.request));
  if (!arguments.out.empty()) {
    // In one step: a server may be reading it.
    const std::string part = arguments.out + ".part";
    RETURN_IF_ERROR(WriteWholeFile(part, CheckFileText(checked.check)));
    std::error_code error;
    fs::rename(part, arguments.out, error);
    if (error) {
      return absl::FailedPreconditionError(
          absl::StrCat("'", arguments.out, "' cannot be written: ", error.message()));
    }
  }
  if (!arguments.draw.empty()) {
    RETURN_IF_ERROR(Draw(arguments.draw, checked));
  }
  if (arguments.format == "json") {
    PrintJson(checked);
  } else {
    PrintText(checked);
  }
  return checked.check.Holds() ? kDone : kNo;
}

}  // namespace

void AddCheckCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "check", "Whether the stored calibration is still true: by how much each camera moved");
  auto arguments = std::make_shared<CheckArguments>();
  CheckArguments& a = *arguments;
  command->add_option("--database", a.request.database, "The folder of the database")->required();
  command->add_option("--corners", a.request.corners,
                      "Corners (CSV), of now, of tags that stay in the cell");
  command->add_option("--reference", a.request.reference,
                      "The same tags' corners from the day of the calibration; default: as the "
                      "imported calibration.yaml has them");
  command->add_option("--images", a.request.images,
                      "Folder with an image of now of every view, VIEW.png: the silhouette of the "
                      "parked robot is compared with its robot image");
  command->add_option("--number", a.request.number,
                      "The configuration in which the robot is parked, for --images or --live");
  auto* cell =
      command->add_option("--cell", a.request.cell, "The cell's file, for --images and --live");
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
  command->add_option("--sets", a.request.sets, "Live: of so many images of a view the mean")
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
      "By tags, by the silhouette of the robot, or both; then the greater motion counts.\n"
      "Exit code 1 if a camera moved by more than the limit, or could not be checked.\n"
      "Example:\n"
      "  silhouette-calibrate check --database cell.lmdb --corners now.csv --out check.json\n"
      "  silhouette-calibrate check --database cell.lmdb --cell cell.yaml --images now --number 0\n"
      "  silhouette-calibrate check --database cell.lmdb --cell cell.yaml --live --boards "
      "floor.yaml "
      "--out check.json");
  command->callback([arguments, &run] {
    run = [arguments]() -> int {
      const absl::StatusOr<ExitCode> code = CheckWork(*arguments);
      return code.ok() ? *code : Report("silhouette-calibrate", code.status());
    };
  });
}

}  // namespace silhouette
