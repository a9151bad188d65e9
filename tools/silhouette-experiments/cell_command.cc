// SPDX-License-Identifier: Apache-2.0
// silhouette-experiments cell
#include <iostream>
#include <memory>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/picture/files.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/program/progress.h"
#include "tools/silhouette-db/calibration_files/calibration_files.h"
#include "tools/silhouette-db/calibration_files/tested_calibration.h"
#include "tools/silhouette-experiments/cell/leave.h"
#include "tools/silhouette-experiments/cell/missing_picture.h"
#include "tools/silhouette-experiments/cell/report.h"
#include "tools/silhouette-experiments/cell/scenes.h"
#include "tools/silhouette-experiments/commands.h"

namespace silhouette {
namespace cell_experiment {
namespace {

// Radius of a hidden obstacle in metres if no least obstacle is specified.
constexpr double kHandRadius = 0.04;

struct CellArguments {
  std::string cell;
  std::string database;
  std::string calibration;
  std::string out;
  std::string format = "text";
  std::string images = "captured";
  PartSettings parts;
  std::vector<std::string> presets;
  std::vector<int> min_views;
  int scenes = 120;
  int hidden = 10;
  int leave = 0;
  int near = 0;
  int off_grid = 1000;
  int pictures = 12;
  uint64_t seed = 1;
  ServeSettings serve;
};

// Scenes of one kind under one calibration, and their results.
struct Experiment {
  std::string name;
  const TrialSetting* setting = nullptr;
  SceneSource source;
  std::vector<SceneRecord> records;
};

// `path`: what ReadCalibration (tools/silhouette-db/calibration_files/calibration_files.h) reads.
// `margin`: as in the cell file's `calibration`. As for `silhouette-db calibration import`, it must
// be for the database's views, and the robot images must not contradict it: InvalidArgument,
// NotFound or FailedPrecondition if not.
absl::StatusOr<Calibration> FoundCalibration(const std::string& path, const Database& database,
                                             double margin) {
  ASSIGN_OR_RETURN(const auto stored, ReadCalibration({path}, database.cell()));
  ASSIGN_OR_RETURN(const Snapshot snapshot, database.Read());
  ASSIGN_OR_RETURN(auto tested, TestCalibration(database, snapshot, stored, margin));
  RETURN_IF_ERROR(CheckContradictions(tested.contradictions, database.cell()));
  return std::move(tested.calibration);
}

// Writes the pictures; their names by record and missing configuration.
absl::StatusOr<std::vector<std::vector<std::string>>> WritePictures(const Experiment& experiment,
                                                                    const std::string& folder,
                                                                    size_t count) {
  std::vector<std::vector<std::string>> names;
  for (const SceneRecord& record : experiment.records) names.emplace_back(record.missing.size());
  const std::vector<Chosen> chosen = ChooseForPictures(experiment.records, count);
  if (chosen.empty()) return names;
  const TrialSetting& setting = *experiment.setting;
  Progress progress("pictures", chosen.size(), "pictures");
  for (size_t i = 0; i < chosen.size() && !StopRequested(); ++i) {
    const SceneRecord& record = experiment.records[chosen[i].record];
    ASSIGN_OR_RETURN(const auto viewed,
                     View(setting, experiment.source(record.number), record.number));
    std::string& name = names[chosen[i].record][chosen[i].missing];
    name = absl::StrFormat("%s-%03d-%d.png", experiment.name, record.number, chosen[i].missing);
    const Picture picture = Draw(setting, viewed, record.missing[chosen[i].missing]);
    RETURN_IF_ERROR(WritePng(absl::StrCat(folder, "/", name), picture));
    progress.Update(i + 1);
  }
  return names;
}

// Scenes, missing configurations and at most `pictures` pictures of each experiment, by its name.
absl::Status WriteExperiments(std::span<const Experiment> experiments, const std::string& folder,
                              size_t pictures) {
  for (const Experiment& experiment : experiments) {
    if (experiment.records.empty()) continue;
    const std::string path = absl::StrCat(folder, "/", experiment.name);
    RETURN_IF_ERROR(
        WriteWholeFile(path + "-scenes.csv", ScenesCsvOf(*experiment.setting, experiment.records)));
    ASSIGN_OR_RETURN(const auto names, WritePictures(experiment, folder, pictures));
    RETURN_IF_ERROR(WriteWholeFile(path + "-missing.csv",
                                   MissingCsvOf(*experiment.setting, experiment.records, names)));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<Database>> OpenDatabase(const CellArguments& arguments,
                                                       const SimulatedWorkplace& workplace) {
  const std::string path =
      arguments.database.empty() ? workplace.cell().database : arguments.database;
  if (path.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "no database is specified; give --database FOLDER, or put 'database: FOLDER' into ", "'",
        arguments.cell, "'"));
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

// The database served with one calibration, and what is tested with it.
struct Side {
  std::shared_ptr<const ServedDatabase> served;
  std::unique_ptr<const TrialSetting> setting;
};

// `calibrated`: only presets that need a calibration.
absl::StatusOr<Side> Serve(const CellArguments& arguments, const SimulatedWorkplace& workplace,
                           const Database& database, const ServeSettings& settings,
                           bool calibrated) {
  ASSIGN_OR_RETURN(const auto served, workplace.Serve(database, settings));
  if (!served->margins_known().ok()) return served->margins_known();
  ASSIGN_OR_RETURN(auto policies, PoliciesFor(arguments.presets, arguments.min_views,
                                              workplace.cell().policy, *served));
  std::erase_if(policies, [&](const Policy& policy) {
    return calibrated && !IsCalibrated(policy.preset) && !IsSound(policy.preset);
  });
  if (policies.empty()) {
    return absl::InvalidArgumentError(
        "none of the chosen presets needs a calibration; leave --calibration out");
  }
  const TrialSetting setting{.workplace = workplace,
                             .database = *served,
                             .policies = std::move(policies),
                             .off_grid_tests = arguments.off_grid,
                             .seed = arguments.seed};
  return Side{served, std::make_unique<const TrialSetting>(setting)};
}

// What the database is compared with, on the same scenes.
struct OtherSide : Side {
  OtherWay way;
};

absl::StatusOr<OtherSide> FoundSide(const CellArguments& arguments,
                                    const SimulatedWorkplace& workplace, const Database& database) {
  ServeSettings settings = arguments.serve;
  ASSIGN_OR_RETURN(settings.calibration, FoundCalibration(arguments.calibration, database,
                                                          workplace.cell().calibration.margin));
  ASSIGN_OR_RETURN(auto side, Serve(arguments, workplace, database, settings, true));
  return OtherSide{std::move(side), {"found", "with the true calibration and with the one found"}};
}

absl::StatusOr<OtherSide> DrawnSide(const CellArguments& arguments,
                                    const SimulatedWorkplace& workplace, const Database& database) {
  ServeSettings settings = arguments.serve;
  settings.drawn = arguments.parts;
  ASSIGN_OR_RETURN(auto side, Serve(arguments, workplace, database, settings, false));
  return OtherSide{std::move(side), {"drawn", "with captured robot images and with drawn ones"}};
}

// How drawn robot images differ from those captured at the same configurations.
std::string DifferenceOf(const ServedDatabase& captured, const ServedDatabase& drawn) {
  double pixels = 0;
  double more = 0;
  double less = 0;
  for (ConfigurationNumber number = 0; number < captured.grid().number_limit(); ++number) {
    if (captured.robot_images().state(number) != RobotImageState::kPresent) continue;
    const auto before = captured.robot_images().Images(number);
    const auto after = drawn.robot_images().Images(number);
    for (size_t view = 0; before && after && view < before->size(); ++view) {
      const auto both = static_cast<double>(((*before)[view] & (*after)[view]).Count());
      pixels += static_cast<double>((*before)[view].Count());
      less += static_cast<double>((*before)[view].Count()) - both;
      more += static_cast<double>((*after)[view].Count()) - both;
    }
  }
  return absl::StrFormat(
      "of the captured robot images' pixels the drawn ones lack %.2f %%; they add %.2f %%\n",
      100 * less / pixels, 100 * more / pixels);
}

absl::Status Stopped() {
  return absl::CancelledError("stopped; run the same command again, the database is complete");
}

// Cancelled after a stop signal.
absl::Status RunScenes(Explainer& explainer, int count, Experiment& experiment) {
  Progress progress(experiment.name, static_cast<uint64_t>(count), "scenes");
  for (int i = 0; i < count; ++i) {
    if (StopRequested()) return Stopped();
    ASSIGN_OR_RETURN(SceneRecord record,
                     RunScene(*experiment.setting, explainer, experiment.source, i));
    experiment.records.push_back(std::move(record));
    progress.Update(static_cast<uint64_t>(i) + 1);
  }
  return absl::OkStatus();
}

// Scenes with a hidden obstacle, as many as are found.
std::vector<RandomScene> HiddenScenes(const SimulatedWorkplace& workplace,
                                      const CellArguments& arguments) {
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

// Scenes of one kind, by name: small things near the robot.
using NamedScenes = std::vector<std::pair<std::string, std::vector<RandomScene>>>;

// `arguments.near` scenes, as far as they are found, evenly spread over sizes and distances.
NamedScenes NearScenes(const SimulatedWorkplace& workplace, const CellArguments& arguments) {
  NamedScenes scenes;
  if (arguments.near == 0) return scenes;
  const std::vector<NearThing> things = NearThings();
  for (const NearThing& thing : things) scenes.push_back({NameOf(thing), {}});
  Progress progress("looking for places near the robot", static_cast<uint64_t>(arguments.near),
                    "scenes");
  for (int i = 0; i < arguments.near && !StopRequested(); ++i) {
    const size_t kind = static_cast<size_t>(i) % things.size();
    if (auto scene = MakeNearScene(workplace, things[kind], arguments.seed, i)) {
      scenes[kind].second.push_back(*std::move(scene));
    }
    progress.Update(static_cast<uint64_t>(i) + 1);
  }
  return scenes;
}

void SayHowManyWereFound(const std::string& kind, size_t found, int wanted) {
  if (found == static_cast<size_t>(wanted)) return;
  std::cerr << kind << ": places for " << found << " of " << wanted << " scenes were found"
            << std::endl;
}

absl::StatusOr<ExitCode> Leave(const CellArguments& arguments, const TrialSetting& setting) {
  Progress progress("leave", static_cast<uint64_t>(arguments.leave), "scenes");
  ASSIGN_OR_RETURN(const LeaveResult result, RunLeave(setting, arguments.leave, [&](int done) {
                     progress.Update(static_cast<uint64_t>(done));
                     return !StopRequested();
                   }));
  progress.Update(static_cast<uint64_t>(arguments.leave));
  SayHowManyWereFound("leave", static_cast<size_t>(result.found), arguments.leave);
  if (result.unusable > 0) {
    std::cerr << "leave: on " << result.unusable << " of them no verdict can be made; they are in "
              << "no row" << std::endl;
  }
  PrintResult(arguments.format, JsonOf(result.rows),
              absl::StrCat(TextOf(result.rows), "\nseed ", arguments.seed, "\n"));
  return kDone;
}

// All scenes with one calibration. `prefix`: of the experiments' names in files. Adds what came of
// them to `done`. The rows.
absl::StatusOr<std::vector<Row>> RunAll(const CellArguments& arguments, const TrialSetting& setting,
                                        const std::vector<RandomScene>& hidden,
                                        const NamedScenes& near, const std::string& prefix,
                                        std::vector<Experiment>& done) {
  const SimulatedWorkplace& workplace = setting.workplace;
  const Eigen::AlignedBox3d box = SweptBox(workplace);
  Explainer explainer(setting);
  std::vector<Row> rows;
  const SceneSource random = [&workplace, box, seed = arguments.seed](int number) {
    return MakeRandomScene(workplace, box, seed, number);
  };
  const SceneSource with_ball = [&hidden](int number) {
    return hidden[static_cast<size_t>(number)];
  };
  const SceneSource without = [&hidden](int number) {
    RandomScene scene = hidden[static_cast<size_t>(number)];
    scene.obstacles.clear();
    return scene;
  };
  const auto balls = static_cast<int>(hidden.size());
  struct Kind {
    std::string name;
    int count;
    SceneSource source;
  };
  std::vector<Kind> kinds = {{"random", arguments.scenes, random},
                             {"hidden", balls, with_ball},
                             {"empty", balls, without}};
  for (const auto& [name, scenes] : near) {
    kinds.push_back({name, static_cast<int>(scenes.size()), [&of_kind = scenes](int number) {
                       return of_kind[static_cast<size_t>(number)];
                     }});
  }
  std::vector<RandomScene> nothing_near;
  for (const auto& [name, scenes] : near) {
    for (RandomScene scene : scenes) {
      scene.obstacles.clear();
      nothing_near.push_back(std::move(scene));
    }
  }
  kinds.push_back({"near-empty", static_cast<int>(nothing_near.size()),
                   [&](int number) { return nothing_near[static_cast<size_t>(number)]; }});
  for (const auto& [name, count, source] : kinds) {
    if (count == 0) continue;
    Experiment& experiment = done.emplace_back(Experiment{prefix + name, &setting, source, {}});
    RETURN_IF_ERROR(RunScenes(explainer, count, experiment));
    const std::vector<Row> some = RowsOf(name, setting, experiment.records);
    rows.insert(rows.end(), some.begin(), some.end());
  }
  return rows;
}

absl::StatusOr<ExitCode> Test(const CellArguments& arguments, const SimulatedWorkplace& workplace,
                              const Database& database) {
  ServeSettings usual = arguments.serve;
  std::optional<OtherSide> other;
  if (!arguments.calibration.empty()) {
    ASSIGN_OR_RETURN(auto side, FoundSide(arguments, workplace, database));
    other = std::move(side);
    // It is compared with the truth, not with the database's own.
    usual.calibration = workplace.TrueCalibration();
  } else if (arguments.images == "drawn") {
    ASSIGN_OR_RETURN(auto side, DrawnSide(arguments, workplace, database));
    other = std::move(side);
  }
  ASSIGN_OR_RETURN(const auto truth, Serve(arguments, workplace, database, usual, false));
  if (arguments.leave > 0) return Leave(arguments, *truth.setting);
  const std::vector<RandomScene> hidden = HiddenScenes(workplace, arguments);
  const NamedScenes near = NearScenes(workplace, arguments);
  if (StopRequested()) return Stopped();
  SayHowManyWereFound("hidden", hidden.size(), arguments.hidden);
  size_t near_found = 0;
  for (const auto& [name, scenes] : near) near_found += scenes.size();
  SayHowManyWereFound("near", near_found, arguments.near);
  std::vector<Experiment> experiments;
  ASSIGN_OR_RETURN(const auto rows,
                   RunAll(arguments, *truth.setting, hidden, near, "", experiments));
  std::vector<Comparison> comparisons;
  OtherWay way;
  if (other) {
    way = other->way;
    ASSIGN_OR_RETURN(const auto others,
                     RunAll(arguments, *other->setting, hidden, near, way.name + "-", experiments));
    comparisons = Compare(rows, others);
  }
  std::string text = TextOf(rows) + "\n";
  if (other && other->served->robot_images().drawn() != nullptr) {
    absl::StrAppend(&text, DifferenceOf(*truth.served, *other->served));
  }
  if (other) absl::StrAppend(&text, LossTextOf(comparisons, way), "\n");
  absl::StrAppend(&text, "seed ", arguments.seed, "\n");
  PrintResult(arguments.format, JsonOf(rows, comparisons, way), text);
  const std::string& out = arguments.out;
  if (out.empty()) return kDone;
  RETURN_IF_ERROR(WriteWholeFile(out + "/table.csv", CsvOf(rows)));
  if (other) RETURN_IF_ERROR(WriteWholeFile(out + "/loss.csv", LossCsvOf(comparisons, way)));
  if (!hidden.empty() && truth.served->sound() != nullptr) {
    ASSIGN_OR_RETURN(const auto viewed, View(*truth.setting, hidden.front(), 0));
    RETURN_IF_ERROR(WritePng(out + "/hidden.png", DrawPossible(*truth.setting, viewed)));
  }
  RETURN_IF_ERROR(WriteExperiments(experiments, out, static_cast<size_t>(arguments.pictures)));
  return kDone;
}

// Before the capture, which may take long. InvalidArgument: what the arguments ask for cannot be
// served.
absl::Status CheckChoice(const CellArguments& arguments, const Cell& cell) {
  RETURN_IF_ERROR(CheckMinViews(arguments.min_views, static_cast<int>(cell.views.size())));
  if (cell.sound || arguments.serve.least_obstacle) return absl::OkStatus();
  for (const std::string& preset : arguments.presets) {
    if (!IsSound(*PresetFromName(preset))) continue;
    return absl::InvalidArgumentError(
        absl::StrCat("the preset '", preset, "' needs a least obstacle; give --least-obstacle, or ",
                     "put 'sound' into '", arguments.cell, "'"));
  }
  return absl::OkStatus();
}

absl::StatusOr<ExitCode> CellMeasure(const CellArguments& arguments) {
  ASSIGN_OR_RETURN(const auto workplace,
                   SimulatedWorkplace::Load(arguments.cell, arguments.database));
  RETURN_IF_ERROR(CheckChoice(arguments, workplace.cell()));
  CatchStopSignals();
  ASSIGN_OR_RETURN(const auto database, OpenDatabase(arguments, workplace));
  return Test(arguments, workplace, *database);
}

}  // namespace
}  // namespace cell_experiment

void AddCellCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "cell",
      "Measure collision checking in the simulated cell through the whole real path (cameras,\n"
      "noise, background subtraction, captured masks) against exact contact. Explain every\n"
      "configuration that is reported free and is occupied.");
  command->footer(
      "Example:\n"
      "  silhouette-experiments cell --cell capture/sim/cells/demo/cell.yaml \\\n"
      "      --database out/demo.lmdb --out out/cell\n"
      "  silhouette-experiments cell --cell capture/sim/cells/demo/cell.yaml \\\n"
      "      --database out/demo.lmdb --calibration session/cameras\n"
      "  silhouette-experiments cell --cell capture/sim/cells/demo/cell.yaml \\\n"
      "      --database out/demo.lmdb --images drawn\n"
      "Writes to --out: table.csv, EXPERIMENT-scenes.csv (every scene), EXPERIMENT-missing.csv\n"
      "(every missing configuration with its cause and sentence) and pictures of the worst; with\n"
      "--calibration loss.csv, and the same of found-EXPERIMENT; with --images drawn, of\n"
      "drawn-EXPERIMENT.");
  auto arguments = std::make_shared<cell_experiment::CellArguments>();
  const auto count = CLI::Range(0, 1000000);
  command->add_option("--cell", arguments->cell, "The cell's file, cell.yaml, of a simulated cell")
      ->required();
  command->add_option("--database", arguments->database,
                      "The database's folder; what it lacks is captured first.\n"
                      "Default: the one that the cell's file names");
  CLI::Option* calibration = command->add_option(
      "--calibration", arguments->calibration,
      "A found calibration: calibration.yaml, matrices, or a folder of camera\n"
      "models. The presets that need one are tested with it and with the true cameras\n"
      "on the same scenes. The result states the difference");
  CLI::Option* images =
      command
          ->add_option("--images", arguments->images,
                       "drawn: all is tested with the captured robot images, and with images that\n"
                       "are drawn from the robot's model at the captured configurations, on the\n"
                       "same scenes")
          ->check(CLI::IsMember({"captured", "drawn"}))
          ->capture_default_str()
          ->excludes(calibration);
  command
      ->add_option("--tolerance", arguments->parts.tolerance,
                   "Metres by which the drawn robot is grown for what the model may err")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str()
      ->needs(images);
  CLI::Option* scenes = command->add_option("--scenes", arguments->scenes, "Random scenes")
                            ->check(count)
                            ->capture_default_str();
  CLI::Option* hidden =
      command
          ->add_option(
              "--hidden", arguments->hidden,
              "Scenes with a ball of the least obstacle's size where the robot hides it from\n"
              "all views; each is tested again without the ball (experiment 'empty')")
          ->check(count)
          ->capture_default_str();
  CLI::Option* near =
      command
          ->add_option(
              "--near", arguments->near,
              "Scenes with a ball or a forearm of 3 to 6 cm radius, 1 to 12 cm from the robot:\n"
              "a table for each size and distance. The robot touches nothing where it stands.\n"
              "Each is tested again with nothing but the robot (experiment 'near-empty')")
          ->check(count)
          ->capture_default_str();
  CLI::Option* leave =
      command
          ->add_option("--leave", arguments->leave,
                       "In place of all others: scenes with a person 5 to 30 cm from the robot;\n"
                       "'locked' counts those in which no step of the robot is free")
          ->check(count)
          ->capture_default_str();
  CLI::Option* off_grid =
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
      ->add_option(
          "--min-views", arguments->min_views,
          "How many views must show an obstacle, one or several numbers; default: all, and\n"
          "as many as the server asks for 'uncalibrated' in this cell. Not for the sound\n"
          "presets, which ask all views")
      ->delimiter(',');
  command
      ->add_option("--margin", arguments->serve.margin,
                   "Safety margin of all views in pixels of the masks; default: the cell's own")
      ->check(CLI::Range(0.0, 100.0));
  command
      ->add_option("--least-obstacle", arguments->serve.least_obstacle,
                   "Radius in metres of the least obstacle, for the sound presets; default: the\n"
                   "cell's own, and without one there are no sound presets. If the cell states no\n"
                   "'sound', the robot's model is taken for all there is of the robot")
      ->check(PositiveNumber());
  command->add_option("--seed", arguments->seed, "Seed of the random scenes")
      ->capture_default_str();
  CLI::Option* out = command->add_option("--out", arguments->out, "Folder for tables and pictures");
  CLI::Option* pictures =
      command
          ->add_option("--pictures", arguments->pictures,
                       "Missing configurations of each experiment that get a picture, from the\n"
                       "worst scenes first")
          ->check(count)
          ->capture_default_str();
  // What --leave has no part of.
  for (CLI::Option* other : {scenes, hidden, near, off_grid, calibration, images, out, pictures}) {
    leave->excludes(other);
  }
  AddFormatOption(*command, arguments->format);
  RunWhenChosen(*command, run, arguments, cell_experiment::CellMeasure);
}

}  // namespace silhouette
