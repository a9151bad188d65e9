// SPDX-License-Identifier: Apache-2.0
// silhouette-db export: a database as a table and PNG files.
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/picture/files.h"
#include "common/picture/mask_png.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "db/store/suspects.h"
#include "tools/program/progress.h"
#include "tools/silhouette-db/commands.h"
#include "tools/silhouette-db/common.h"
#include "tools/silhouette-db/exchange.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

struct ExportOptions : DatabaseOptions {
  std::string folder;
};

std::string Number(double value) { return absl::StrFormat("%.17g", value); }

// Writes rows and masks.
class Exporter {
 public:
  Exporter(const Database& database, std::string folder)
      : database_(database), folder_(std::move(folder)) {}

  absl::Status Begin() {
    ASSIGN_OR_RETURN(const std::vector<std::string> columns, ColumnsOf(database_.cell()));
    RETURN_IF_ERROR(MakeFolder(folder_));
    std::error_code error;
    if (!fs::is_empty(folder_, error) || error) {
      return absl::FailedPreconditionError(
          absl::StrCat("folder '", folder_, "' is not empty; give a new one"));
    }
    table_.open(folder_ + "/" + kConfigurationsFile);
    table_ << CsvLine(columns) << "\n";
    return CheckTable();
  }

  absl::Status Write(const RobotImage& image) {
    std::vector<std::string> cells;
    for (double value : database_.grid().At(image.number)) cells.push_back(Number(value));
    for (int i = 0; i < database_.cell().views_size(); ++i) {
      std::string& cell = cells.emplace_back();
      if (image.excluded) continue;
      ASSIGN_OR_RETURN(cell, WriteMask(i, image.number, image.masks[static_cast<size_t>(i)]));
    }
    cells.push_back(TimeText(image.captured));
    const size_t joints = AllJoints(database_.cell()).size();
    for (const auto* values : {&image.commanded, &image.measured}) {
      for (size_t j = 0; j < joints; ++j) {
        cells.push_back(values->empty() ? "" : Number((*values)[j]));
      }
    }
    table_ << CsvLine(cells) << "\n";
    return CheckTable();
  }

  absl::Status Finish() {
    table_.close();
    return CheckTable();
  }

 private:
  absl::StatusOr<std::string> WriteMask(int view, ConfigurationNumber number, const Mask& mask) {
    const std::string place = absl::StrFormat(
        "masks/%s/%d", PathPart(database_.cell().views(view).name()), number / kTileSize);
    if (made_.insert(place).second) {
      RETURN_IF_ERROR(MakeFolder(absl::StrCat(folder_, "/", place)));
    }
    const std::string path = absl::StrFormat("%s/%d.png", place, number);
    RETURN_IF_ERROR(WriteMaskPng(folder_ + "/" + path, mask));
    return path;
  }

  absl::Status CheckTable() const {
    if (table_) return absl::OkStatus();
    return absl::InternalError(absl::StrCat("'", folder_, "/", kConfigurationsFile,
                                            "' cannot be written; is the disk full?"));
  }

  const Database& database_;
  const std::string folder_;
  std::ofstream table_;
  std::set<std::string> made_;
};

// A table does not state that robot images were drawn: read again, they would pass for captured
// ones.
absl::Status CheckCaptured(const Database& database) {
  ASSIGN_OR_RETURN(const auto drawn, DrawnByVariant(database));
  if (drawn.empty()) return absl::OkStatus();
  return FailedPrecondition("the robot images in '", database.path(),
                            "' were drawn, and only captured ones are exported; draw them again "
                            "with 'silhouette-capture draw', or copy the database with "
                            "'silhouette-db compact'");
}

absl::StatusOr<ExitCode> ExportHere(const ExportOptions& options) {
  ASSIGN_OR_RETURN(const OpenedDatabase opened, OpenForReading(options.database, options.variant));
  RETURN_IF_ERROR(CheckCaptured(*opened.database));
  CatchStopSignals();
  Exporter exporter(*opened.database, options.folder);
  RETURN_IF_ERROR(exporter.Begin());
  ASSIGN_OR_RETURN(const auto history, opened.snapshot.CaptureHistory());
  const SuspectSpans suspects(history);
  uint64_t written = 0;
  uint64_t damaged = 0;
  uint64_t suspect = 0;
  absl::Status failure;
  {
    Progress progress("export", opened.snapshot.size(), "records");
    const absl::Status status =
        opened.snapshot.ForEach([&](ConfigurationNumber, const absl::StatusOr<RobotImage>& image) {
          if (!image.ok()) {
            progress.Say("left out: " + std::string(image.status().message()));
            ++damaged;
          } else if (!image->excluded && suspects.Contain(image->captured)) {
            ++suspect;
          } else {
            failure = exporter.Write(*image);
            ++written;
          }
          progress.Update(written + damaged + suspect);
          return failure.ok() && !StopRequested();
        });
    if (!failure.ok()) return failure;
    if (StopRequested()) return Stopped("delete the folder and export again");
    if (!status.ok()) return status;
  }
  ASSIGN_OR_RETURN(const auto references, opened.snapshot.References());
  if (references) {
    RETURN_IF_ERROR(ExportReferences(options.folder, opened.database->cell(), *references));
  }
  RETURN_IF_ERROR(exporter.Finish());
  const std::string table = absl::StrCat(options.folder, "/", kConfigurationsFile);
  const nlohmann::ordered_json json = {
      {"database", options.database}, {"table", table},     {"exported", written},
      {"damaged", damaged},           {"suspect", suspect}, {"references", references.has_value()}};
  PrintResult(
      options.format, json,
      absl::StrCat(written, " records exported to ", table,
                   damaged > 0 ? absl::StrCat(", ", damaged, " damaged ones left out") : "",
                   suspect > 0 ? absl::StrCat(", ", suspect,
                                              " left out that were captured while the cell may "
                                              "have changed")
                               : "",
                   "\n"));
  return damaged + suspect == 0 ? kDone : kNo;
}

}  // namespace

void AddExport(CLI::App& app, Work& work) {
  auto [command, options] = AddCommand(
      app, work, "export",
      "Writes a database as a CSV table and PNG masks, for other programs or `import`", ExportHere);
  AddVariantOption(command, options.variant);
  command.add_option("folder,--folder", options.folder, "New folder")->required();
  AddFormatOption(command, options.format);
  command.footer(
      "Drawn robot images are refused: they would be imported as captured ones.\n"
      "Exit code 1: robot images were left out, for they are damaged, or suspect: captured while\n"
      "the cell may have changed.\n\n"
      "Example:\n  silhouette-db export cell.lmdb masks/");
}

}  // namespace silhouette
