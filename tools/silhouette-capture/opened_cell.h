// SPDX-License-Identifier: Apache-2.0
// The cell's file and its database, as the subcommands open them.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "db/store/schema.h"
#include "db/store/store.h"
#include "tools/cell/cell.h"

namespace silhouette {

// The arguments of all subcommands.
struct CellArguments {
  std::string cell;
  std::string database;
  std::string variant = schema::kDefaultVariant;  // of robot images
  std::string format = "text";

  bool json() const { return format == "json"; }

  // A command line for the same cell and database, to be typed into a shell.
  std::string Command(const std::string& subcommand,
                      const std::string& program = "silhouette-capture") const;
};

// Adds --cell, --database and --format.
void AddCellOptions(CLI::App& command, CellArguments& arguments);
// Adds --variant.
void AddVariantOption(CLI::App& command, CellArguments& arguments);

struct CellFile {
  Cell cell;
  std::string database;  // the folder: that of the arguments, else that of the file
  std::string variant;
};

// InvalidArgument if the file is not valid, or the database's folder is not specified.
absl::StatusOr<CellFile> OpenCellFile(const CellArguments& arguments);

// The database, if it is that of the cell; else FailedPrecondition says in what they differ.
// NotFound: there is none yet, or it has no such variant; for writing the variant is made.
absl::StatusOr<std::unique_ptr<Database>> OpenDatabase(const CellFile& file,
                                                       Database::Access access);

// The same, but the database may have been made with other segmentation settings; with
// `other_masks`, also with masks of other sizes. The default variant.
absl::StatusOr<std::unique_ptr<Database>> OpenDatabaseOfOtherMasks(const CellFile& file,
                                                                   Database::Access access,
                                                                   bool other_masks);

// Whether a calibration with camera models is stored; one that is damaged counts as none.
bool HasCameraModels(const Snapshot& snapshot);

// Whether the database has a verification, and of this model.
bool HasVerifiedModel(const Cell& cell, const Database& database, const Snapshot& snapshot);

// The command that imports the camera models of the folder CAMERAS, to be typed into a shell.
std::string ImportCamerasCommand(const CellFile& file);

// The database's folder with another ending, for what is kept beside it.
std::string BesideDatabase(const std::string& database, const std::string& ending);

// For writing; made if it is not there.
absl::StatusOr<std::unique_ptr<Database>> OpenOrCreateDatabase(const CellFile& file);

}  // namespace silhouette
