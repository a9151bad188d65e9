// silhouette-experiments cell
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "tools/experiments/cell/hidden_scene.h"
#include "tools/experiments/cell/missing_picture.h"
#include "tools/experiments/cell/report.h"
#include "tools/experiments/commands.h"
#include "tools/picture/files.h"
#include "tools/program/program.h"
#include "tools/program/progress.h"

namespace silhouette {
namespace {

using namespace cell_experiment;

constexpr char kProgram[] = "silhouette-experiments";

// Of a hidden obstacle, metres, where no least obstacle is told.
constexpr double kHandRadius = 0.04;

struct Arguments {
  std::string cell;
  std::string database;
  std::string out;
  std::string format = "text";
  std::vector<std::string> presets;
  int scenes = 120;
  int hidden = 10;
  int off_grid = 1000;
  int pictures = 12;
  uint64_t seed = 1;
  ServeSettings serve;
};

// An experiment and what came of it.
struct Experiment {
  std::string name;
  SceneSource source;
  std::vector<SceneRecord> records;
};

// The presets asked for, by default all that the database can serve, with the thresholds that they
// can have: n - 1 and n of n views.
absl::StatusOr<std::vector<Policy>> PoliciesFor(const std::vector<std::string>& presets,
                                                const ServedDatabase& database) {
  const int views = database.views();
  std::vector<Policy> policies;
  for (const Preset preset : AllPresets()) {
    const bool named = std::ranges::count(presets, NameOf(preset)) > 0;
    if (!presets.empty() && !named) continue;
    if (absl::Status status = database.CanServe({.preset = preset}); !status.ok()) {
      if (named) return status;
      continue;
    }
    for (const int min_views : {views - 1, views}) {
      if (min_views == 0) continue;
      // Without a calibration the two presets differ in nothing else.
      if (preset == Preset::kUncalibrated && min_views == views && views > 1) continue;
      if (preset == Preset::kPaper && min_views < views) continue;
      if (IsSound(preset) && min_views < views) continue;
      policies.push_back({.preset = preset, .min_views = min_views});
    }
  }
  return policies;
}

absl::StatusOr<std::unique_ptr<Database>> OpenDatabase(const Arguments& arguments,
                                                       const SimulatedWorkplace& workplace) {
  const std::string path =
      arguments.database.empty() ? workplace.cell().database : arguments.database;
  if (path.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "say where the database is, or shall be captured: --database FOLDER, or 'database: ",
        "FOLDER' in '", arguments.cell, "'"));
  }
  std::optional<Progress> progress;
  CaptureObserver observer;
  observer.progress = [&](uint64_t done) {
    if (!progress) progress.emplace("capturing", workplace.cell().grid.size(), "configurations");
    progress->Update(done);
  };
  observer.stop_requested = StopRequested;
  return workplace.OpenOrCapture(path, observer);
}

// False if a stop was asked for.
absl::StatusOr<bool> RunScenes(const TrialSetting& setting, Explainer& explainer, int count,
                               Experiment& experiment) {
  Progress progress(experiment.name, static_cast<uint64_t>(count), "scenes");
  for (int i = 0; i < count; ++i) {
    if (StopRequested()) return false;
    absl::StatusOr<SceneRecord> record = RunScene(setting, explainer, experiment.source, i);
    if (!record.ok()) return record.status();
    experiment.records.push_back(*std::move(record));
    progress.Update(static_cast<uint64_t>(i) + 1);
  }
  return true;
}

// Scenes with a hidden obstacle, as many as are found.
std::vector<RandomScene> HiddenScenes(const SimulatedWorkplace& workplace,
                                      const Arguments& arguments) {
  std::vector<RandomScene> scenes;
  if (arguments.hidden == 0) return scenes;
  const auto& sound = workplace.cell().sound;
  const double radius =
      arguments.serve.least_obstacle.value_or(sound ? sound->least_obstacle : kHandRadius);
  Progress progress("looking for hidden places", static_cast<uint64_t>(arguments.hidden), "scenes");
  for (int i = 0; i < arguments.hidden && !StopRequested(); ++i) {
    if (auto scene = MakeHiddenScene(workplace, radius, arguments.seed, i)) {
      scenes.push_back(*std::move(scene));
    }
    progress.Update(static_cast<uint64_t>(i) + 1);
  }
  return scenes;
}

// Writes the pictures; their names by record and missing configuration.
absl::StatusOr<std::vector<std::vector<std::string>>> WritePictures(const TrialSetting& setting,
                                                                    const Experiment& experiment,
                                                                    const Arguments& arguments) {
  std::vector<std::vector<std::string>> names;
  for (const SceneRecord& record : experiment.records) names.emplace_back(record.missing.size());
  const auto count = static_cast<size_t>(arguments.pictures);
  const std::vector<Chosen> chosen = ChooseForPictures(experiment.records, count);
  if (chosen.empty()) return names;
  Progress progress("pictures", chosen.size(), "pictures");
  for (size_t i = 0; i < chosen.size() && !StopRequested(); ++i) {
    const SceneRecord& record = experiment.records[chosen[i].record];
    const auto viewed = View(setting, experiment.source(record.number), record.number);
    if (!viewed.ok()) return viewed.status();
    std::string& name = names[chosen[i].record][chosen[i].missing];
    name = absl::StrFormat("%s-%03d-%d.png", experiment.name, record.number, chosen[i].missing);
    const Picture picture = Draw(setting, *viewed, record.missing[chosen[i].missing]);
    absl::Status status = WritePng(absl::StrCat(arguments.out, "/", name), picture);
    if (!status.ok()) return status;
    progress.Update(i + 1);
  }
  return names;
}

absl::Status WriteResults(const TrialSetting& setting, const std::vector<Row>& rows,
                          const std::vector<Experiment>& experiments, const Arguments& arguments) {
  if (arguments.out.empty()) return absl::OkStatus();
  const auto write = [&](const std::string& name, const std::string& text) {
    return WriteWholeFile(absl::StrCat(arguments.out, "/", name), text);
  };
  absl::Status status = write("table.csv", CsvOf(rows));
  for (const Experiment& experiment : experiments) {
    if (experiment.records.empty()) continue;
    if (!status.ok()) return status;
    status = write(experiment.name + "-scenes.csv", ScenesCsvOf(setting, experiment.records));
    if (!status.ok()) return status;
    const auto pictures = WritePictures(setting, experiment, arguments);
    if (!pictures.ok()) return pictures.status();
    status = write(experiment.name + "-missing.csv",
                   MissingCsvOf(setting, experiment.records, *pictures));
  }
  return status;
}

absl::StatusOr<ExitCode> Measure(const Arguments& arguments) {
  const auto workplace = SimulatedWorkplace::Load(arguments.cell);
  if (!workplace.ok()) return workplace.status();
  if (!arguments.out.empty()) {
    std::error_code error;
    std::filesystem::create_directories(arguments.out, error);
    if (error) {
      return absl::InvalidArgumentError(
          absl::StrCat("cannot make the folder '", arguments.out, "': ", error.message()));
    }
  }
  CatchStopSignals();
  const auto database = OpenDatabase(arguments, *workplace);
  if (absl::IsCancelled(database.status())) {
    std::cerr << "stopped; what was captured is stored, the same command goes on" << std::endl;
    return kNo;
  }
  if (!database.ok()) return database.status();
  const auto served = workplace->Serve(**database, arguments.serve);
  if (!served.ok()) return served.status();
  if (!(*served)->margins_known().ok()) return (*served)->margins_known();
  auto policies = PoliciesFor(arguments.presets, **served);
  if (!policies.ok()) return policies.status();
  const TrialSetting setting{.workplace = *workplace,
                             .database = **served,
                             .policies = *std::move(policies),
                             .off_grid_tests = arguments.off_grid,
                             .seed = arguments.seed};
  const Eigen::AlignedBox3d box = SweptBox(*workplace);
  const std::vector<RandomScene> hidden = HiddenScenes(*workplace, arguments);
  std::vector<Experiment> experiments;
  experiments.push_back(
      {"random",
       [&](int number) { return MakeRandomScene(*workplace, box, arguments.seed, number); },
       {}});
  experiments.push_back(
      {"hidden", [&](int number) { return hidden[static_cast<size_t>(number)]; }, {}});
  Explainer explainer(setting);
  std::vector<Row> rows;
  for (Experiment& experiment : experiments) {
    const int count =
        experiment.name == "random" ? arguments.scenes : static_cast<int>(hidden.size());
    if (count == 0) continue;
    const absl::StatusOr<bool> finished = RunScenes(setting, explainer, count, experiment);
    if (!finished.ok()) return finished.status();
    if (!*finished) {
      std::cerr << "stopped; start it again, the database is there" << std::endl;
      return kNo;
    }
    const std::vector<Row> some = RowsOf(experiment.name, setting, experiment.records);
    rows.insert(rows.end(), some.begin(), some.end());
  }
  if (arguments.format == "json") {
    std::cout << JsonOf(rows).dump(2) << std::endl;
  } else {
    std::cout << TableOf(rows) << "\nseed " << arguments.seed << std::endl;
  }
  if (absl::Status status = WriteResults(setting, rows, experiments, arguments); !status.ok()) {
    return status;
  }
  return kDone;
}

}  // namespace

void AddCellCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "cell",
      "Measure the test in the simulated cell, through the whole real path - cameras, noise,\n"
      "differencing, captured masks -, against exact contact, and explain every configuration\n"
      "that is called free and is not.");
  command->footer(
      "Example:\n"
      "  silhouette-experiments cell --cell capture/sim/cells/demo/cell.yaml \\\n"
      "      --database out/demo.lmdb --out out/cell\n"
      "Writes to --out: table.csv, EXPERIMENT-scenes.csv (every scene), EXPERIMENT-missing.csv\n"
      "(every missing configuration with its cause and sentence) and pictures of the worst.");
  auto arguments = std::make_shared<Arguments>();
  const auto count = CLI::Range(0, 1000000);
  command->add_option("--cell", arguments->cell, "The cell's file, cell.yaml, of a simulated cell")
      ->required();
  command->add_option("--database", arguments->database,
                      "The database's folder; what it lacks is captured first.\n"
                      "Default: the one that the cell's file names");
  command->add_option("--scenes", arguments->scenes, "Scenes by chance")
      ->check(count)
      ->capture_default_str();
  command
      ->add_option("--hidden", arguments->hidden,
                   "Scenes with an obstacle where the robot hides it from all views")
      ->check(count)
      ->capture_default_str();
  command
      ->add_option("--off-grid", arguments->off_grid,
                   "Test configurations between grid points, per scene; on the grid all are "
                   "tested")
      ->check(count)
      ->capture_default_str();
  std::vector<std::string> presets;
  for (const Preset preset : AllPresets()) presets.push_back(NameOf(preset));
  command->add_option("--presets", arguments->presets, "Only these presets; default: all")
      ->check(CLI::IsMember(presets))
      ->delimiter(',');
  command
      ->add_option("--margin", arguments->serve.margin,
                   "Safety margin of all views in pixels of the masks; default: the cell's own")
      ->check(CLI::Range(0.0, 100.0));
  command
      ->add_option("--least-obstacle", arguments->serve.least_obstacle,
                   "Radius in metres of the least obstacle, for the sound presets; default: the\n"
                   "cell's own, and without one there are no sound presets")
      ->check(PositiveNumber());
  command->add_option("--seed", arguments->seed, "Chance that is the same every time")
      ->capture_default_str();
  command->add_option("--out", arguments->out, "Folder for tables and pictures");
  command
      ->add_option("--pictures", arguments->pictures,
                   "Missing configurations of each experiment that get a picture, from the\n"
                   "worst scenes first")
      ->check(count)
      ->capture_default_str();
  AddFormatOption(*command, arguments->format);
  command->callback([arguments, &run] {
    run = [arguments]() -> int {
      const absl::StatusOr<ExitCode> code = Measure(*arguments);
      return code.ok() ? *code : Report(kProgram, code.status());
    };
  });
}

}  // namespace silhouette
