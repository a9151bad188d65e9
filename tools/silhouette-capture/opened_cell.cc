// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-capture/opened_cell.h"

#include <algorithm>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/files/calibration_message.h"
#include "capture/verification/verified_robot.h"
#include "db/status/status_macros.h"
#include "tools/cell/segmentation_text.h"
#include "tools/program/for_shell.h"
#include "tools/program/program.h"

namespace silhouette {

std::string CellArguments::Command(const std::string& subcommand,
                                   const std::string& program) const {
  std::string command = absl::StrCat(program, " ", subcommand, " --cell ", ForShell(cell));
  if (!database.empty()) absl::StrAppend(&command, " --database ", ForShell(database));
  // Reference images are of all variants; a drawn robot has one.
  if (variant != schema::kDefaultVariant && subcommand != "reference" &&
      subcommand != "verify-model") {
    absl::StrAppend(&command, " --variant ", ForShell(variant));
  }
  return command;
}

void AddCellOptions(CLI::App& command, CellArguments& arguments) {
  command.add_option("--cell", arguments.cell, "The cell's file, cell.yaml")->required();
  command.add_option("--database", arguments.database,
                     "The database's folder; default: the one that the cell's file names");
  AddFormatOption(command, arguments.format);
}

void AddVariantOption(CLI::App& command, CellArguments& arguments) {
  command
      .add_option("--variant", arguments.variant,
                  "The variant: of the robot with this tool, this part, its gripper\n"
                  "open or closed")
      ->capture_default_str();
}

absl::StatusOr<CellFile> OpenCellFile(const CellArguments& arguments) {
  ASSIGN_OR_RETURN(Cell cell, LoadCell(arguments.cell, arguments.database));
  if (cell.database.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("say where the database is: --database FOLDER, or 'database: FOLDER' in '",
                     arguments.cell, "'"));
  }
  const std::string database = cell.database;
  for (const ViewSettings& view : cell.views) {
    if (view.has_noise) cell.capture.noisy_views.insert(view.name);
  }
  return CellFile{std::move(cell), database, arguments.variant};
}

absl::StatusOr<std::unique_ptr<Database>> OpenDatabase(const CellFile& file,
                                                       Database::Access access) {
  ASSIGN_OR_RETURN(std::unique_ptr<Database> database, Database::Open(file.database, access));
  const std::vector<std::string> differences =
      Differences(DescriptionOf(file.cell), "the cell file", database->cell(), "the database");
  if (!differences.empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat("the database '", file.database, "' does not belong to the cell of '",
                     file.cell.file, "': ", absl::StrJoin(differences, "; "),
                     SegmentationAdvice(file.cell.segmentation, database->cell()),
                     ". Choose another database, or change the cell file back"));
  }
  absl::StatusOr<std::unique_ptr<Database>> variant = database->OpenVariant(file.variant);
  if (!absl::IsNotFound(variant.status()) || access == Database::Access::kRead) return variant;
  return database->CreateVariant(file.variant, "silhouette-capture run --variant " + file.variant);
}

absl::StatusOr<std::unique_ptr<Database>> OpenDatabaseOfOtherMasks(const CellFile& file,
                                                                   Database::Access access,
                                                                   bool other_masks) {
  auto database = Database::Open(file.database, access);
  if (!database.ok()) return database.status();
  storage::v1::CellDescription wanted = DescriptionOf(file.cell);
  wanted.set_segmentation("");
  const storage::v1::CellDescription& stored = (*database)->cell();
  for (int v = 0; other_masks && v < std::min(wanted.views_size(), stored.views_size()); ++v) {
    wanted.mutable_views(v)->set_mask_width(stored.views(v).mask_width());
    wanted.mutable_views(v)->set_mask_height(stored.views(v).mask_height());
  }
  const auto differences = Differences(wanted, "the cell file", stored, "the database");
  if (differences.empty()) return database;
  return absl::FailedPreconditionError(
      absl::StrCat("the database '", file.database, "' does not belong to the cell of '",
                   file.cell.file, "': ", absl::StrJoin(differences, "; "),
                   other_masks || access == Database::Access::kRead
                       ? ""
                       : ". Masks of another size go into another database: --into FOLDER"));
}

bool HasCameraModels(const Snapshot& snapshot) {
  const auto stored = snapshot.Calibration();
  return stored.ok() && *stored && (*stored)->cameras_size() > 0;
}

bool HasVerifiedModel(const Cell& cell, const Database& database, const Snapshot& snapshot) {
  const auto verification = snapshot.Verification();
  const auto stored = snapshot.Calibration();
  if (!verification.ok() || !*verification || !stored.ok() || !*stored) return false;
  const auto drawn = DrawnCellOf(cell);
  if (!drawn.ok() || !*drawn) return false;
  const auto calibration = CalibrationFrom(**stored);
  if (!calibration.ok()) return false;
  auto bare = BareRobotOf(**drawn, database, *calibration, cell.calibration.margin);
  if (!bare.ok()) return false;
  const auto robot =
      VerifiedRobotOf(**drawn, *std::move(bare), database.grid().joints(), *verification);
  return robot.ok() && robot->unverified.empty();
}

std::string ImportCamerasCommand(const CellFile& file) {
  return absl::StrCat("silhouette-db calibration import ", ForShell(file.database),
                      " CAMERAS --cell ", ForShell(file.cell.file));
}

std::string BesideDatabase(const std::string& database, const std::string& ending) {
  std::string folder = database;
  while (folder.size() > 1 && folder.back() == '/') folder.pop_back();
  return folder + ending;
}

absl::StatusOr<std::unique_ptr<Database>> OpenOrCreateDatabase(const CellFile& file) {
  absl::StatusOr<std::unique_ptr<Database>> database = OpenDatabase(file, Database::Access::kWrite);
  if (!absl::IsNotFound(database.status())) return database;
  return Database::Create(file.database, DescriptionOf(file.cell));
}

}  // namespace silhouette
