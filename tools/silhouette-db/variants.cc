// SPDX-License-Identifier: Apache-2.0
// silhouette-db variants: the variants, making and removing them.
#include <memory>
#include <nlohmann/json.hpp>

#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-db/commands.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

struct VariantsOptions : DatabaseOptions {
  std::string add;
  std::string remove;
};

absl::Status ChangeVariants(const VariantsOptions& options) {
  ASSIGN_OR_RETURN(const std::unique_ptr<Database> database,
                   Database::Open(options.database, Database::Access::kWrite));
  const std::string program = "silhouette-db variants ";
  if (options.add.empty()) {
    return database->RemoveVariant(options.remove, program + "--remove " + options.remove);
  }
  return database->CreateVariant(options.add, program + "--add " + options.add).status();
}

absl::StatusOr<ExitCode> Variants(const VariantsOptions& options) {
  if (!options.add.empty() || !options.remove.empty()) RETURN_IF_ERROR(ChangeVariants(options));
  ASSIGN_OR_RETURN(const OpenedDatabase opened, OpenForReading(options.database));
  ASSIGN_OR_RETURN(const Database::Usage usage, opened.database->GetUsage());
  PrintResult(options.format, VariantsJson(usage), VariantsText(usage, opened.database->grid()));
  return kDone;
}

}  // namespace

void AddVariants(CLI::App& app, Work& work) {
  auto [command, options] = AddCommand(
      app, work, "variants",
      "Lists, adds or removes variants, e.g. gripper open, gripper closed, with a part", Variants);
  CLI::Option* add = command.add_option("--add", options.add, "Make this variant, without images");
  command
      .add_option("--remove", options.remove,
                  "Remove this variant: its robot images, raw images and collision index are lost")
      ->excludes(add);
  AddFormatOption(command, options.format);
  command.footer(
      "silhouette-capture run and silhouette-db import make a variant if it is missing.\n"
      "Example:\n  silhouette-db variants cell.lmdb --remove gripper-open");
}

}  // namespace silhouette
