// SPDX-License-Identifier: Apache-2.0
// silhouette-experiments paper
#include <algorithm>
#include <iostream>
#include <map>
#include <memory>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
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

std::string NameOf(const std::string& name) { return name; }

// The values whose names are in `names`, all if there are none. Throws std::invalid_argument for a
// name that no value has.
template <typename T>
std::vector<T> Chosen(const std::vector<std::string>& names, const std::vector<T>& all,
                      const char* what) {
  if (names.empty()) return all;
  std::vector<std::string> known;
  for (const T& value : all) known.push_back(NameOf(value));
  std::vector<T> chosen;
  for (const std::string& name : names) {
    const auto found = std::find(known.begin(), known.end(), name);
    if (found == known.end()) {
      throw std::invalid_argument(
          absl::StrCat("there is no ", what, " '", name, "'; there are ", ListOfWords(known)));
    }
    const T value = all[static_cast<size_t>(found - known.begin())];
    if (std::find(chosen.begin(), chosen.end(), value) == chosen.end()) chosen.push_back(value);
  }
  return chosen;
}

constexpr char kReconstruction[] = "reconstruction";

bool WithReconstruction(const PaperArguments& arguments) {
  const std::vector<std::string>& names = arguments.experiments;
  return names.empty() || std::find(names.begin(), names.end(), kReconstruction) != names.end();
}

// Without the reconstruction, which is a study of its own.
std::vector<Experiment> ChosenExperiments(const std::vector<std::string>& names) {
  std::vector<std::string> all;
  for (Experiment experiment : AllExperiments()) all.push_back(NameOf(experiment));
  all.push_back(kReconstruction);
  std::vector<std::string> chosen = Chosen(names, all, "experiment");
  std::erase(chosen, kReconstruction);
  return chosen.empty() ? std::vector<Experiment>{}
                        : Chosen(chosen, AllExperiments(), "experiment");
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
  return {ChosenExperiments(arguments.experiments),
          Chosen<Variant>(arguments.variants, {Variant::kPlanar, Variant::kSpatial}, "variant"),
          ChosenRigs(arguments.rigs, settings),
          Chosen<Raster>(arguments.rasters, {Raster::kCentre, Raster::kTouch}, "raster"),
          Chosen(arguments.presets, AllPresets(), "preset")};
}

std::string TextOf(const std::vector<Row>& rows, const std::vector<MethodRow>& methods) {
  return TableOf(rows) + (rows.empty() || methods.empty() ? "" : "\n") + TableOf(methods);
}

nlohmann::ordered_json JsonOfBoth(const std::vector<Row>& rows,
                                  const std::vector<MethodRow>& methods) {
  nlohmann::ordered_json all = JsonOf(rows);
  for (nlohmann::ordered_json& row : JsonOf(methods)) all.push_back(std::move(row));
  return all;
}

// What --out asks for.
absl::Status WriteAll(const std::string& folder, const std::vector<Row>& rows,
                      const std::vector<MethodRow>& methods, const Selection& selection,
                      const Settings& settings) {
  const nlohmann::ordered_json all = JsonOfBoth(rows, methods);
  absl::Status status = WriteWholeFile(folder + "/rows.csv", CsvOf(all));
  status.Update(WriteWholeFile(folder + "/rows.json", all.dump(1) + "\n"));
  status.Update(WriteWholeFile(folder + "/tables.txt", TextOf(rows, methods)));
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
  const std::vector<Row> rows =
      Measure(settings, selection, arguments.threads, Showing("Measuring"));
  std::vector<MethodRow> methods;
  if (WithReconstruction(arguments) && !StopRequested()) {
    methods = CompareWithReconstruction(settings, selection, arguments.threads,
                                        Showing("Reconstructing"));
  }
  if (StopRequested()) {
    return absl::AbortedError("stopped; run it again to have a result");
  }
  if (arguments.format == "json") {
    std::cout << JsonOfBoth(rows, methods).dump(1) << '\n';
  } else {
    std::cout << TextOf(rows, methods);
  }
  if (!arguments.out.empty()) {
    RETURN_IF_ERROR(WriteAll(arguments.out, rows, methods, selection, settings));
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
  const auto add_list = [&](const char* name, std::vector<std::string>& values, const char* text) {
    command->add_option(name, values, text)->delimiter(',');
  };
  add_list("--experiments", arguments->experiments,
           "Only these of figure7, figure7_occluded, random, current_off_grid, test_off_grid, "
           "reconstruction");
  add_list("--variants", arguments->variants, "Only these of planar, spatial");
  add_list("--rigs", arguments->rigs, "Only these rigs of the settings");
  add_list("--rasters", arguments->rasters, "Only these of centre, touch");
  add_list("--presets", arguments->presets,
           "Only these of uncalibrated, paper, calibrated, paper-calibrated, sound-planes, sound");
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
