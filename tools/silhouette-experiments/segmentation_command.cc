// SPDX-License-Identifier: Apache-2.0
// silhouette-experiments segmentation
#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/numbers/numbers.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/program/progress.h"
#include "tools/silhouette-experiments/commands.h"
#include "tools/silhouette-experiments/segmentation/study.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
using cell_experiment::SimulatedWorkplace;
using segmentation_experiment::Condition;
using segmentation_experiment::Conditions;
using segmentation_experiment::Method;
using segmentation_experiment::Methods;
using segmentation_experiment::Obstacles;
using segmentation_experiment::StudySettings;
using SegmentationFigures = segmentation_experiment::Figures;

struct SegmentationArguments {
  std::string cell;
  int scenes = 20;
  uint64_t seed = 1;
  std::string out;
  std::string format = "text";
};

struct SegmentationRow {
  std::string camera;  // grey or colour
  std::string obstacles;
  std::string condition;
  std::string method;
  SegmentationFigures figures;
};

struct Case {
  bool colour;
  Obstacles obstacles;
  Condition condition;

  std::string camera() const { return colour ? "colour" : "grey"; }
};

std::vector<Case> Cases() {
  std::vector<Case> cases;
  for (const bool colour : {false, true}) {
    for (const Condition& condition : Conditions()) {
      cases.push_back({colour, Obstacles::kAny, condition});
    }
    cases.push_back({colour, Obstacles::kPlain, Conditions().front()});
  }
  return cases;
}

absl::StatusOr<std::vector<SegmentationRow>> Study(const SegmentationArguments& arguments) {
  ASSIGN_OR_RETURN(const SimulatedWorkplace workplace, SimulatedWorkplace::Load(arguments.cell));
  CatchStopSignals();
  const std::vector<Case> cases = Cases();
  const std::vector<Method> methods = Methods();
  Progress progress("cases", cases.size(), "cases");
  std::vector<SegmentationRow> rows;
  for (size_t i = 0; i < cases.size(); ++i) {
    const Case& each = cases[i];
    const StudySettings settings{.scenes = arguments.scenes,
                                 .seed = arguments.seed,
                                 .colour = each.colour,
                                 .obstacles = each.obstacles};
    const auto figures = Measure(workplace, each.condition, methods, settings, StopRequested);
    if (StopRequested()) return absl::AbortedError("stopped; start it again to have a result");
    for (size_t m = 0; m < methods.size(); ++m) {
      rows.push_back({.camera = each.camera(),
                      .obstacles = each.obstacles == Obstacles::kAny ? "any" : "plain",
                      .condition = each.condition.name,
                      .method = methods[m].name,
                      .figures = figures[m]});
    }
    if (!arguments.out.empty() && each.obstacles == Obstacles::kAny) {
      std::string name = absl::StrCat(each.camera(), " ", each.condition.name, ".png");
      std::replace(name.begin(), name.end(), ' ', '-');
      RETURN_IF_ERROR(WritePng((fs::path(arguments.out) / name).string(),
                               PictureOfScene(workplace, each.condition, methods, settings)));
    }
    progress.Update(i + 1);
  }
  return rows;
}

std::string SegmentationTextOf(const std::vector<SegmentationRow>& rows) {
  std::string text =
      "| camera | obstacles | light | settings | recall, mask | recall, pixels | false, mask | "
      "false, pixels | shadows found |\n|---|---|---|---|---|---|---|---|---|\n";
  for (const SegmentationRow& row : rows) {
    const SegmentationFigures& f = row.figures;
    absl::StrAppendFormat(
        &text, "| %s | %s | %s | %s | %.4f | %.4f | %.3f %% | %.3f %% | %.2f %% |\n", row.camera,
        row.obstacles, row.condition, row.method, f.recall(),
        SegmentationFigures::Share(f.found_pixels, f.obstacle_pixels), 100 * f.false_share(),
        Percent(f.false_pixels, f.empty_pixels), Percent(f.shadow_foreground, f.all_mask));
  }
  return text;
}

nlohmann::ordered_json SegmentationJsonOf(const std::vector<SegmentationRow>& rows) {
  auto list = nlohmann::ordered_json::array();
  for (const SegmentationRow& row : rows) {
    const SegmentationFigures& f = row.figures;
    list.push_back({{"camera", row.camera},
                    {"obstacles", row.obstacles},
                    {"condition", row.condition},
                    {"settings", row.method},
                    {"obstacle_mask_pixels", f.obstacle_mask},
                    {"found_mask_pixels", f.found_mask},
                    {"obstacle_pixels", f.obstacle_pixels},
                    {"found_pixels", f.found_pixels},
                    {"mask_pixels", f.all_mask},
                    {"false_mask_pixels", f.false_mask},
                    {"empty_pixels", f.empty_pixels},
                    {"false_pixels", f.false_pixels},
                    {"shadow_mask_pixels", f.shadow_mask},
                    {"shadow_mask_pixels_found", f.shadow_foreground}});
  }
  return list;
}

absl::StatusOr<ExitCode> RunSegmentation(const SegmentationArguments& arguments) {
  ASSIGN_OR_RETURN(const auto rows, Study(arguments));
  PrintResult(arguments.format, SegmentationJsonOf(rows), SegmentationTextOf(rows));
  return kDone;
}

}  // namespace

void AddSegmentationCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "segmentation",
      "How well obstacles, and nothing else, are found in camera images: under noise, drift,\n"
      "flicker, shadows and saturation, by grey and colour cameras, with several settings");
  const auto arguments = std::make_shared<SegmentationArguments>();
  command->add_option("--cell", arguments->cell, "The file of a simulated cell")->required();
  command->add_option("--scenes", arguments->scenes, "How many for each row")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  command->add_option("--seed", arguments->seed, "Of the scenes")->capture_default_str();
  command->add_option("--out", arguments->out,
                      "A folder for pictures: image, and what each of the settings finds");
  AddFormatOption(*command, arguments->format);
  command->footer(
      "docs/segmentation.md explains the columns.\n\n"
      "Example:\n"
      "  silhouette-experiments segmentation --cell capture/sim/cells/demo/cell.yaml --out out");
  RunWhenChosen(*command, run, arguments, RunSegmentation);
}

}  // namespace silhouette
