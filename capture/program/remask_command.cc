// silhouette-capture remask: makes the masks anew from the images that were kept.
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "capture/program/commands.h"
#include "capture/program/opened_cell.h"
#include "capture/session/remask.h"
#include "db/collision_index.h"
#include "tools/program/progress.h"

namespace silhouette {
namespace {

constexpr char kProgram[] = "silhouette-capture remask";

struct Options {
  CellArguments cell;
  std::string into;
  bool leave_out = false;
  bool no_index = false;
};

// The database, if it is that of the cell but for the settings of masks; with `into`, also but for
// their sizes.
absl::StatusOr<std::unique_ptr<Database>> Open(const CellFile& file, bool into) {
  auto database =
      Database::Open(file.database, into ? Database::Access::kRead : Database::Access::kWrite);
  if (!database.ok()) return database.status();
  storage::v1::CellDescription wanted = DescriptionOf(file.cell);
  wanted.set_segmentation("");
  const storage::v1::CellDescription& stored = (*database)->cell();
  for (int v = 0; into && v < std::min(wanted.views_size(), stored.views_size()); ++v) {
    wanted.mutable_views(v)->set_mask_width(stored.views(v).mask_width());
    wanted.mutable_views(v)->set_mask_height(stored.views(v).mask_height());
  }
  const auto differences = Differences(wanted, "the cell file", stored, "the database");
  if (differences.empty()) return database;
  return absl::FailedPreconditionError(
      absl::StrCat("the database '", file.database, "' does not belong to the cell of '",
                   file.cell.file, "': ", absl::StrJoin(differences, "; "),
                   into ? "" : ". Masks of another size go into another database: --into FOLDER"));
}

absl::StatusOr<Remasked> MakeMasks(const Options& options, const CellFile& file,
                                   const Database& database) {
  RemaskOptions remask;
  remask.segmentation = file.cell.segmentation;
  for (const ViewSettings& view : file.cell.views) remask.mask_sizes.push_back(view.mask_size);
  remask.leave_out = options.leave_out;
  remask.threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  std::optional<Progress> progress;
  remask.progress = [&](uint64_t done, uint64_t total) {
    if (!progress && total > 0) progress.emplace("masks", total, "configurations");
    if (progress) progress->Update(done);
    return !StopRequested();
  };
  auto made = Remask(database, remask);
  if (absl::IsFailedPrecondition(made.status())) {
    return absl::FailedPreconditionError(
        absl::StrCat(made.status().message(),
                     "; images are kept with 'raw_images: all' of 'capture' in the cell file. Put "
                     "those that can "
                     "be made into another database: --into FOLDER --leave-out"));
  }
  return made;
}

absl::Status BuildIndex(const Options& options, Database& database) {
  if (options.no_index) return absl::OkStatus();
  return BuildCollisionIndex(database).status();
}

// A new database beside the place where it will be, and there once it is whole.
absl::Status WriteInto(const Options& options, const CellFile& file, const Database& source,
                       const Remasked& made) {
  const std::string part = options.into + ".part";
  std::error_code error;
  std::filesystem::remove_all(part, error);
  auto database = Database::Create(part, DescriptionOf(file.cell));
  if (!database.ok()) return database.status();
  const auto references = source.Read()->References();
  if (!references.ok()) return references.status();
  if (references->has_value()) {
    absl::Status status = (*database)->SetReferences(**references, kProgram);
    if (!status.ok()) return status;
  }
  {
    auto writer = (*database)->Write(kProgram);
    if (!writer.ok()) return writer.status();
    for (const RobotImage& image : made.images) {
      if (absl::Status status = writer->Put(image, true); !status.ok()) return status;
    }
    if (absl::Status status = writer->Commit(); !status.ok()) return status;
  }
  if (absl::Status status = BuildIndex(options, **database); !status.ok()) return status;
  database->reset();
  std::filesystem::rename(part, options.into, error);
  if (!error) return absl::OkStatus();
  return absl::InternalError(
      absl::StrCat("'", part, "' cannot be renamed to '", options.into, "': ", error.message()));
}

void PrintText(const std::string& where, const Remasked& made) {
  std::cout << absl::StreamFormat("masks made anew    %d configurations, in %s\n",
                                  made.images.size() - made.excluded, where);
  if (made.excluded > 0) std::cout << absl::StreamFormat("excluded           %d\n", made.excluded);
  if (made.left_out > 0) {
    std::cout << absl::StreamFormat("left out           %d, without raw images\n", made.left_out);
  }
  std::cout << "view                masks changed   pixels before        added      removed\n";
  for (const ViewChange& view : made.views) {
    std::cout << absl::StreamFormat("  %-16s  %13d   %13d   %10d   %10d\n", view.name, view.images,
                                    view.before, view.added, view.removed);
  }
  std::cout << std::flush;
}

void PrintJson(const std::string& where, const Remasked& made) {
  nlohmann::json json = {{"database", where},
                         {"configurations", made.images.size() - made.excluded},
                         {"excluded", made.excluded},
                         {"left_out", made.left_out},
                         {"views", nlohmann::json::array()}};
  for (const ViewChange& view : made.views) {
    json["views"].push_back({{"name", view.name},
                             {"masks_changed", view.images},
                             {"pixels_before", view.before},
                             {"pixels_added", view.added},
                             {"pixels_removed", view.removed}});
  }
  std::cout << json.dump(2) << std::endl;
}

absl::StatusOr<ExitCode> Run(const Options& options) {
  const absl::StatusOr<CellFile> file = OpenCellFile(options.cell);
  if (!file.ok()) return file.status();
  const bool into = !options.into.empty();
  if (options.leave_out && !into) {
    return absl::InvalidArgumentError(
        "--leave-out goes with --into: robot images are not dropped from where they are");
  }
  if (into && std::filesystem::exists(options.into)) {
    return absl::AlreadyExistsError(
        absl::StrCat("there is '", options.into, "' already; name a new folder"));
  }
  const auto database = Open(*file, into);
  if (!database.ok()) return database.status();
  CatchStopSignals();
  const auto made = MakeMasks(options, *file, **database);
  if (absl::IsCancelled(made.status())) {
    std::cerr << made.status().message() << std::endl;
    return kNo;
  }
  if (!made.ok()) return made.status();
  absl::Status status;
  if (into) {
    status = WriteInto(options, *file, **database, *made);
  } else {
    std::vector<RobotImage> images;
    for (const RobotImage& image : made->images) {
      if (!image.excluded) images.push_back(image);
    }
    status = (*database)->ReplaceMasks(Describe(file->cell.segmentation), images, kProgram);
    if (status.ok()) status = BuildIndex(options, **database);
  }
  if (!status.ok()) return status;
  const std::string& where = into ? options.into : file->database;
  options.cell.json() ? PrintJson(where, *made) : PrintText(where, *made);
  return kDone;
}

}  // namespace

void AddRemask(CLI::App& app, Work& work) {
  CLI::App* command = app.add_subcommand(
      "remask",
      "Makes all masks anew from the camera images that were kept (capture: {raw_images: all}), "
      "with\n"
      "the segmentation settings of the cell file; the robot does not move. All masks change at "
      "once,\n"
      "or none: stopped or killed, it leaves the database as it was. Says how many pixels "
      "changed.");
  command->footer(
      "Examples:\n"
      "  silhouette-capture remask --cell cell.yaml --database cell.lmdb\n"
      "  silhouette-capture remask --cell finer.yaml --database cell.lmdb --into finer.lmdb\n"
      "Exit codes: 0 done; 1 stopped; 2 a mistake in what was asked; 3 the disk failed.");
  const auto options = std::make_shared<Options>();
  AddCellOptions(*command, options->cell);
  command->add_option(
      "--into", options->into,
      "A new folder for a database with the new masks; the other stays as it is. It "
      "gets\nno raw images. Masks may have another size there");
  command->add_flag("--leave-out", options->leave_out,
                    "With --into: leave out robot images that have no raw images");
  command->add_flag("--no-index", options->no_index,
                    "Leave the collision index out; silhouette-db index builds it");
  command->callback([options, &work] { work = [options] { return Run(*options); }; });
}

}  // namespace silhouette
