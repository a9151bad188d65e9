// silhouette-server: serves a cell's database and its scenes to planners.
#include <pthread.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "db/status/status_macros.h"
#include "db/store/store.h"
#include "server/live/calibration_watch.h"
#include "server/scene/served_database.h"
#include "server/service/server.h"
#include "tools/cell/cell.h"
#include "tools/cell/segmentation_text.h"
#include "tools/program/program.h"
#include "tools/silhouette-server/live.h"
#include "tools/silhouette-server/robot_image_memory.h"
#include "tools/silhouette-server/treatments.h"

namespace silhouette {
namespace {

constexpr char kName[] = "silhouette-server";
// How long calls in flight may take when the server is stopped.
constexpr absl::Duration kGrace = absl::Seconds(10);

struct Options {
  std::string cell;
  std::string database;                        // empty: what the cell file says
  std::string listen;                          // empty: what the cell file says
  std::optional<uint64_t> robot_image_memory;  // nothing: what the cell file says
  std::string shared_map;                      // empty: what the cell file says
  std::string calibration_check;               // empty: what the cell file says
  std::string metrics;                         // empty: what the cell file says
  bool live = false;
  std::string obstacles;  // in the simulated cell; empty: none
};

// The signals that the program waits for itself. Blocked before any thread is started, so that no
// thread is interrupted by them.
sigset_t AwaitedSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (int signal : {SIGTERM, SIGINT, SIGHUP}) sigaddset(&signals, signal);
  return signals;
}

std::string Counted(uint64_t count, const std::string& what) {
  return absl::StrCat(count, " ", what, count == 1 ? "" : "s");
}

// How many tiles have robot images but no index that can be used. Looks at every byte of the index.
uint64_t TilesWithoutIndex(const ServedDatabase& database) {
  uint64_t without = 0;
  for (uint64_t tile = 0; tile < database.grid().tiles(); ++tile) {
    if (database.robot_images().present(tile).Empty()) continue;
    if (database.index() == nullptr || database.index()->Tile(tile) == nullptr) ++without;
  }
  return without;
}

void LogElsewhere(const ServedDatabase& variant, const std::string& of) {
  const uint64_t count = variant.robot_images().Count(RobotImageState::kElsewhere);
  if (count == 0) return;
  spdlog::warn(
      "{}{} with a robot image that was captured with a fixed joint elsewhere, as {}: unknown "
      "until "
      "captured anew; 'silhouette-db verify' tells which",
      of, Counted(count, "configuration"), variant.elsewhere());
}

void LogLoaded(const ServedDatabase& database, const std::string& path) {
  const RobotImageTable& images = database.robot_images();
  spdlog::info("loaded '{}', generation {}: {}, {} captured, {} excluded", path,
               database.generation(), Counted(database.grid().size(), "configuration"),
               images.Count(RobotImageState::kPresent), images.Count(RobotImageState::kExcluded));
  if (const uint64_t missing = images.Count(RobotImageState::kMissing); missing > 0) {
    spdlog::warn("{} without a robot image: unknown until captured",
                 Counted(missing, "configuration"));
  }
  if (const uint64_t corrupt = images.Count(RobotImageState::kCorrupt); corrupt > 0) {
    spdlog::warn("{} with a robot image that fails its checksum: unknown until captured anew",
                 Counted(corrupt, "configuration"));
  }
  LogElsewhere(database, "");
  if (const uint64_t without = TilesWithoutIndex(database); without > 0) {
    spdlog::warn(
        "{} of {} without a collision index that fits the robot images: the configuration space "
        "takes longer to work out; run 'silhouette-db index {}' and reload",
        without, Counted(database.grid().tiles(), "tile"), path);
  }
  if (!database.has_references()) {
    spdlog::warn("no reference images: camera images are refused, scene masks are taken");
  }
  if (database.bands() == nullptr) {
    spdlog::info("no calibration: unknown and error pixels are not resolved");
  }
  for (int view = 0; view < database.views(); ++view) {
    const ViewTreatment& treatment = database.treatment(view);
    if (treatment.margin > 0) {
      spdlog::info("view '{}': margin of {:.2f} pixels", database.view_name(view),
                   treatment.margin);
    }
    if (treatment.ignored) {
      spdlog::info("view '{}': {} ignored", database.view_name(view),
                   Counted(treatment.ignored->Count(), "pixel"));
    }
  }
}

// Of a variant beside the default one.
void LogVariant(const ServedDatabase& variant) {
  const RobotImageTable& images = variant.robot_images();
  spdlog::info("variant '{}': {} captured, {} excluded; {}", variant.variant(),
               images.Count(RobotImageState::kPresent), images.Count(RobotImageState::kExcluded),
               images.in_memory() ? "in memory" : "read from the database where they are needed");
  const uint64_t unknown =
      images.Count(RobotImageState::kMissing) + images.Count(RobotImageState::kCorrupt);
  if (unknown > 0) {
    spdlog::warn("variant '{}': {} without a usable robot image: unknown until captured",
                 variant.variant(), Counted(unknown, "configuration"));
  }
  LogElsewhere(variant, absl::StrCat("variant '", variant.variant(), "': "));
  if (const uint64_t without = TilesWithoutIndex(variant); without > 0) {
    spdlog::warn("variant '{}': {} without a collision index; run 'silhouette-db index' and reload",
                 variant.variant(), Counted(without, "tile"));
  }
}

absl::Status MarginsKnown(const Cell& cell, const ServedDatabase& database) {
  const absl::Status& known = database.margins_known();
  if (known.ok()) return known;
  return absl::Status(known.code(), absl::StrCat(cell.file, ": ", known.message()));
}

// Of a cell that states the section 'sound'.
void LogSound(const ServedDatabase& database) {
  if (database.sound() == nullptr) {
    spdlog::warn("the sound presets are not served: {}",
                 std::string(database.CanServe({.preset = Preset::kSound}).message()));
    return;
  }
  const SoundBasis& sound = *database.sound();
  const double least = sound.space().least_obstacle();
  spdlog::info("sound presets: obstacles of {:.3f} m and more are found, hidden or not", least);
  if (sound.mask_scale() > 1) {
    spdlog::warn(
        "the masks tell only obstacles of about {:.3f} m from the robot, so that much will be "
        "blocked that is free: state a greater least_obstacle than {:.3f} m, or capture with masks "
        "of {:.1f} times as many pixels along each side",
        sound.resolvable_obstacle(), least, sound.mask_scale());
  }
  for (const std::string& link : sound.open_links()) {
    spdlog::warn(
        "link '{}' has a shape that is not closed: the sound presets take it for nothing, "
        "and may take the space inside it for an obstacle; close its mesh",
        link);
  }
  for (int view = 0; view < database.views(); ++view) {
    if (database.treatment(view).margin == 0) continue;
    spdlog::warn(
        "view '{}' has a margin: the sound presets take it around the robot for room in which an "
        "obstacle may hide, and may find nothing free; state no margin, or a larger least_obstacle",
        database.view_name(view));
    return;
  }
}

// The newest generation of the database, if it is the cell's.
absl::StatusOr<std::shared_ptr<const ServedDatabase>> Load(const Cell& cell,
                                                           const std::string& path) {
  ASSIGN_OR_RETURN(const std::unique_ptr<Database> database,
                   Database::Open(path, Database::Access::kRead));
  const std::vector<std::string> differences =
      Differences(DescriptionOf(cell), "the cell file", database->cell(), "the database");
  if (!differences.empty()) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the database '", path, "' does not fit the cell file '", cell.file, "': ",
        absl::StrJoin(differences, "; "), SegmentationAdvice(cell.segmentation, database->cell()),
        "; serve the cell file that the database was captured with, or capture anew"));
  }
  ASSIGN_OR_RETURN(const TreatmentSettings treatments, TreatmentSettingsOf(cell));
  ASSIGN_OR_RETURN(const std::optional<SoundCell> sound, SoundCellOf(cell));
  const LoadSettings load = LoadSettingsOf(cell);
  const auto served = ServedDatabase::Load(*database, cell.calibration, treatments, sound, load);
  if (!served.ok()) return served;
  LogLoaded(**served, path);
  LogRobotImages(**served, path, load);
  for (const std::string& name : (*served)->variants()) {
    const ServedDatabase* variant = (*served)->Variant(name);
    if (variant != served->get()) LogVariant(*variant);
  }
  if (sound) LogSound(**served);
  if (cell.choose_preset) return served;
  const absl::Status servable = (*served)->CanServe(cell.policy);
  if (servable.ok()) return served;
  return absl::FailedPreconditionError(absl::StrCat("the cell file '", cell.file,
                                                    "' asks for what the database '", path,
                                                    "' cannot serve: ", servable.message()));
}

void Reload(const Cell& cell, const std::string& path, Server& server) {
  try {
    absl::StatusOr<std::shared_ptr<const ServedDatabase>> database = Load(cell, path);
    if (database.ok()) {
      const absl::Status known = MarginsKnown(cell, **database);
      server.ReplaceDatabase(*std::move(database));
      spdlog::info("reloaded; verdicts are unknown until the next scene");
      if (!known.ok()) spdlog::error("nothing is free: {}", std::string(known.message()));
      return;
    }
    spdlog::error("not reloaded, still serving the old state: {}",
                  std::string(database.status().message()));
  } catch (const std::exception& error) {
    spdlog::error("not reloaded, still serving the old state: {}", error.what());
  }
}

// Serves until SIGTERM or SIGINT comes.
void WaitForEnd(const Cell& cell, const std::string& path, Server& server) {
  const sigset_t signals = AwaitedSignals();
  for (;;) {
    int signal = 0;
    if (sigwait(&signals, &signal) != 0) continue;
    if (signal != SIGHUP) return;
    Reload(cell, path, server);
  }
}

int Run(const Options& options) {
  absl::StatusOr<Cell> cell = LoadCell(options.cell);
  if (!cell.ok()) return Report(kName, cell.status());
  if (options.robot_image_memory) cell->server.robot_image_memory = options.robot_image_memory;
  const std::string path = options.database.empty() ? cell->database : options.database;
  if (path.empty()) {
    return Report(kName, absl::InvalidArgumentError(absl::StrCat(
                             "'", options.cell, "' names no database; give --database DIR")));
  }
  absl::StatusOr<std::shared_ptr<const ServedDatabase>> database = Load(*cell, path);
  if (!database.ok()) return Report(kName, database.status());
  if (const absl::Status known = MarginsKnown(*cell, **database); !known.ok()) {
    return Report(kName, known);
  }

  ServingSettings settings;
  settings.policy = cell->policy;
  settings.choose_preset = cell->choose_preset;
  settings.scene = cell->server.scene;
  settings.map_time = cell->server.map_time;
  settings.segmentation = cell->segmentation;
  settings.worker_threads = static_cast<int>(std::max(2u, std::thread::hardware_concurrency()));
  settings.shared_map = {
      .file = options.shared_map.empty() ? cell->server.shared_map : options.shared_map,
      .mode = cell->server.shared_map_mode};
  const CalibrationWatchSettings check{.file = options.calibration_check.empty()
                                                   ? cell->server.calibration_check
                                                   : options.calibration_check,
                                       .max_age = cell->server.calibration_check_max_age};
  if (!check.file.empty()) {
    settings.trust = std::make_shared<const CalibrationTrust>(ReadTrust(check, SystemClock()));
  }
  settings.metrics = options.metrics.empty() ? cell->server.metrics : options.metrics;
  if (options.live) settings.live = NewLiveRecord(*cell);
  const std::shared_ptr<LiveRecord> live_record = settings.live;
  const std::string shared_map = settings.shared_map.file;
  const std::string listen = options.listen.empty() ? cell->server.listen : options.listen;
  const absl::StatusOr<std::unique_ptr<Server>> server =
      Server::Start(listen, *std::move(database), std::move(settings));
  if (!server.ok()) return Report(kName, server.status());
  std::optional<CalibrationWatch> calibration_watch;
  if (!check.file.empty()) {
    calibration_watch.emplace(check, SystemClock,
                              [&server](auto trust) { (*server)->SetTrust(std::move(trust)); });
  }
  std::unique_ptr<LiveLoop> live;
  if (options.live) {
    auto started = StartLive(*cell, options.obstacles, live_record, **server);
    if (!started.ok()) return Report(kName, started.status());
    live = *std::move(started);
  }
  std::cout << "listening on " << (*server)->address() << std::endl;
  spdlog::info("serving cell '{}' on {}", cell->name, (*server)->address());
  if (!(*server)->metrics_address().empty()) {
    spdlog::info("metrics at http://{}/metrics", (*server)->metrics_address());
  }
  if (!shared_map.empty()) {
    spdlog::info("sharing its configuration space in '{}', mode {:04o}", shared_map,
                 cell->server.shared_map_mode);
  }

  WaitForEnd(*cell, path, **server);
  live.reset();
  calibration_watch.reset();
  spdlog::info("stopping; calls in flight may take {} more", absl::FormatDuration(kGrace));
  // A second signal ends the program at once.
  sigset_t ending = AwaitedSignals();
  sigdelset(&ending, SIGHUP);
  pthread_sigmask(SIG_UNBLOCK, &ending, nullptr);
  (*server)->Stop(kGrace);
  spdlog::info("stopped");
  return kDone;
}

int Main(int argc, char** argv) {
  const sigset_t signals = AwaitedSignals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  setenv("GRPC_VERBOSITY", "NONE", /*overwrite=*/0);
  spdlog::set_default_logger(spdlog::stderr_logger_mt(kName));

  CLI::App app("Serves a cell: verdicts on robot configurations from the newest scene.", kName);
  Options options;
  app.add_option("--cell", options.cell, "The cell file")->required();
  app.add_option("--database", options.database,
                 "The folder of the database; default: what the cell file says");
  app.add_option("--listen", options.listen,
                 "host:port (port 0: any free one) or unix:path; default: what the cell file says");
  app.add_option(
         "--robot-image-memory", options.robot_image_memory,
         "The most that robot images may take in memory, e.g. 8GB; more than that stay in the\n"
         "database and are read where they are needed. Default: what the cell file says")
      ->transform(CLI::AsSizeValue(/*kb_is_1000=*/true))
      ->option_text("SIZE");
  app.add_option(
      "--shared-map", options.shared_map,
      "A file for the configuration space, which programs on this machine then look up in "
      "memory; default: what the cell file says, else none");
  app.add_option(
      "--calibration-check", options.calibration_check,
      "What 'silhouette-calibrate check --out' wrote, followed as it changes: while it is\n"
      "not known that no camera moved, presets that rest on the calibration are unknown.\n"
      "Default: what the cell file says, else the calibration is taken to hold");
  app.add_flag("--live", options.live,
               "Take the images of the cell's cameras and the joints of its robot here, and make\n"
               "the scenes of them; then nobody else may publish scenes");
  app.add_option("--metrics", options.metrics,
                 "host:port where metrics are told to Prometheus, at /metrics; default: what the "
                 "cell file says, else nowhere");
  app.add_option("--simulated-obstacles", options.obstacles,
                 "With --live and a simulated cell: a file of the obstacles in it")
      ->needs("--live");
  app.footer(
      "Prints one line to stdout, 'listening on ADDRESS', when it is ready; its log goes to\n"
      "stderr. SIGTERM and Ctrl-C let the calls in flight finish; SIGHUP reads the database anew.\n"
      "Whoever reaches the address can ask and publish scenes.\n\n"
      "Example:\n"
      "  silhouette-server --cell cell.yaml --database cell.lmdb --listen 127.0.0.1:50051\n"
      "  silhouette-server --cell cell.yaml --shared-map /dev/shm/silhouette-cell\n"
      "  silhouette-server --cell cell.yaml --live --metrics 127.0.0.1:9464");
  return RunProgram(app, argc, argv, [&options] { return Run(options); });
}

}  // namespace
}  // namespace silhouette

int main(int argc, char** argv) { return silhouette::Main(argc, argv); }
