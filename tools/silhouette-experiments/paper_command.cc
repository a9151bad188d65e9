// SPDX-License-Identifier: Apache-2.0
// silhouette-experiments paper
#include <algorithm>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/result/result.h"
#include "common/yaml/strict_yaml.h"
#include "db/status/status_macros.h"
#include "tools/program/progress.h"
#include "tools/silhouette-experiments/commands.h"
#include "tools/silhouette-experiments/paper/figures.h"
#include "tools/silhouette-experiments/paper/reconstruction.h"
#include "tools/silhouette-experiments/paper/report.h"
#include "tools/silhouette-experiments/paper/study.h"

namespace silhouette {
namespace paper {
namespace {

struct PaperArguments {
  std::string settings;
  bool print_settings = false;
  std::string format = "text";
  std::string out;
  std::vector<std::string> experiments;
  std::vector<std::string> variants;
  std::vector<std::string> rigs;
  std::vector<std::string> rasters;
  std::vector<std::string> presets;
  int threads = 0;
};

constexpr char kReconstruction[] = "reconstruction";
const std::vector<Variant> kVariants = {Variant::kPlanar, Variant::kSpatial};
const std::vector<Raster> kRasters = {Raster::kCentre, Raster::kTouch};

template <typename T>
std::vector<std::string> NamesOf(const std::vector<T>& values) {
  std::vector<std::string> names;
  for (const T& value : values) names.push_back(NameOf(value));
  return names;
}

bool IsChosen(const std::vector<std::string>& names, const std::string& name) {
  return names.empty() || std::find(names.begin(), names.end(), name) != names.end();
}

// The values whose names are in `names`, all if there are none.
template <typename T>
std::vector<T> Chosen(const std::vector<std::string>& names, std::vector<T> all) {
  std::erase_if(all, [&](const T& value) { return !IsChosen(names, NameOf(value)); });
  return all;
}

std::vector<std::string> ChosenRigs(const std::vector<std::string>& names,
                                    const Settings& settings) {
  std::vector<std::string> all;
  for (const auto& [name, cameras] : settings.rigs) all.push_back(name);
  for (const std::string& name : names) {
    if (!settings.rigs.contains(name)) {
      throw std::invalid_argument(
          absl::StrCat("the settings have no rig '", name, "'; they have ", ListOfWords(all)));
    }
  }
  return names.empty() ? all : names;
}

Selection SelectionOf(const PaperArguments& arguments, const Settings& settings) {
  return {Chosen(arguments.experiments, AllExperiments()), Chosen(arguments.variants, kVariants),
          ChosenRigs(arguments.rigs, settings), Chosen(arguments.rasters, kRasters),
          Chosen(arguments.presets, AllPresets())};
}

// What --out asks for.
absl::Status WriteAll(const std::string& folder, const std::vector<Row>& rows,
                      const Selection& selection, const Settings& settings) {
  const nlohmann::ordered_json json = JsonOf(rows);
  absl::Status status = WriteWholeFile(folder + "/rows.csv", CsvOf(json));
  status.Update(WriteWholeFile(folder + "/rows.json", json.dump(1) + "\n"));
  status.Update(WriteWholeFile(folder + "/tables.txt", TextOf(rows)));
  status.Update(
      WriteWholeFile(folder + "/figures.json",
                     FiguresOf(settings, selection.variants, selection.rigs).dump() + "\n"));
  return status;
}

// Shows the progress of one study, and stops it at a stop signal.
OnProgress Showing(const std::string& what) {
  return [what, shown = uint64_t{0}, progress = std::shared_ptr<Progress>()](
             uint64_t done, uint64_t total) mutable {
    if (!progress) progress = std::make_shared<Progress>(what, total, "scenes");
    if (done != std::exchange(shown, done)) progress->Update(done);
    return !StopRequested();
  };
}

absl::StatusOr<ExitCode> RunPaper(const PaperArguments& arguments) {
  if (arguments.print_settings) {
    std::cout << DefaultSettingsText();
    return kDone;
  }
  Settings settings;
  try {
    settings = ReadSettings(arguments.settings);
  } catch (const YamlError& mistake) {
    return absl::InvalidArgumentError(mistake.what());
  }
  const Selection selection = SelectionOf(arguments, settings);
  CatchStopSignals();
  std::vector<Row> rows = Measure(settings, selection, arguments.threads, Showing("Measuring"));
  if (IsChosen(arguments.experiments, kReconstruction) && !StopRequested()) {
    for (Row& row : CompareWithReconstruction(settings, selection, arguments.threads,
                                              Showing("Reconstructing"))) {
      rows.push_back(std::move(row));
    }
  }
  if (StopRequested()) return absl::AbortedError("stopped; run it again to have a result");
  PrintResult(arguments.format, JsonOf(rows), TextOf(rows));
  if (!arguments.out.empty()) {
    RETURN_IF_ERROR(WriteAll(arguments.out, rows, selection, settings));
    std::cerr << "wrote tables and figures into " << arguments.out << '\n';
  }
  return kDone;
}

}  // namespace
}  // namespace paper

void AddPaperCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "paper",
      "How many configurations each test reports wrongly in the paper's simulation (4.1,\n"
      "Figures 1, 6 and 7), and whether reconstructing space would do better (2)");
  auto arguments = std::make_shared<paper::PaperArguments>();
  arguments->threads = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  command->add_option(
      "--settings", arguments->settings,
      "YAML file with geometry, cameras, scenes and seeds, in place of the default");
  command->add_flag("--print-settings", arguments->print_settings,
                    "Print the default settings, with comments, to be changed");
  const auto add_names = [&](const char* name, std::vector<std::string>& chosen,
                             const std::vector<std::string>& all) {
    command->add_option(name, chosen, "Only these; default: all")
        ->check(CLI::IsMember(all))
        ->delimiter(',');
  };
  std::vector<std::string> experiments = paper::NamesOf(paper::AllExperiments());
  experiments.push_back(paper::kReconstruction);
  add_names("--experiments", arguments->experiments, experiments);
  add_names("--variants", arguments->variants, paper::NamesOf(paper::kVariants));
  command->add_option("--rigs", arguments->rigs, "Only these rigs of the settings")->delimiter(',');
  add_names("--rasters", arguments->rasters, paper::NamesOf(paper::kRasters));
  add_names("--presets", arguments->presets, paper::NamesOf(AllPresets()));
  command->add_option("--threads", arguments->threads, "Threads to measure with")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  command->add_option(
      "--out", arguments->out,
      "Folder for tables.txt, rows.csv, rows.json and figures.json; made if it is not\n"
      "there. tools/plot draws charts and figures of the JSON files");
  AddFormatOption(*command, arguments->format);
  command->footer(
      "Examples:\n"
      "  silhouette-experiments paper --out paper\n"
      "  silhouette-experiments paper --experiments figure7 --variants planar --rigs A\n"
      "  silhouette-experiments paper --presets calibrated,sound --format json > rows.json\n"
      "  silhouette-experiments paper --print-settings > mine.yaml\n"
      "  silhouette-experiments paper --settings mine.yaml --out mine");
  RunWhenChosen(*command, run, arguments, paper::RunPaper);
}

}  // namespace silhouette
