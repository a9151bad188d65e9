// SPDX-License-Identifier: Apache-2.0
// silhouette-experiments people
#include <spdlog/spdlog.h>
#include <xxhash.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/robot/drawn_digest.h"
#include "common/picture/files.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/program/progress.h"
#include "tools/silhouette-experiments/commands.h"
#include "tools/silhouette-experiments/people/figures.h"
#include "tools/silhouette-experiments/people/study.h"

namespace silhouette {
namespace people_experiment {
namespace {

// Metres: of the zone in which people count, from the floor on.
constexpr double kZoneHeight = 2;

struct PeopleArguments {
  std::string cell;
  std::string database;
  std::string out;
  std::string format = "text";
  std::string images = "captured";
  std::string masks = "geometry";
  std::string video;
  std::vector<std::string> methods;
  int episodes = 20;
  double rate = 20;
  double least_obstacle = 0.16;
  EpisodeSettings episode;
};

absl::StatusOr<std::shared_ptr<const ServedDatabase>> ServePeople(
    const SimulatedWorkplace& workplace, const PeopleArguments& arguments) {
  const bool drawn = arguments.images == "drawn";
  if (!drawn) {
    RETURN_IF_ERROR(
        cell_experiment::CheckGridIsStated(workplace.cell(), ", or give --images drawn"));
  }
  const std::string& path = arguments.database;
  std::optional<Progress> progress;
  CaptureObserver observer;
  observer.progress = [&](uint64_t done) {
    if (!progress) progress.emplace("capturing", workplace.cell().grid.size(), "configurations");
    progress->Update(done);
  };
  observer.stop_requested = StopRequested;
  ASSIGN_OR_RETURN(const auto database, drawn ? workplace.OpenUncaptured(path)
                                              : workplace.OpenOrCapture(path, observer));
  cell_experiment::ServeSettings settings;
  if (drawn) settings.drawn = PartSettings();
  if (!workplace.cell().sound) settings.least_obstacle = arguments.least_obstacle;
  const SpeedRule rule = DefaultRule(ReachOf(workplace), arguments.rate);
  const double around = rule.reach + rule.ProtectiveDistances().back();
  const double floor = workplace.simulation().settings().room.lower.z();
  settings.separation = SeparationCell{
      .settings = rule.separation,
      .zone = Eigen::AlignedBox3d(Eigen::Vector3d(-around, -around, floor),
                                  Eigen::Vector3d(around, around, floor + kZoneHeight)),
      .voxel_edge = std::nullopt,
      .unseen_is_empty = true};
  return workplace.Serve(*database, settings);
}

// The named methods; without names all that the database has what they need for, but `sound` on
// drawn robot images: its maps take seconds each.
absl::StatusOr<std::vector<std::string>> MethodsOf(const std::vector<std::string>& names,
                                                   const ServedDatabase& database) {
  for (const std::string& name : names) RETURN_IF_ERROR(CanRun(name, database));
  if (!names.empty()) return names;
  std::vector<std::string> methods;
  for (const std::string& name : MethodNames()) {
    const bool slow = name == NameOf(Preset::kSound) && database.robot_images().drawn() != nullptr;
    if (!slow && CanRun(name, database).ok()) methods.push_back(name);
  }
  return methods;
}

// Null: none is asked for.
absl::StatusOr<std::unique_ptr<Video>> OpenVideo(const PeopleArguments& arguments, size_t views) {
  if (arguments.video.empty()) return nullptr;
  if (arguments.masks != "rendered" || arguments.episodes != 1 || arguments.methods.size() != 1) {
    return absl::InvalidArgumentError(
        "--video shows one episode of one method through the cameras; add --masks rendered "
        "--episodes 1 --methods silhouette");
  }
  if (!arguments.out.empty()) {
    return absl::InvalidArgumentError("--video keeps no results; leave --out out");
  }
  ASSIGN_OR_RETURN(Video video, Video::Open(arguments.video, views, arguments.rate));
  return std::make_unique<Video>(std::move(video));
}

// The study's only episode.
absl::StatusOr<std::vector<EpisodeResult>> Film(const Stage& stage, const Study& study,
                                                Video& video) {
  const std::string& method = study.methods.front();
  ASSIGN_OR_RETURN(Counts counts,
                   RunEpisode(stage, study.episode, 0, method, StopRequested, &video));
  return std::vector<EpisodeResult>{{0, method, std::move(counts)}};
}

// Study::basis.
absl::StatusOr<std::string> BasisOf(const SimulatedWorkplace& workplace,
                                    const PeopleArguments& arguments, const Stage& stage) {
  const Cell& cell = workplace.cell();
  ASSIGN_OR_RETURN(std::string files, ReadWholeFile(cell.file));
  ASSIGN_OR_RETURN(const std::string simulation, ReadWholeFile(cell.simulation));
  files += simulation;
  files += DigestOf(stage.robot());
  // Results of another build are of another method.
  ASSIGN_OR_RETURN(const std::string program, ReadWholeFile("/proc/self/exe"));
  files += program;
  return absl::StrFormat(
      "%s %s %d, least obstacle %.17g m, %.17g images a second, cell files and program %016x",
      cell.name, arguments.images, stage.database()->generation(),
      cell.sound ? cell.sound->least_obstacle : arguments.least_obstacle, arguments.rate,
      XXH3_64bits(files.data(), files.size()));
}

absl::StatusOr<ExitCode> RunPeople(const PeopleArguments& arguments) {
  CatchStopSignals();
  spdlog::set_level(spdlog::level::err);  // not what the acquisition warns of in each episode
  ASSIGN_OR_RETURN(const SimulatedWorkplace workplace,
                   SimulatedWorkplace::Load(arguments.cell, arguments.database));
  ASSIGN_OR_RETURN(const auto video, OpenVideo(arguments, workplace.cell().views.size()));
  ASSIGN_OR_RETURN(const auto database, ServePeople(workplace, arguments));
  ASSIGN_OR_RETURN(const auto methods, MethodsOf(arguments.methods, *database));
  ASSIGN_OR_RETURN(const Stage stage, Stage::Make(workplace, database, arguments.rate));
  ASSIGN_OR_RETURN(const std::string basis, BasisOf(workplace, arguments, stage));
  Study study{.episode = arguments.episode,
              .episodes = arguments.episodes,
              .methods = methods,
              .file = arguments.out.empty() ? "" : absl::StrCat(arguments.out, "/episodes.jsonl"),
              .basis = basis};
  study.episode.rendered = arguments.masks == "rendered";
  Progress progress("people", methods.size() * static_cast<size_t>(arguments.episodes),
                    "episodes of a method");
  ASSIGN_OR_RETURN(
      const auto results,
      video != nullptr
          ? Film(stage, study, *video)
          : RunStudy(
                stage, study, [&](size_t done, size_t kept) { progress.Update(done, kept); },
                StopRequested));
  progress.Update(results.size());
  const std::vector<MethodFigures> figures = FiguresOf(results, methods);
  const nlohmann::ordered_json json = JsonOf(figures);
  if (!arguments.out.empty()) {
    RETURN_IF_ERROR(WriteWholeFile(absl::StrCat(arguments.out, "/people.json"), json.dump(2)));
    RETURN_IF_ERROR(WriteWholeFile(absl::StrCat(arguments.out, "/people.txt"), TextOf(figures)));
    RETURN_IF_ERROR(WriteCharts(results, figures, arguments.out));
  }
  PrintResult(arguments.format, json, TextOf(figures));
  return kDone;
}

}  // namespace
}  // namespace people_experiment

void AddPeopleCommand(CLI::App& program, Run& run) {
  using people_experiment::PeopleArguments;
  CLI::App* command = program.add_subcommand(
      "people",
      "Episodes of a robot at work while people walk, stop, reach and carry: a light curtain, a\n"
      "zone scanner, an oracle, the presets and distances in space, in the same episodes");
  const auto arguments = std::make_shared<PeopleArguments>();
  command->add_option("--cell", arguments->cell, "The file of a simulated cell")->required();
  command
      ->add_option("--database", arguments->database,
                   "The database's folder; what it lacks is captured first")
      ->required();
  command
      ->add_option("--images", arguments->images,
                   "Robot images that verdicts rest on; 'drawn': nothing is captured")
      ->check(CLI::IsMember({"captured", "drawn"}))
      ->capture_default_str();
  command
      ->add_option("--masks", arguments->masks,
                   "What scenes are made of: masks drawn from geometry, with errors; or rendered\n"
                   "camera images, through the live server's acquisition")
      ->check(CLI::IsMember({"geometry", "rendered"}))
      ->capture_default_str();
  command->add_option("--video", arguments->video,
                      "Film one rendered episode of one method into this file, .mp4 or .avi");
  command
      ->add_option(
          "--least-obstacle", arguments->least_obstacle,
          "Radius for the sound presets and distances, m, if the cell states no 'sound'; the\n"
          "robot's model is then taken for all there is of the robot")
      ->check(PositiveNumber())
      ->capture_default_str();
  command
      ->add_option("--episodes", arguments->episodes,
                   "How many; with --out, those that are there already count")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  command
      ->add_option("--rate", arguments->rate,
                   "Images of each camera a second, and decisions that rest on them")
      ->check(CLI::Range(1.0, 100.0))
      ->capture_default_str();
  command->add_option("--seconds", arguments->episode.seconds, "Of an episode")
      ->check(CLI::Range(1.0, 3600.0))
      ->capture_default_str();
  command->add_option("--seed", arguments->episode.seed, "Of people and masks")
      ->capture_default_str();
  command
      ->add_option("--methods", arguments->methods,
                   "Which, separated by commas; without it all that the cell can have")
      ->check(CLI::IsMember(people_experiment::MethodNames()))
      ->delimiter(',');
  command->add_flag("--people-stop", arguments->episode.people_stop,
                    "People stand still rather than step towards the robot within 15 cm of it");
  command->add_option("--out", arguments->out,
                      "A folder for results and charts; the same command goes on with it");
  AddFormatOption(*command, arguments->format);
  command->footer(
      "Example:\n"
      "  silhouette-experiments people --cell capture/sim/cells/people/cell.yaml \\\n"
      "      --database out/people.lmdb --images drawn --episodes 50 --out out/people");
  RunWhenChosen(*command, run, arguments, people_experiment::RunPeople);
}

}  // namespace silhouette
