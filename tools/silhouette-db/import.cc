// SPDX-License-Identifier: Apache-2.0
// silhouette-db import: masks that another program made, or that export wrote.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <unordered_map>

#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "common/picture/files.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/cell/cell.h"
#include "tools/program/for_shell.h"
#include "tools/program/progress.h"
#include "tools/silhouette-db/commands.h"
#include "tools/silhouette-db/common.h"
#include "tools/silhouette-db/exchange.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
constexpr uint64_t kMostFaults = 20;

struct ImportOptions {
  std::string folder;
  std::string variant = schema::kDefaultVariant;
  std::string cell;
  std::string database;
  std::string format = "text";
  bool replace = false;
  bool robot_fills_view = false;
};

// The database of the cell, made if there is none.
absl::StatusOr<std::unique_ptr<Database>> OpenOrCreate(const std::string& path, const Cell& cell) {
  auto database = OpenOfCell(path, cell);
  if (absl::IsNotFound(database.status())) return Database::Create(path, DescriptionOf(cell));
  return database;
}

// Whether nothing was imported into a new database.
bool IsEmpty(const Database& database) {
  const auto usage = database.GetUsage();
  const auto snapshot = database.Read();
  if (!usage.ok() || !snapshot.ok()) return false;
  const auto references = snapshot->References();
  return references.ok() && !*references &&
         std::ranges::all_of(usage->variants, [](const Database::Usage::Variant& variant) {
           return variant.records == 0;
         });
}

// Other robot images must not pass for those that were drawn.
absl::Status CheckNotDrawn(const Database& database) {
  ASSIGN_OR_RETURN(const auto drawn, DrawnByVariant(database));
  if (drawn.empty()) return absl::OkStatus();
  return FailedPrecondition("the robot images in '", database.path(),
                            "' were drawn; import into another database");
}

// Reads row after row; what is wrong with one does not keep the others out. The first good one
// makes the variant if it is missing.
class Importer {
 public:
  // `program`: for the provenance log.
  Importer(std::string csv, Database& whole, const ImportOptions& options, std::string program)
      : csv_(std::move(csv)), whole_(whole), options_(options), program_(std::move(program)) {}

  uint64_t committed() const { return writer_ ? writer_->committed() : 0; }
  uint64_t there_already() const { return there_already_; }
  uint64_t faults() const { return faults_; }

  // Only what keeps all further rows out, too, is an error.
  absl::Status Take(const TableReader& table, const std::string& row, uint64_t line,
                    Progress& progress) {
    const absl::StatusOr<RobotImage> image = ReadRow(table, row, line);
    if (image.ok() && !writer_) RETURN_IF_ERROR(OpenVariant());
    const absl::Status status = image.ok() ? Store(*image) : image.status();
    const bool mistake = absl::IsInvalidArgument(status) || absl::IsNotFound(status) ||
                         absl::IsAlreadyExists(status) || absl::IsFailedPrecondition(status);
    if (!mistake) return status;
    progress.Say(absl::StrCat(csv_, ":", line, ": ", status.message()));
    ++faults_;
    return absl::OkStatus();
  }

  absl::Status Commit() { return writer_ ? writer_->Commit() : absl::OkStatus(); }

 private:
  absl::StatusOr<RobotImage> ReadRow(const TableReader& table, const std::string& row,
                                     uint64_t line) {
    ASSIGN_OR_RETURN(RobotImage image, table.Read(row));
    const auto [first, is_first] = lines_.emplace(image.number, line);
    if (is_first) return image;
    return InvalidArgument("the same configuration is in line ", first->second);
  }

  absl::Status OpenVariant() {
    auto opened = whole_.OpenVariant(options_.variant);
    if (absl::IsNotFound(opened.status())) {
      opened = whole_.CreateVariant(options_.variant, program_);
    }
    ASSIGN_OR_RETURN(database_, std::move(opened));
    ASSIGN_OR_RETURN(writer_, database_->Write(program_));
    return absl::OkStatus();
  }

  absl::Status Store(const RobotImage& image) {
    const absl::Status status = writer_->Put(image, options_.replace);
    return absl::IsAlreadyExists(status) ? CheckSame(image) : status;
  }

  absl::Status CheckSame(const RobotImage& image) {
    ASSIGN_OR_RETURN(const Snapshot snapshot, database_->Read());
    const auto stored = snapshot.Find(image.number);
    if (!stored.ok() && !absl::IsDataLoss(stored.status())) return stored.status();
    if (!stored.ok() || !*stored || **stored != image) {
      return absl::AlreadyExistsError(
          "the database has another record of this configuration; --replace takes this one");
    }
    ++there_already_;
    return absl::OkStatus();
  }

  const std::string csv_;
  Database& whole_;
  const ImportOptions& options_;
  const std::string program_;
  std::unique_ptr<Database> database_;      // the variant; null before the first good row
  std::optional<RobotImageWriter> writer_;  // likewise
  std::unordered_map<ConfigurationNumber, uint64_t> lines_;
  uint64_t there_already_ = 0;
  uint64_t faults_ = 0;
};

uint64_t CountLines(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  uint64_t lines = 0;
  for (std::string line; std::getline(file, line);) ++lines;
  return lines;
}

bool NextLine(std::ifstream& file, std::string& line) {
  if (!std::getline(file, line)) return false;
  if (line.ends_with('\r')) line.pop_back();
  return true;
}

struct ImportSource {
  std::string csv;
  TableReader table;
  std::ifstream file;  // at the first row below the header
  std::optional<storage::v1::References> references;
};

// Feeds all rows to `importer`, then commits.
absl::Status TakeAll(ImportSource& source, Importer& importer) {
  Progress progress("import", CountLines(source.csv), "lines");
  absl::Status status;
  std::string row;
  for (uint64_t line = 2; status.ok() && importer.faults() < kMostFaults && !StopRequested() &&
                          NextLine(source.file, row);
       ++line) {
    if (!row.empty()) status = importer.Take(source.table, row, line, progress);
    progress.Update(line);
  }
  const absl::Status committed = importer.Commit();
  return status.ok() ? committed : status;
}

// Whether reference images are to be stored. FailedPrecondition: the database has others, and
// `replace` is false.
absl::StatusOr<bool> BringsReferences(const ImportSource& source, const Database& database,
                                      bool replace) {
  if (!source.references) return false;
  ASSIGN_OR_RETURN(const Snapshot snapshot, database.Read());
  ASSIGN_OR_RETURN(auto stored, snapshot.References());
  if (!stored) return true;
  for (auto& view : *stored->mutable_views()) view.clear_with_robot();  // as if they were exported
  if (stored->SerializeAsString() == source.references->SerializeAsString()) return false;
  if (replace) return true;
  const std::string file = fs::path(source.csv).parent_path() / kReferencesFile;
  return FailedPrecondition("database '", database.path(), "' has other reference images than '",
                            file, "'; delete this file to keep them, or give --replace");
}

// The share of a mask's outermost pixels that are set.
double ShareOfRim(const Mask& mask) {
  const MaskSize size = mask.size();
  int rim = 0;
  int set = 0;
  for (int y = 0; y < size.height; ++y) {
    const bool whole_row = y == 0 || y == size.height - 1;
    for (int x = 0; x < size.width; x += whole_row ? 1 : std::max(1, size.width - 1)) {
      ++rim;
      set += mask.at(x, y) ? 1 : 0;
    }
  }
  return static_cast<double>(set) / rim;
}

// Whether a view's masks seem to have the robot black and all else white, of which nearly all that
// stands where the robot is would be free: the robot covers most of each, and most of the rim in
// all of them.
class InversionCheck {
 public:
  void Take(const RobotImage& image) {
    if (image.excluded) return;
    if (always_.empty()) {
      always_ = image.masks;
      fills_.assign(always_.size(), true);
    }
    for (size_t view = 0; view < always_.size(); ++view) {
      const Mask& mask = image.masks[view];
      always_[view] = always_[view] & mask;
      fills_[view] = fills_[view] && 2 * mask.Count() > mask.size().pixels();
    }
  }

  // The first such view.
  std::optional<size_t> Inverted() const {
    for (size_t view = 0; view < always_.size(); ++view) {
      if (fills_[view] && ShareOfRim(always_[view]) > 0.5) return view;
    }
    return std::nullopt;
  }

 private:
  std::vector<Mask> always_;  // by view: what the robot covers in all masks
  std::vector<bool> fills_;   // by view: whether it covers more than half of each
};

// Looks at a sample of the rows; `source` stands at the first one before and after.
absl::Status RefuseInverted(ImportSource& source, const storage::v1::CellDescription& cell) {
  constexpr uint64_t kMostRows = 100;
  const auto begin = source.file.tellg();
  const uint64_t step = CountLines(source.csv) / kMostRows + 1;
  InversionCheck check;
  std::string row;
  for (uint64_t line = 0; NextLine(source.file, row); ++line) {
    if (row.empty() || line % step != 0) continue;
    const absl::StatusOr<RobotImage> image = source.table.Read(row);
    if (image.ok()) check.Take(*image);  // TakeAll reports the others
  }
  source.file.clear();
  source.file.seekg(begin);
  const std::optional<size_t> view = check.Inverted();
  if (!view) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      source.csv, ": the masks of the view '", cell.views(static_cast<int>(*view)).name(),
      "' seem to be inverted, as they show the robot nearly everywhere: make the robot "
      "white and all else black, or give --robot-fills-view if the robot does fill the "
      "view"));
}

absl::StatusOr<ExitCode> ImportInto(Database& whole, const ImportOptions& options,
                                    ImportSource& source) {
  RETURN_IF_ERROR(CheckNotDrawn(whole));
  ASSIGN_OR_RETURN(const bool brings_references, BringsReferences(source, whole, options.replace));
  if (!options.robot_fills_view) RETURN_IF_ERROR(RefuseInverted(source, whole.cell()));
  const std::string program = absl::StrCat("silhouette-db import ", options.folder);
  Importer importer(source.csv, whole, options, program);
  absl::Status status = TakeAll(source, importer);
  if (status.ok() && brings_references) status = whole.SetReferences(*source.references, program);
  const std::string& path = whole.path();
  const bool complete = status.ok() && !StopRequested() && importer.faults() == 0;
  const std::string next = complete ? absl::StrCat("silhouette-db index ", ForShell(path)) : "";
  const bool none = importer.faults() > 0 && importer.committed() + importer.there_already() == 0;
  std::string text = none ? "nothing is imported"
                          : Counted(importer.committed(), "record") + " imported into " + path;
  if (importer.there_already() > 0) {
    absl::StrAppend(&text, ", ", importer.there_already(), " were there already");
  }
  const nlohmann::ordered_json json = {{"database", path},
                                       {"imported", importer.committed()},
                                       {"there_already", importer.there_already()},
                                       {"wrong_lines", importer.faults()},
                                       {"complete", complete},
                                       {"next", next}};
  PrintResult(options.format, json, absl::StrCat(text, next.empty() ? "" : "\nnext: ", next, "\n"));
  std::cout << std::flush;
  if (complete) return kDone;
  if (!status.ok()) return status;
  if (StopRequested()) return Stopped("run it again to go on; what is imported stays");
  return absl::InvalidArgumentError(
      absl::StrCat(importer.faults(),
                   importer.faults() == kMostFaults ? " lines or more are wrong; mend them"
                   : importer.faults() == 1         ? " line is wrong; mend it"
                                                    : " lines are wrong; mend them",
                   " and run it again", none ? "" : ", what is imported stays"));
}

absl::StatusOr<ExitCode> ImportHere(const ImportOptions& options) {
  ASSIGN_OR_RETURN(const Cell cell, LoadCell(options.cell, options.database));
  const std::string& path = cell.database;
  if (path.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("cell file '", options.cell, "' names no database; give --database"));
  }
  const bool is_folder = fs::is_directory(options.folder);
  const std::string csv =
      is_folder ? (fs::path(options.folder) / kConfigurationsFile).string() : options.folder;
  RETURN_IF_ERROR(RefusePipe(csv));
  std::ifstream file(csv, std::ios::binary);
  std::string header;
  if (!file || !NextLine(file, header)) {
    return absl::NotFoundError(absl::StrCat("'", csv, "' cannot be read, or is empty"));
  }
  absl::string_view bare = header;
  absl::ConsumePrefix(&bare, "\xef\xbb\xbf");  // some programs begin a CSV with it
  const storage::v1::CellDescription description = DescriptionOf(cell);
  ASSIGN_OR_RETURN(const TableReader table, TableReader::FromHeader(csv, bare, cell));
  ASSIGN_OR_RETURN(const auto references,
                   ImportReferences(fs::path(csv).parent_path().string(), description));
  const auto rows = file.tellg();
  if (!references && (file >> std::ws).eof()) {
    return absl::InvalidArgumentError(
        absl::StrCat(csv, ": there is no row below the header; add one for each configuration"));
  }
  file.seekg(rows);

  CatchStopSignals();
  const bool is_new = !fs::exists(path);
  ASSIGN_OR_RETURN(std::unique_ptr<Database> database, OpenOrCreate(path, cell));
  ImportSource source{csv, table, std::move(file), references};
  auto imported = ImportInto(*database, options, source);
  if (is_new && IsEmpty(*database)) {
    database.reset();
    fs::remove_all(path);
    if (options.format == "text") std::cout << "no database is made" << std::endl;
  }
  return imported;
}

}  // namespace

void AddImport(CLI::App& app, Work& work) {
  auto [command, options] =
      AddCommand(app, work, "import",
                 "Imports masks that another program made, or that export wrote", ImportHere);
  command
      .add_option("folder", options.folder,
                  "Folder with configurations.csv, or the path of such a file")
      ->required();
  command.add_option("--cell", options.cell, "The cell file")->required();
  command.add_option(
      "--database", options.database,
      "Folder of the database, made if it is missing; default: that of the cell file");
  command.add_option("--variant", options.variant, "The variant; made if it is missing")
      ->capture_default_str();
  command.add_flag("--replace", options.replace,
                   "Replace existing records and reference images instead of comparing them");
  command.add_flag("--robot-fills-view", options.robot_fills_view,
                   "Import masks that show the robot nearly everywhere, as inverted ones would");
  AddFormatOption(command, options.format);
  command.footer(
      "configurations.csv has a column per joint of the grid, by its name (radians, or 30deg, or\n"
      "0.2m; six decimals are enough), and one per view with the path of a PNG mask, relative to\n"
      "the CSV: the robot white, all else black.\n"
      "Example:\n  silhouette-db import --cell cell.yaml --database cell.lmdb masks/");
}

}  // namespace silhouette
