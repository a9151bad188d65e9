// SPDX-License-Identifier: Apache-2.0
// silhouette-db calibration: import, export, show and remove it.
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "calib/files/calibration_message.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "server/scene/scene_settings.h"
#include "tools/program/for_shell.h"
#include "tools/silhouette-db/calibration_files/calibration_files.h"
#include "tools/silhouette-db/calibration_files/tested_calibration.h"
#include "tools/silhouette-db/calibration_picture.h"
#include "tools/silhouette-db/calibration_report.h"
#include "tools/silhouette-db/commands.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

constexpr char kTakenUp[] = "a running silhouette-server takes it up on SIGHUP";

struct CalibrationOptions : DatabaseOptions {
  std::vector<std::string> inputs;
  std::string cell;  // file
  std::string out;
  bool force = false;
  double margin = CalibrationSettings{}.margin;
  std::string view;
  std::optional<ConfigurationNumber> number;
  std::vector<std::string> pixels;
};

std::string CalibrationKindOf(const storage::v1::Calibration& calibration) {
  if (calibration.cameras_size() > 0) {
    return absl::StrCat(calibration.cameras_size(), " camera models");
  }
  return absl::StrCat(calibration.fundamental_matrices_size(), " fundamental matrices");
}

// The database of --cell, made if there is none and its robot images are drawn. A calibration that
// cannot be imported makes none.
absl::StatusOr<std::unique_ptr<Database>> OpenForImport(const CalibrationOptions& options) {
  if (options.cell.empty()) return Database::Open(options.database, Database::Access::kWrite);
  ASSIGN_OR_RETURN(const Cell cell, LoadCell(options.cell, options.database));
  auto database = OpenOfCell(options.database, cell);
  if (!absl::IsNotFound(database.status())) return database;
  if (!cell.robot.drawn) {
    return absl::InvalidArgumentError(
        absl::StrCat(database.status().message(), "; the robot images of '", options.cell,
                     "' are captured: make it with 'silhouette-capture reference' or "
                     "'silhouette-db import'"));
  }
  const storage::v1::CellDescription description = DescriptionOf(cell);
  ASSIGN_OR_RETURN(const auto stored, ReadCalibration(options.inputs, description));
  ASSIGN_OR_RETURN(const Calibration calibration, CalibrationFrom(stored));
  if (calibration.cameras.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("robot images of '", options.cell,
                     "' can be drawn only with camera models, not with fundamental matrices"));
  }
  RETURN_IF_ERROR(CheckLines(calibration, description));
  return Database::Create(options.database, description);
}

// The command that draws the stored robot images again; empty: none are drawn.
absl::StatusOr<std::string> DrawAgainCommand(const CalibrationOptions& options,
                                             const Database& database) {
  ASSIGN_OR_RETURN(const auto drawn, DrawnByVariant(database));
  if (drawn.empty()) return std::string();
  return absl::StrCat("silhouette-capture draw --cell ",
                      options.cell.empty() ? "CELL" : ForShell(options.cell),
                      " --database NEW --from ", ForShell(options.database));
}

// What import did. `tested`: by the robot images. `next`: a command, or empty.
void PrintImported(const CalibrationOptions& options, const storage::v1::Calibration& calibration,
                   const Contradictions& tested, uint64_t generation, bool is_new,
                   const std::string& next, const std::string& text) {
  const PairContradictions* worst = tested.worst();
  const nlohmann::ordered_json share =
      worst == nullptr ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(worst->share());
  const nlohmann::ordered_json json = {
      {"database", options.database},
      {"generation", generation},
      {"kind", calibration.cameras_size() > 0 ? "cameras" : "fundamental matrices"},
      {"cameras", calibration.cameras_size()},
      {"fundamental_matrices", calibration.fundamental_matrices_size()},
      {"changed", is_new},
      {"configurations", tested.configurations},
      {"worst_contradicting_share", share},
      {"warnings", nlohmann::ordered_json(calibration.record().warnings())},
      {"next", next}};
  std::string warnings;
  for (const std::string& warning : calibration.record().warnings()) {
    absl::StrAppend(&warnings, "warning: ", warning, "\n");
  }
  PrintResult(options.format, json, text + warnings);
}

absl::StatusOr<ExitCode> CalibrationImport(const CalibrationOptions& options) {
  CatchStopSignals();
  ASSIGN_OR_RETURN(const std::unique_ptr<Database> opened, OpenForImport(options));
  Database& database = *opened;
  ASSIGN_OR_RETURN(const auto calibration, ReadCalibration(options.inputs, database.cell()));
  Contradictions contradictions;
  {
    ASSIGN_OR_RETURN(const Snapshot snapshot, database.Read());
    ASSIGN_OR_RETURN(auto tested, TestCalibration(database, snapshot, calibration, options.margin));
    contradictions = std::move(tested.contradictions);
    const absl::Status fits = CheckContradictions(contradictions, database.cell());
    if (!fits.ok() && !options.force) {
      return absl::Status(fits.code(),
                          absl::StrCat(fits.message(), " --force imports it all the same"));
    }
    // A damaged one is replaced like any other.
    const auto stored = snapshot.Calibration();
    if (stored.ok() && *stored &&
        (*stored)->SerializeAsString() == calibration.SerializeAsString()) {
      PrintImported(options, calibration, contradictions, snapshot.generation(), false, "",
                    "the database has this calibration already; nothing is changed\n");
      return kDone;
    }
  }
  RETURN_IF_ERROR(database.SetCalibration(
      calibration,
      absl::StrCat("silhouette-db calibration import ", absl::StrJoin(options.inputs, " "))));
  ASSIGN_OR_RETURN(const Snapshot snapshot, database.Read());
  ASSIGN_OR_RETURN(const std::string next, DrawAgainCommand(options, database));
  std::string text =
      absl::StrCat(CalibrationKindOf(calibration), " imported, generation ", snapshot.generation(),
                   "; ", ContradictionText(contradictions, database.cell()), "\n", kTakenUp, "\n");
  if (!next.empty()) {
    absl::StrAppend(&text,
                    "the server uses only robot images that were drawn from this calibration; "
                    "verify the model again, then draw them: ",
                    next, "\n");
  }
  PrintImported(options, calibration, contradictions, snapshot.generation(), true, next, text);
  return kDone;
}

absl::StatusOr<ExitCode> Remove(const CalibrationOptions& options) {
  ASSIGN_OR_RETURN(const std::unique_ptr<Database> database,
                   Database::Open(options.database, Database::Access::kWrite));
  RETURN_IF_ERROR(database->RemoveCalibration("silhouette-db calibration remove"));
  std::cout << "the calibration is removed\n" << kTakenUp << std::endl;
  return kDone;
}

// The calibration of a database; nothing, and said so, if it has none.
absl::StatusOr<std::optional<storage::v1::Calibration>> Stored(const OpenedDatabase& opened) {
  auto stored = opened.snapshot.Calibration();
  if (stored.ok() && !*stored) {
    std::cerr << "silhouette-db: '" << opened.database->path()
              << "' has no calibration; import one with 'silhouette-db calibration import'"
              << std::endl;
  }
  return stored;
}

absl::StatusOr<ExitCode> CalibrationExport(const CalibrationOptions& options) {
  ASSIGN_OR_RETURN(const OpenedDatabase opened, OpenForReading(options.database));
  ASSIGN_OR_RETURN(const auto stored, Stored(opened));
  if (!stored) return kNo;
  ASSIGN_OR_RETURN(const auto paths,
                   WriteCalibration(*stored, opened.database->cell(), options.out));
  PrintResult(options.format, {{"database", options.database}, {"files", paths}},
              absl::StrCat("wrote ", absl::StrJoin(paths, "\nwrote "), "\n"));
  return kDone;
}

absl::StatusOr<std::vector<MaskPixel>> PixelsOf(const std::vector<std::string>& texts,
                                                MaskSize size) {
  if (texts.size() > kMostPixels) {
    return absl::InvalidArgumentError(
        absl::StrCat("a picture shows at most ", kMostPixels, " pixels; give fewer"));
  }
  std::vector<MaskPixel> pixels;
  for (const std::string& text : texts) {
    const std::vector<std::string> parts = absl::StrSplit(text, ',');
    MaskPixel pixel;
    if (parts.size() != 2 || !absl::SimpleAtoi(parts[0], &pixel.x) ||
        !absl::SimpleAtoi(parts[1], &pixel.y) || pixel.x < 0 || pixel.x >= size.width ||
        pixel.y < 0 || pixel.y >= size.height) {
      return absl::InvalidArgumentError(absl::StrCat("'", text, "' is not X,Y of a mask of ",
                                                     size.width, "x", size.height, " pixels"));
    }
    pixels.push_back(pixel);
  }
  return pixels;
}

// The configuration that the picture shows: the asked one, else the one that contradicts most
// pixels of the view, else any in which the robot is seen.
absl::StatusOr<RobotImage> RobotToShow(const OpenedDatabase& opened,
                                       const CalibrationOptions& options,
                                       const TestedCalibration& tested, int view) {
  std::vector<ConfigurationNumber> candidates;
  uint64_t most = 0;
  for (const PairContradictions& pair : tested.contradictions.pairs) {
    if (pair.view != view || pair.worst_contradicting <= most) continue;
    candidates = {*pair.worst};
    most = pair.worst_contradicting;
  }
  candidates.insert(candidates.end(), tested.samples.begin(), tested.samples.end());
  if (options.number) candidates = {*options.number};
  for (const ConfigurationNumber number : candidates) {
    ASSIGN_OR_RETURN(const auto image, opened.snapshot.Find(number));
    if (!image || image->excluded) continue;
    if (options.number || !image->masks[static_cast<size_t>(view)].Empty()) return *image;
  }
  return absl::NotFoundError(options.number
                                 ? absl::StrCat("configuration ", *options.number,
                                                " has no robot images to draw bands over")
                                 : "the database has no robot images to draw bands over");
}

absl::Status WritePicture(const OpenedDatabase& opened, const CalibrationOptions& options,
                          const TestedCalibration& tested) {
  ASSIGN_OR_RETURN(const int view, ViewOf(opened.database->cell(), options.view));
  const MaskSize size = opened.database->mask_sizes()[static_cast<size_t>(view)];
  ASSIGN_OR_RETURN(std::vector<MaskPixel> pixels, PixelsOf(options.pixels, size));
  ASSIGN_OR_RETURN(const RobotImage robot, RobotToShow(opened, options, tested, view));
  if (pixels.empty()) pixels = PixelsToShow(robot.masks, tested.bands, view);
  BandsPicture picture{.database = *opened.database,
                       .bands = tested.bands,
                       .number = robot.number,
                       .robot = robot.masks,
                       .union_of_all = robot.masks,
                       .view = view,
                       .pixels = std::move(pixels)};
  for (const ConfigurationNumber number : tested.samples) {
    const auto image = opened.snapshot.Find(number);
    if (!image.ok() || !*image) continue;
    for (size_t i = 0; i < picture.union_of_all.size(); ++i) {
      picture.union_of_all[i] = picture.union_of_all[i] | (*image)->masks[i];
    }
  }
  return WritePng(options.picture, Paint(picture));
}

absl::StatusOr<ExitCode> CalibrationShow(const CalibrationOptions& options) {
  CatchStopSignals();
  ASSIGN_OR_RETURN(const OpenedDatabase opened, OpenForReading(options.database));
  ASSIGN_OR_RETURN(const auto stored, Stored(opened));
  if (!stored) return kNo;
  ASSIGN_OR_RETURN(const auto tested,
                   TestCalibration(*opened.database, opened.snapshot, *stored, options.margin));
  if (!options.picture.empty()) {
    RETURN_IF_ERROR(WritePicture(opened, options, tested));
  }
  const CalibrationReport report{.database = *opened.database,
                                 .generation = opened.snapshot.generation(),
                                 .calibration = tested.calibration,
                                 .record = stored->record(),
                                 .margin = options.margin,
                                 .contradictions = tested.contradictions};
  Print(report, options.format);
  return kDone;
}

void AddMargin(CLI::App& command, CalibrationOptions& options) {
  command
      .add_option("--margin", options.margin,
                  "Mask pixels by which pixels are widened, as in the cell file's 'calibration'")
      ->check(NumberFromZero())
      ->capture_default_str();
}

void AddImportTo(CLI::App& parent, Work& work) {
  auto [command, options] =
      AddCommand(parent, work, "import", "Imports a calibration", CalibrationImport);
  command
      .add_option("files", options.inputs,
                  "A folder of camera models, or one per view: FILE, named VIEW.cameramodel, or "
                  "VIEW=FILE; or one YAML file: calibration.yaml, or fundamental matrices")
      ->required();
  command.add_option("--cell", options.cell,
                     "The cell file: makes the database if it is missing and robot images are "
                     "drawn");
  command.add_flag("--force", options.force, "Import it even if it contradicts the robot images");
  AddMargin(command, options);
  AddFormatOption(command, options.format);
  command.footer(
      "Camera models are in the format of mrcal, for the view's camera images, in the robot's "
      "base\n"
      "frame. A file of fundamental matrices is a list of {view_a: NAME, view_b: NAME, F: [[3 "
      "numbers] * 3]}\n"
      "with x_b' F x_a = 0 in mask pixels, integers at pixel centres.\n"
      "Examples:\n"
      "  silhouette-db calibration import cell.lmdb cameras/calibration.yaml\n"
      "  silhouette-db calibration import cell.lmdb cameras/\n"
      "  silhouette-db calibration import cell.lmdb top=a.cameramodel left=b.cameramodel\n"
      "  silhouette-db calibration import cell.lmdb matrices.yaml\n"
      "  silhouette-db calibration import cell.lmdb cameras/ --cell cell.yaml");
}

void AddExportTo(CLI::App& parent, Work& work) {
  auto [command, options] =
      AddCommand(parent, work, "export", "Writes the files that import reads", CalibrationExport);
  command
      .add_option("out,--out", options.out,
                  "Folder for camera models, YAML file for fundamental matrices")
      ->required();
  AddFormatOption(command, options.format);
  command.footer("Example:\n  silhouette-db calibration export cell.lmdb cameras/");
}

void AddShowTo(CLI::App& parent, Work& work) {
  auto [command, options] = AddCommand(
      parent, work, "show",
      "Cameras, pairs of views, and how well the robot images agree with the calibration",
      CalibrationShow);
  CLI::Option* picture = AddPictureOption(
      command, options.picture, "Draw some pixels' bands in the other views into this PNG file");
  command.add_option("--view", options.view, "The view of these pixels; default: the first")
      ->needs(picture);
  command
      .add_option("--pixel", options.pixels,
                  "X,Y of a mask pixel, up to four; default: some of the robot's")
      ->take_all()
      ->needs(picture);
  command
      .add_option("--number", options.number,
                  "The configuration of the robot in the picture; default: the one that "
                  "contradicts the calibration most")
      ->needs(picture);
  AddMargin(command, options);
  AddFormatOption(command, options.format);
  command.footer(
      "A robot pixel contradicts if its band in another view shows nothing of the robot.\n"
      "Example:\n  silhouette-db calibration show cell.lmdb --view left --picture bands.png");
}

void AddRemoveTo(CLI::App& parent, Work& work) {
  auto [command, options] = AddCommand(parent, work, "remove", "Removes the calibration", Remove);
  command.footer("Example:\n  silhouette-db calibration remove cell.lmdb");
}

}  // namespace

void AddCalibration(CLI::App& app, Work& work) {
  CLI::App* command =
      app.add_subcommand("calibration", "Imports, exports, shows or removes the calibration");
  command->require_subcommand(1);
  AddImportTo(*command, work);
  AddExportTo(*command, work);
  AddShowTo(*command, work);
  AddRemoveTo(*command, work);
  command->footer("Example:\n  silhouette-db calibration import --help");
}

}  // namespace silhouette
