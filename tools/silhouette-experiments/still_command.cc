// SPDX-License-Identifier: Apache-2.0
// silhouette-experiments still
#include <spdlog/spdlog.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <condition_variable>
#include <iostream>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "capture/sim/contact.h"
#include "common/numbers/numbers.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "server/live/live_loop.h"
#include "server/scene/configuration_space.h"
#include "tools/cell/live_config.h"
#include "tools/program/progress.h"
#include "tools/silhouette-experiments/cell/scenes.h"
#include "tools/silhouette-experiments/cell/simulated_workplace.h"
#include "tools/silhouette-experiments/commands.h"

namespace silhouette {
namespace {

using cell_experiment::SimulatedWorkplace;

struct StillArguments {
  std::string cell;
  std::string database;
  std::string obstacles;
  std::string weak_rim = "cell";
  int scenes = 1000;
  int robots = 3;
  uint64_t seed = 1;
  std::string format = "text";
};

// The verdicts on all configurations: a bit each.
using OccupiedBits = std::vector<uint64_t>;

// What stands still.
struct StillPlace {
  std::string name;
  Configuration robot;
  std::vector<Obstacle> obstacles;
};

struct StillRow {
  std::string name;
  Configuration robot;
  uint64_t configurations = 0;
  uint64_t unknown_scenes = 0;   // with a verdict that is unknown; not among the others
  std::vector<double> occupied;  // configurations, by scene
  std::vector<double> changed;   // verdicts that are not those of the scene before
};

// Receives the scenes of a LiveLoop and keeps the verdicts on them.
class Watcher {
 public:
  Watcher(std::shared_ptr<const ServedDatabase> database, Policy policy, int scenes, StillRow& row)
      : database_(std::move(database)), policy_(policy), scenes_(scenes), row_(row) {}

  absl::StatusOr<SharedScene> Take(Scene made) {
    auto scene = std::make_shared<const Scene>(std::move(made));
    const ConfigurationSpace space(
        {.database = database_, .scene = scene, .without_scene = Reason::kNone}, policy_);
    OccupiedBits bits;
    uint64_t unknown = 0;
    for (uint64_t tile = 0; tile < space.tiles(); ++tile) {
      const TileVerdicts& verdicts = space.tile(tile);
      bits.insert(bits.end(), verdicts.occupied.begin(), verdicts.occupied.end());
      for (size_t i = 0; i < verdicts.occupied.size(); ++i) {
        const uint64_t present = database_->robot_images().present(tile).words[i];
        unknown += std::popcount(present & ~(verdicts.occupied[i] | verdicts.free[i]));
      }
    }
    const std::lock_guard lock(mutex_);
    Note(bits, unknown, *scene);
    done_.notify_all();
    return scene;
  }

  // Until all scenes came. Aborted: a stop was asked for. FailedPrecondition, with the defects of
  // the newest scene: in kMostUnknown scenes in a row a verdict is unknown.
  absl::Status Wait(const std::function<void(uint64_t)>& progress) {
    constexpr std::chrono::milliseconds kMoment(200);
    std::unique_lock lock(mutex_);
    while (!Enough() && unknown_in_a_row_ < kMostUnknown && !StopRequested()) {
      done_.wait_for(lock, kMoment);
      progress(row_.occupied.size());
    }
    if (Enough()) return absl::OkStatus();
    if (unknown_in_a_row_ < kMostUnknown) {
      return absl::AbortedError("stopped; start it again to have a result");
    }
    return absl::FailedPreconditionError(
        absl::StrCat("in each of ", kMostUnknown, " scenes a verdict is unknown", defects_));
  }

 private:
  static constexpr int kMostUnknown = 100;

  bool Enough() const { return std::ssize(row_.occupied) >= scenes_; }

  void Note(const OccupiedBits& bits, uint64_t unknown, const Scene& scene) {
    if (Enough()) return;
    if (unknown > 0) {
      ++row_.unknown_scenes;
      ++unknown_in_a_row_;
      defects_.clear();
      for (const SceneDefect& defect : scene.defects) {
        absl::StrAppend(&defects_, defects_.empty() ? ": " : "; ", defect.message);
      }
      if (defects_.empty()) {
        defects_ =
            absl::StrCat(": ", unknown,
                         " configurations of a scene without defects; see what 'silhouette-db "
                         "verify' and 'silhouette-capture status' say of their robot images");
      }
      return;
    }
    unknown_in_a_row_ = 0;
    int64_t occupied = 0;
    int64_t changed = 0;
    for (size_t i = 0; i < bits.size(); ++i) {
      occupied += std::popcount(bits[i]);
      if (!before_.empty()) changed += std::popcount(bits[i] ^ before_[i]);
    }
    row_.occupied.push_back(static_cast<double>(occupied));
    if (!before_.empty()) row_.changed.push_back(static_cast<double>(changed));
    before_ = bits;
  }

  const std::shared_ptr<const ServedDatabase> database_;
  const Policy policy_;
  const int scenes_;
  std::mutex mutex_;
  std::condition_variable done_;
  StillRow& row_;
  OccupiedBits before_;
  int unknown_in_a_row_ = 0;
  std::string defects_;  // of the newest of these scenes
};

const Eigen::Vector2d kPersonAt(0.9, 0.75);

// A person who stands beside the robot.
Obstacle StillPerson(double floor) {
  constexpr double kRadius = 0.2;
  constexpr double kHeight = 1.75;
  Obstacle person;
  person.name = "person";
  person.mesh = CapsuleMesh(kRadius, kHeight - 2 * kRadius);
  person.world_from_obstacle.translation() =
      Eigen::Vector3d(kPersonAt.x(), kPersonAt.y(), floor + kHeight / 2);
  person.brightness = 0.5;
  return person;
}

// `robots` configurations, the grid's first and random ones, that touch none of the obstacles.
// InvalidArgument if too few are found.
absl::StatusOr<std::vector<StillPlace>> StillPlaces(const SimulatedWorkplace& workplace,
                                                    const StillArguments& arguments,
                                                    const std::vector<Obstacle>& things) {
  constexpr int kTriesForEach = 1000;
  std::vector<Obstacle> all = things;
  all.push_back(StillPerson(workplace.simulation().settings().room.lower.z()));
  const ConfigurationGrid& grid = workplace.cell().grid;
  const ContactChecker contact(workplace.robot(), all);
  const Poses poses = ObstaclePoses(all, 0);
  cell_experiment::Chance chance(arguments.seed, 0);
  std::vector<Configuration> robots;
  for (int i = 0; std::ssize(robots) < arguments.robots; ++i) {
    if (i == kTriesForEach * arguments.robots) {
      return absl::InvalidArgumentError(
          things.empty()
              ? absl::StrFormat("the robot touches the person at x = %.2f m, y = %.2f m nearly "
                                "everywhere; take a cell whose robot can keep away from there",
                                kPersonAt.x(), kPersonAt.y())
              : "the robot touches what stands in the cell nearly everywhere; take away obstacles");
    }
    const Configuration q = i == 0 ? grid.At(0)
                                   : cell_experiment::RandomConfiguration(
                                         chance, grid, /*on_grid=*/robots.size() % 2 == 0);
    if (!contact.Touches(workplace.LinkPoses(q), poses)) robots.push_back(q);
  }
  std::vector<StillPlace> places;
  for (const auto& [name, obstacles] :
       {std::pair{"things", things}, std::pair{"and a person", all}}) {
    for (const Configuration& q : robots) places.push_back({name, q, obstacles});
  }
  return places;
}

absl::StatusOr<StillRow> WatchStill(const SimulatedWorkplace& workplace,
                                    const std::shared_ptr<const ServedDatabase>& database,
                                    const StillPlace& place, const StillArguments& arguments) {
  StillRow row{.name = place.name, .robot = place.robot, .occupied = {}, .changed = {}};
  row.configurations = database->grid().size();
  SimulatedCell& cell = workplace.simulation();
  cell.SetObstacles(place.obstacles);
  cell.SetPositions(workplace.Positions(place.robot));
  std::vector<SimulatedView> views;
  std::vector<std::string> names;
  for (const ViewSettings& view : workplace.cell().views) {
    views.push_back({view.name, view.image_width, view.image_height});
    names.push_back(view.name);
  }
  LiveConfig config = LiveConfigOf(workplace.cell());
  config.live.interval = absl::ZeroDuration();
  // Each image is the one just before the next, however busy this computer is.
  config.live.evidence_gap = absl::InfiniteDuration();
  if (arguments.weak_rim != "cell") {
    config.scene.weak_rim =
        arguments.weak_rim == "unknown" ? WeakRim::kUnknown : WeakRim::kObstacle;
  }
  Watcher watcher(database, workplace.cell().policy, arguments.scenes, row);
  // Not owned: it outlives the loop.
  const std::shared_ptr<SimulatedCell> simulated(std::shared_ptr<void>(), &cell);
  const auto record = std::make_shared<LiveRecord>(names, config.scene.max_age, config.clock);
  Progress progress(place.name, static_cast<uint64_t>(arguments.scenes), "scenes");
  ASSIGN_OR_RETURN(
      auto loop,
      LiveLoop::Start(
          config,
          {.open_cameras = [&]() -> absl::StatusOr<std::unique_ptr<CameraRig>> {
             return SimulatedCameraRig::Create(simulated, views);
           },
           .open_robot = [&]() -> absl::StatusOr<std::unique_ptr<Robot>> {
             return std::make_unique<SimulatedRobot>(simulated);
           }},
          {.database = [&] { return database; },
           .publish = [&](Scene scene, const auto&) { return watcher.Take(std::move(scene)); }},
          record));
  RETURN_IF_ERROR(watcher.Wait([&](uint64_t done) { progress.Update(done); }));
  loop.reset();  // its thread writes the row
  return row;
}

struct StillFigures {
  double least = 0;
  double median = 0;
  double most = 0;
  int beyond = 0;      // scenes that are more than 2 % from the median
  double changed = 0;  // median
};

StillFigures FiguresOf(const StillRow& row) {
  constexpr double kFar = 0.02;
  const auto [least, most] = std::ranges::minmax_element(row.occupied);
  const double median = Median(row.occupied);
  return {.least = *least,
          .median = median,
          .most = *most,
          .beyond = static_cast<int>(std::ranges::count_if(
              row.occupied,
              [&](double occupied) { return std::abs(occupied - median) > kFar * median; })),
          .changed = Median(row.changed)};
}

std::string StillTextOf(const std::vector<StillRow>& rows) {
  std::string text =
      "| what stands there | robot, rad | occupied: least | median | most | spread | scenes more "
      "than 2 % from the median | verdicts changed, median | unknown scenes |\n"
      "|---|---|---|---|---|---|---|---|---|\n";
  for (const StillRow& row : rows) {
    const StillFigures f = FiguresOf(row);
    absl::StrAppendFormat(&text,
                          "| %s | %s | %.0f | %.0f | %.0f | %.2f %% | %d | %.0f (%.2f %%) | %d |\n",
                          row.name, absl::StrJoin(row.robot, ", "), f.least, f.median, f.most,
                          Percent(f.most - f.least, f.median), f.beyond, f.changed,
                          Percent(f.changed, f.median), row.unknown_scenes);
  }
  return text;
}

nlohmann::ordered_json StillJsonOf(const std::vector<StillRow>& rows) {
  auto list = nlohmann::ordered_json::array();
  for (const StillRow& row : rows) {
    const StillFigures f = FiguresOf(row);
    list.push_back({{"name", row.name},
                    {"robot", row.robot},
                    {"configurations", row.configurations},
                    {"scenes", row.occupied.size()},
                    {"unknown_scenes", row.unknown_scenes},
                    {"least_occupied", f.least},
                    {"median_occupied", f.median},
                    {"most_occupied", f.most},
                    {"scenes_beyond_2_percent", f.beyond},
                    {"median_changed", f.changed}});
  }
  return list;
}

absl::StatusOr<ExitCode> RunStill(const StillArguments& arguments) {
  ASSIGN_OR_RETURN(const SimulatedWorkplace workplace,
                   SimulatedWorkplace::Load(arguments.cell, arguments.database));
  std::vector<Obstacle> things;
  if (!arguments.obstacles.empty()) {
    ASSIGN_OR_RETURN(things, LoadObstacles(arguments.obstacles));
  }
  CatchStopSignals();
  spdlog::set_level(
      spdlog::level::off);  // what it says of each loop; standard output is the result
  CaptureObserver observer;
  observer.stop_requested = StopRequested;
  std::optional<Progress> progress;
  observer.progress = [&](uint64_t done) {
    if (!progress) progress.emplace("capturing", workplace.cell().grid.size(), "configurations");
    progress->Update(done);
  };
  ASSIGN_OR_RETURN(const auto stored, workplace.OpenOrCapture(arguments.database, observer));
  ASSIGN_OR_RETURN(const auto database, workplace.Serve(*stored, {}));
  workplace.simulation().RunInRealTime();
  std::vector<StillRow> rows;
  ASSIGN_OR_RETURN(const auto places, StillPlaces(workplace, arguments, things));
  for (const StillPlace& place : places) {
    ASSIGN_OR_RETURN(StillRow row, WatchStill(workplace, database, place, arguments));
    rows.push_back(std::move(row));
  }
  PrintResult(arguments.format, StillJsonOf(rows), StillTextOf(rows));
  return kDone;
}

}  // namespace

void AddStillCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "still",
      "How much verdicts change from scene to scene while nothing moves: the live server's\n"
      "acquisition on the simulated cell, with the obstacles of a file, without and with a person");
  const auto arguments = std::make_shared<StillArguments>();
  command->add_option("--cell", arguments->cell, "The file of a simulated cell")->required();
  command
      ->add_option("--database", arguments->database,
                   "The database's folder; what it lacks is captured first")
      ->required();
  command->add_option("--obstacles", arguments->obstacles, "A scene file: what stands in the cell");
  command
      ->add_option("--weak-rim", arguments->weak_rim,
                   "What faint foreground at the robot's rim is; 'cell': as the cell's file says")
      ->check(CLI::IsMember({"cell", "unknown", "obstacle"}))
      ->capture_default_str();
  command->add_option("--scenes", arguments->scenes, "How many for each row")
      ->check(CLI::Range(2, 1'000'000))
      ->capture_default_str();
  command->add_option("--robots", arguments->robots, "In how many configurations the robot stands")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command->add_option("--seed", arguments->seed, "Of these")->capture_default_str();
  AddFormatOption(*command, arguments->format);
  command->footer(
      "Example:\n"
      "  silhouette-experiments still --cell capture/sim/cells/demo/cell.yaml \\\n"
      "      --database out/demo.lmdb --obstacles capture/sim/cells/demo/obstacles.yaml");
  RunWhenChosen(*command, run, arguments, RunStill);
}

}  // namespace silhouette
