// silhouette-capture run: captures what is missing, or is to be captured anew.
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "absl/strings/str_cat.h"
#include "capture/capture_session.h"
#include "capture/open_devices/cell_devices.h"
#include "capture/program/commands.h"
#include "capture/program/opened_cell.h"
#include "capture/program/report.h"
#include "db/collision_index.h"
#include "db/outliers.h"
#include "tools/program/progress.h"

namespace silhouette {
namespace {

struct Options {
  CellArguments cell;
  std::string only = "missing";
  bool dry_run = false;
  bool exclude_captured = false;
  bool no_index = false;
};

// Robot images that a new capture may mend: one that touches the border stays as it is.
absl::StatusOr<std::vector<ConfigurationNumber>> Outliers(const Database& database) {
  const auto snapshot = database.Read();
  if (!snapshot.ok()) return snapshot.status();
  const auto outliers = FindOutliers(*snapshot, database.grid());
  if (!outliers.ok()) return outliers.status();
  std::set<ConfigurationNumber> numbers;
  for (const Outlier& outlier : *outliers) {
    if (outlier.reason != OutlierReason::kTouchesBorder) numbers.insert(outlier.number);
  }
  return std::vector<ConfigurationNumber>(numbers.begin(), numbers.end());
}

// `database` may be null: there is none yet.
absl::StatusOr<CapturePlan> MakePlan(const Options& options, const Cell& cell, const Travel& travel,
                                     const Database* database) {
  CaptureSelection selection{.exclude_captured = options.exclude_captured};
  std::vector<StoredRecord> records = NoRecords(travel.grid());
  if (options.only == "all") selection.kind = CaptureSelection::Kind::kAll;
  if (database != nullptr) {
    auto stored = ReadRecords(*database);
    if (!stored.ok()) return stored.status();
    records = *std::move(stored);
  }
  if (options.only == "outliers" && database != nullptr) {
    auto outliers = Outliers(*database);
    if (!outliers.ok()) return outliers.status();
    selection.kind = CaptureSelection::Kind::kListed;
    selection.listed = *std::move(outliers);
  }
  auto plan = PlanCapture(DescriptionOf(cell), travel, records, cell.capture, selection);
  if (absl::IsFailedPrecondition(plan.status())) {
    return absl::FailedPreconditionError(absl::StrCat(
        plan.status().message(), "; change the region, or drop these robot images and have the ",
        "configurations excluded: ", options.cell.Command("run"), " --exclude-captured"));
  }
  return plan;
}

// Bytes that are free where the folder is, or will be.
std::optional<uint64_t> AvailableBytes(std::filesystem::path folder) {
  std::error_code error;
  folder = std::filesystem::absolute(folder, error);
  while (!std::filesystem::exists(folder, error) && folder.has_relative_path()) {
    folder = folder.parent_path();
  }
  const auto space = std::filesystem::space(folder, error);
  if (error) return std::nullopt;
  return space.available;
}

absl::StatusOr<ExitCode> DryRun(const Options& options, const CellFile& file,
                                const Travel& travel) {
  const auto database = OpenDatabase(file, Database::Access::kRead);
  if (!database.ok() && !absl::IsNotFound(database.status())) return database.status();
  const auto plan = MakePlan(options, file.cell, travel, database.ok() ? database->get() : nullptr);
  if (!plan.ok()) return plan.status();
  const std::optional<uint64_t> available = AvailableBytes(file.database);
  if (options.cell.json()) {
    std::cout << PlanJson(*plan, available).dump(2) << std::endl;
  } else {
    std::cout << PlanText(*plan, available) << "nothing was moved or stored" << std::endl;
  }
  return kDone;
}

CaptureReport CaptureWithProgress(CaptureSession& session, const CapturePlan& plan) {
  CatchStopSignals();
  std::optional<Progress> progress;
  if (!plan.captures.empty()) progress.emplace("capturing", plan.captures.size(), "configurations");
  CaptureObserver observer;
  observer.progress = [&](uint64_t done) { progress->Update(done); };
  observer.say = [&](const std::string& line) {
    progress ? progress->Say(line) : void(std::cerr << line << std::endl);
  };
  observer.stop_requested = StopRequested;
  return session.Run(plan, "silhouette-capture run", observer);
}

// The collision index of what is stored. Nothing if it is not wanted, or the capture was ended:
// then going on builds it.
std::optional<absl::StatusOr<IndexBuildReport>> BuildIndex(const Options& options,
                                                           const CaptureReport& report,
                                                           Database& database) {
  if (options.no_index || !report.status.ok() || report.stopped) return std::nullopt;
  std::optional<Progress> progress;
  const auto tell = [&](uint64_t done, uint64_t tiles) {
    if (!progress && tiles > 0) progress.emplace("collision index", tiles, "tiles");
    if (progress) progress->Update(done);
    return !StopRequested();
  };
  return BuildCollisionIndex(database, {.progress = tell});
}

// Says how to go on if the index is not complete.
ExitCode TellIndex(const absl::StatusOr<IndexBuildReport>& index, const std::string& database) {
  if (index.ok() && !index->stopped) return kDone;
  const ExitCode code = index.ok() ? kNo : Report("silhouette-capture", index.status());
  std::cerr << "the robot images are stored, but their collision index is not complete; go on with:"
            << " silhouette-db index " << database << std::endl;
  return code;
}

// Prints the report, what went wrong and how to go on.
ExitCode Tell(const Options& options, const std::string& database, const CaptureReport& report,
              const std::optional<absl::StatusOr<IndexBuildReport>>& index) {
  std::string again = options.cell.Command("run");
  if (options.only != "missing") absl::StrAppend(&again, " --only ", options.only);
  const char* from_the_first = options.only == "all" ? " (begins with the first again)" : "";
  if (options.cell.json()) {
    nlohmann::json json = ReportJson(report);
    if (!report.complete()) json["next"] = again;
    if (index && index->ok()) json["collision_index"] = IndexJson(**index);
    std::cout << json.dump(2) << std::endl;
  } else {
    std::cout << ReportText(report);
    if (index && index->ok()) std::cout << IndexText(**index);
    std::cout << std::flush;
  }
  const uint64_t left = report.planned - report.captured;
  if (!report.status.ok()) {
    const ExitCode code = Report("silhouette-capture", report.status);
    std::cerr << "what was captured is stored; go on with: " << again << from_the_first
              << std::endl;
    return code;
  }
  if (report.stopped) {
    std::cerr << "stopped, " << left << " configurations are left; go on with: " << again
              << from_the_first << std::endl;
    return kNo;
  }
  const ExitCode index_code = index ? TellIndex(*index, database) : kDone;
  if (!report.complete()) {
    std::cerr << left << " configurations could not be captured; try them again with: "
              << options.cell.Command("run") << std::endl;
    return index_code == kDone ? kNo : index_code;
  }
  return index_code;
}

absl::StatusOr<ExitCode> Run(const Options& options) {
  const absl::StatusOr<CellFile> file = OpenCellFile(options.cell);
  if (!file.ok()) return file.status();
  const Travel travel(file->cell.grid, file->cell.capture.forbidden_regions);
  if (options.dry_run) return DryRun(options, *file, travel);

  const auto devices = OpenDevices(file->cell, travel);
  if (!devices.ok()) return devices.status();
  const std::string take_references =
      absl::StrCat("; take them first with: ", options.cell.Command("reference"));
  const auto database = OpenDatabase(*file, Database::Access::kWrite);
  if (absl::IsNotFound(database.status())) {
    return absl::NotFoundError(absl::StrCat("there is no database in '", file->database,
                                            "' yet, and no reference images of the empty cell",
                                            take_references));
  }
  if (!database.ok()) return database.status();
  auto session = CaptureSession::Create(**database, travel, *devices->robot, *devices->cameras,
                                        file->cell.capture, file->cell.segmentation);
  if (absl::IsNotFound(session.status())) {
    return absl::NotFoundError(absl::StrCat(session.status().message(), take_references));
  }
  if (!session.ok()) return session.status();
  const auto plan = MakePlan(options, file->cell, travel, database->get());
  if (!plan.ok()) return plan.status();
  const CaptureReport report = CaptureWithProgress(*session, *plan);
  return Tell(options, file->database, report, BuildIndex(options, report, **database));
}

}  // namespace

void AddRun(CLI::App& app, Work& work) {
  CLI::App* command = app.add_subcommand(
      "run",
      "Drives the robot through the configurations and stores its images. What is stored stays,\n"
      "whatever happens: the same command goes on where it ended. Builds the collision index at "
      "the\n"
      "end, as far as robot images are new.");
  command->footer(
      "Examples:\n"
      "  silhouette-capture run --cell cell.yaml --database cell.lmdb\n"
      "  silhouette-capture run --cell cell.yaml --only outliers\n"
      "Exit codes: 0 all is captured; 1 stopped, or some configurations could not be captured;\n"
      "2 a mistake in what was asked; 3 a device or the disk failed.");
  const auto options = std::make_shared<Options>();
  AddCellOptions(*command, options->cell);
  command
      ->add_option("--only", options->only,
                   "What is captured: missing; outliers: also, anew, what is damaged, empty or\n"
                   "unlike its neighbours; all: everything anew")
      ->check(CLI::IsMember({"missing", "outliers", "all"}))
      ->capture_default_str();
  command->add_flag("--dry-run", options->dry_run,
                    "Say how many configurations, how long, how much room; move nothing");
  command->add_flag("--exclude-captured", options->exclude_captured,
                    "Drop robot images in regions that are forbidden by now");
  command->add_flag("--no-index", options->no_index,
                    "Leave the collision index out; silhouette-db index builds it");
  command->callback([options, &work] { work = [options] { return Run(*options); }; });
}

}  // namespace silhouette
