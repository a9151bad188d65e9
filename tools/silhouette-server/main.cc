// SPDX-License-Identifier: Apache-2.0
// silhouette-server: serves a cell's database and its scenes to planners.
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <systemd/sd-daemon.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <future>
#include <iostream>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "capture/session/travel.h"
#include "common/log/log_lines.h"
#include "common/times/times.h"
#include "db/status/status_macros.h"
#include "server/audit/audit_log.h"
#include "server/gate/credentials.h"
#include "server/gate/roles.h"
#include "server/live/calibration_watch.h"
#include "server/live/live_loop.h"
#include "server/live/live_record.h"
#include "server/page/page.h"
#include "server/page/replay.h"
#include "server/scene/served_database.h"
#include "server/service/listener.h"
#include "server/service/server.h"
#include "tools/cell/cell.h"
#include "tools/cell/devices/cell_devices.h"
#include "tools/cell/live_config.h"
#include "tools/program/program.h"
#include "tools/silhouette-server/cell_database.h"
#include "tools/silhouette-server/reloader.h"
#include "tools/silhouette-server/signals.h"

namespace silhouette {
namespace {

constexpr char kName[] = "silhouette-server";
// How long calls in flight may take when the server is stopped; less than Signals::kLongestEnd.
constexpr absl::Duration kGrace = absl::Milliseconds(700);

struct Options {
  std::string cell;
  std::string database;                        // empty: as in the cell file
  std::string listen;                          // empty: as in the cell file
  std::optional<uint64_t> robot_image_memory;  // nothing: as in the cell file
  std::string calibration_check;               // empty: as in the cell file
  std::string metrics;                         // empty: as in the cell file
  std::string page;                            // empty: none
  std::string page_role;                       // empty: the page is read-only
  std::string replay;                          // a recording; empty: the cell as it is
  std::string preset;                          // empty: as in the cell file
  bool live = false;
  bool insecure = false;
  bool unverified = false;
  std::string obstacles;  // in the simulated cell; empty: none
};

// Tells systemd's watchdog, if there is one (WatchdogSec, sd_watchdog_enabled(3)), that scenes are
// still taken.
void ShowLife(const std::stop_token& stop, Server& server) {
  uint64_t microseconds = 0;
  if (sd_watchdog_enabled(/*unset_environment=*/0, &microseconds) <= 0) return;
  const auto period = std::chrono::microseconds(microseconds / 3);
  std::mutex mutex;
  std::condition_variable_any stopped;
  std::unique_lock lock(mutex);
  while (!stopped.wait_for(lock, stop, period, [&stop] { return stop.stop_requested(); })) {
    server.RunWhereScenesAreTaken([] { sd_notify(0, "WATCHDOG=1"); });
  }
}

std::shared_ptr<LiveRecord> NewLiveRecord(const Cell& cell) {
  std::vector<std::string> views;
  for (const ViewSettings& view : cell.views) views.push_back(view.name);
  const std::string& variant = cell.server.live.variant;
  return std::make_shared<LiveRecord>(views, cell.server.scene.max_age, SystemClock,
                                      variant.empty() ? KnownVariant() : KnownVariant(variant));
}

// Warns of sources whose scenes are not of the cell as it is now.
void WarnOfSources(const Cell& cell) {
  const bool simulated = std::holds_alternative<SimulatedRobotDriver>(cell.robot.driver);
  for (const ViewSettings& view : cell.views) {
    if (std::holds_alternative<VideoSource>(view.source) ||
        std::holds_alternative<FolderSource>(view.source)) {
      spdlog::warn(
          "view '{}' is a recording: verdicts say nothing of the cell as it is now; state its "
          "camera as 'source'",
          view.name);
    }
    if (simulated && !IsSimulated(view.source)) {
      spdlog::warn(
          "view '{}' is not simulated, but the robot is: the robot's reported joints are not those "
          "that this view shows; state the 'driver' of the cell's robot, or 'source: sim'",
          view.name);
    }
  }
}

// The devices of a live server. `obstacles`: a file of the obstacles in a simulated cell; empty:
// none. Errors: those of OpenersOf, and what a live server cannot do.
absl::StatusOr<CellOpeners> LiveDevicesOf(const Cell& cell, const std::string& obstacles) {
  const auto* manual = std::get_if<ManualRobotSettings>(&cell.robot.driver);
  if (manual != nullptr && std::holds_alternative<std::monostate>(manual->read)) {
    return absl::InvalidArgumentError(
        absl::StrCat(cell.file,
                     ": robot.driver: --live needs a robot that reports its joints all the time; "
                     "'manual' only asks people for them: give it 'read'"));
  }
  try {
    const Travel travel(cell.grid, cell.capture.forbidden_regions);
    return OpenersOf(cell, travel, obstacles);
  } catch (const std::invalid_argument& error) {
    return absl::InvalidArgumentError(cell.file + ": " + error.what());
  }
}

// Opens the devices and publishes scenes to `server`, which must outlive it. Errors: those of
// LiveLoop::Start.
absl::StatusOr<std::unique_ptr<LiveLoop>> StartLive(const Cell& cell, CellOpeners devices,
                                                    std::shared_ptr<LiveRecord> record,
                                                    Server& server) {
  LiveConfig config = LiveConfigOf(cell);
  config.live.threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  return LiveLoop::Start(
      config, {.open_cameras = std::move(devices.cameras), .open_robot = std::move(devices.robot)},
      {.database = [&server] { return server.database(); },
       .publish = [&server](
                      Scene scene,
                      const auto& database) { return server.Publish(std::move(scene), database); }},
      std::move(record));
}

// As many as the limits of connections ask for, as far as the system lets the process have them.
void AskForDescriptors(const ClientLimits& limits) {
  rlimit descriptors{};
  getrlimit(RLIMIT_NOFILE, &descriptors);
  const rlim_t needed = 2 * static_cast<rlim_t>(limits.connections) + Listener::kReserve;
  descriptors.rlim_cur = std::min(descriptors.rlim_max, std::max(descriptors.rlim_cur, needed));
  setrlimit(RLIMIT_NOFILE, &descriptors);
}

// Shows a recording on the page, and opens nothing else.
absl::Status ShowRecording(const Options& options, Signals& signals) {
  if (options.page.empty()) {
    return InvalidArgument("--replay shows a recording on the page: add --page 127.0.0.1:8080");
  }
  if (options.live || !options.listen.empty() || !options.metrics.empty() ||
      !options.calibration_check.empty()) {
    return InvalidArgument(
        "--replay shows a recording on the page and serves nothing else: leave out --live, "
        "--listen, --metrics and --calibration-check");
  }
  ASSIGN_OR_RETURN(Cell cell, LoadCell(options.cell, options.database));
  if (options.robot_image_memory) cell.server.robot_image_memory = options.robot_image_memory;
  if (!options.preset.empty()) {
    const std::optional<Preset> preset = PresetFromName(options.preset);
    if (!preset) {
      return InvalidArgument("--preset ", options.preset,
                             ": there is no such preset; docs/concepts.md has them all");
    }
    cell.policy.preset = *preset;
    cell.choose_preset = false;
  }
  ASSIGN_OR_RETURN(auto database, LoadDatabase(cell, options.unverified));
  RETURN_IF_ERROR(MarginsKnown(cell, *database));
  signals.Loaded();
  ServingSettings settings;
  settings.policy = cell.policy;
  settings.choose_preset = cell.choose_preset;
  settings.scene = cell.server.scene;
  settings.segmentation = cell.segmentation;
  settings.joint_slides = cell.joint_slides;
  ASSIGN_OR_RETURN(const auto replay, Replay::Open(options.replay, std::move(database), settings));
  if (const std::string& damage = replay->summary().damage; !damage.empty()) {
    spdlog::warn("{}", damage);
  }
  ASSIGN_OR_RETURN(const auto page, CellPage::Start(options.page, options.insecure, *replay));
  std::cout << "recording at http://" << page->address() << "/" << std::endl;
  sd_notify(0, "READY=1");
  signals.AwaitEnd();  // a recording stays as it is
  return absl::OkStatus();
}

// What the cell file and the command line state. `check`: of the calibration.
ServingSettings SettingsOf(const Cell& cell, const Options& options,
                           const CalibrationWatchSettings& check) {
  ServingSettings settings;
  settings.policy = cell.policy;
  settings.choose_preset = cell.choose_preset;
  settings.scene = cell.server.scene;
  settings.map_time = cell.server.map_time;
  settings.limits = cell.server.limits;
  settings.index_check = cell.server.index_check;
  settings.segmentation = cell.segmentation;
  settings.joint_slides = cell.joint_slides;
  settings.without_noise = LiveConfigOf(cell).without_noise;
  settings.worker_threads = static_cast<int>(std::max(2u, std::thread::hardware_concurrency()));
  if (!check.file.empty()) {
    settings.trust = std::make_shared<const CalibrationTrust>(ReadTrust(check, SystemClock()));
  }
  settings.metrics = options.metrics.empty() ? cell.server.metrics : options.metrics;
  if (options.live) settings.live = NewLiveRecord(cell);
  settings.gate = cell.server.gate;
  return settings;
}

absl::Status Serve(const Options& options, Signals& signals) {
  ASSIGN_OR_RETURN(Cell cell, LoadCell(options.cell, options.database));
  FileHashes files = HashesOf(cell);
  if (options.robot_image_memory) cell.server.robot_image_memory = options.robot_image_memory;
  const std::string listen = options.listen.empty() ? cell.server.listen : options.listen;
  cell.server.gate.insecure = options.insecure;
  RETURN_IF_ERROR(CheckListenAddress(listen));
  RETURN_IF_ERROR(CheckGate(listen, cell.server.gate));
  // What can be wrong is said before the database is loaded, which may take minutes.
  if (cell.server.gate.tls) RETURN_IF_ERROR(ReadTls(*cell.server.gate.tls).status());
  std::optional<CellOpeners> devices;
  if (options.live) {
    ASSIGN_OR_RETURN(devices, LiveDevicesOf(cell, options.obstacles));
    WarnOfSources(cell);
  }
  ASSIGN_OR_RETURN(auto database, LoadDatabase(cell, options.unverified));
  RETURN_IF_ERROR(MarginsKnown(cell, *database));
  signals.Loaded();

  AskForDescriptors(cell.server.limits);
  const CalibrationWatchSettings check{.file = options.calibration_check.empty()
                                                   ? cell.server.calibration_check
                                                   : options.calibration_check,
                                       .max_age = cell.server.calibration_check_max_age};
  ServingSettings settings = SettingsOf(cell, options, check);
  const std::shared_ptr<LiveRecord> live_record = settings.live;
  if (!cell.server.audit.empty()) {
    ASSIGN_OR_RETURN(settings.audit, AuditLog::Open(cell.server.audit));
  }
  ASSIGN_OR_RETURN(std::unique_ptr<Server> server,
                   Server::Start(listen, std::move(database), std::move(settings)));
  std::optional<CalibrationWatch> calibration_watch;
  if (!check.file.empty()) {
    calibration_watch.emplace(check, SystemClock,
                              [&server](auto trust) { server->SetTrust(std::move(trust)); });
  }
  std::unique_ptr<CellPage> page;
  if (!options.page.empty()) {
    const auto role = options.page_role.empty() ? std::nullopt : std::optional(Role::kOperator);
    ASSIGN_OR_RETURN(page,
                     CellPage::Start(options.page, options.insecure, server->serving(), role));
  }
  std::unique_ptr<LiveLoop> live;
  if (options.live) {
    ASSIGN_OR_RETURN(live, StartLive(cell, *std::move(devices), live_record, *server));
  }
  std::cout << "listening on " << server->address() << std::endl;
  spdlog::info("serving cell '{}' on {}", cell.name, server->address());
  if (!server->metrics_address().empty()) {
    spdlog::info("metrics at http://{}/metrics", server->metrics_address());
  }
  if (page != nullptr) spdlog::info("page at http://{}/", page->address());

  sd_notify(0, "READY=1");
  const auto reloader =
      std::make_shared<Reloader>(cell, std::move(files), options.unverified, *server);
  const std::future<void> reloads = Reloader::Start(reloader, signals);
  {
    const std::jthread life([&server](const std::stop_token& stop) { ShowLife(stop, *server); });
    signals.AwaitEnd();
  }
  reloader->Leave();
  sd_notify(0, "STOPPING=1");
  spdlog::info("stopping; calls in flight may take {} more", SpokenTime(kGrace));
  page.reset();
  server->Stop(kGrace);
  live.reset();  // last: it waits for a camera that is silent
  spdlog::info("stopped");
  if (reloads.wait_for(std::chrono::milliseconds(100)) == std::future_status::ready) {
    return absl::OkStatus();
  }
  // The thread still uses what the program's end would destroy. All that must be written is.
  calibration_watch.reset();
  server.reset();
  std::_Exit(kDone);
}

int Main(int argc, char** argv) {
  setenv("GRPC_VERBOSITY", "NONE", /*overwrite=*/0);
  static Signals& signals = *new Signals;
  spdlog::set_default_logger(spdlog::stderr_logger_mt(kName));
  spdlog::set_formatter(LineFormatter());

  CLI::App app("Serves a cell: verdicts on robot configurations from the newest scene.", kName);
  Options options;
  app.add_option("--cell", options.cell, "The cell file")->required();
  app.add_option("--database", options.database,
                 "The folder of the database; default: as in the cell file");
  app.add_option("--listen", options.listen,
                 "host:port (port 0: any free one) or unix:path; default: as in the cell file");
  app.add_option(
         "--robot-image-memory", options.robot_image_memory,
         "Most memory for robot images, e.g. 8GB. If the database has more, they stay in the\n"
         "database and are read when needed. Default: as in the cell file")
      ->transform(ByteSize())
      ->option_text("SIZE");
  app.add_option(
      "--calibration-check", options.calibration_check,
      "Result file of 'silhouette-calibrate check --out', watched for changes. If it does not\n"
      "confirm the calibration, presets that need one return UNKNOWN.\n"
      "Default: as in the cell file, else the calibration is trusted");
  app.add_flag("--live", options.live,
               "Acquire images and joint values directly from the cell's devices.\n"
               "Disables PublishScene");
  app.add_flag("--insecure", options.insecure,
               "Speak plain text also on addresses that other machines reach: everyone there can\n"
               "publish scenes and change what is free");
  app.add_flag("--unverified", options.unverified,
               "Serve robot images that are drawn from a model that captured images have not\n"
               "verified. Every answer says so");
  app.add_option(
      "--metrics", options.metrics,
      "host:port where metrics are served to Prometheus, at /metrics; default: as in the "
      "cell file, else nowhere");
  app.add_option(
      "--page", options.page,
      "host:port of a page that shows the cell in a browser: views, configuration space,\n"
      "watched paths; default: none. Other addresses than this machine's need --insecure");
  app.add_option(
         "--page-role", options.page_role,
         "operator: everyone who opens the page may allow and revoke regions, in which obstacles\n"
         "are not seen; only for a page of this machine alone. Default: the page is read-only")
      ->check(CLI::IsMember({NameOf(Role::kOperator)}))
      ->needs("--page");
  CLI::Option* replay = app.add_option(
      "--replay", options.replay,
      "An MCAP file of silhouette-record: the page shows its moments, and nothing else is opened.\n"
      "No planner gets an answer. Needs --page; without --live and --listen");
  replay->excludes("--page-role");
  app.add_option("--preset", options.preset,
                 "With --replay: what the map rests on; default: as in the cell file")
      ->needs(replay);
  app.add_option("--simulated-obstacles", options.obstacles,
                 "With --live and a simulated cell: the file of its obstacles")
      ->needs("--live");
  app.footer(
      "Prints one line to stdout, 'listening on ADDRESS', when it is ready; its log goes to\n"
      "stderr. SIGTERM and Ctrl-C let the calls in flight finish, for at most a second, and end "
      "the\n"
      "program within two, with exit code 3 if something but a reload hangs; SIGHUP reads the\n"
      "database again.\n"
      "Without 'server: tls' in the cell file everyone who reaches the address may do everything;\n"
      "an address that other machines reach then needs --insecure.\n"
      "Under systemd it reports when it is ready, and to the watchdog that it still takes "
      "scenes.\n\n"
      "Example:\n"
      "  silhouette-server --cell cell.yaml --database cell.lmdb --listen 127.0.0.1:50051\n"
      "  silhouette-server --cell cell.yaml --live --page 127.0.0.1:8080\n"
      "  silhouette-server --cell cell.yaml --replay recordings/stop-20260131T120000.123Z.mcap "
      "--page 127.0.0.1:8080");
  const Work serve = [&options]() -> absl::StatusOr<ExitCode> {
    RETURN_IF_ERROR(options.replay.empty() ? Serve(options, signals)
                                           : ShowRecording(options, signals));
    return kDone;
  };
  return RunProgram(app, argc, argv, serve);
}

}  // namespace
}  // namespace silhouette

int main(int argc, char** argv) { return silhouette::Main(argc, argv); }
