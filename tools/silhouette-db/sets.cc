// silhouette-db sets: the sets of robot images, making and removing them.
#include <iostream>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-db/commands.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

struct SetsOptions {
  std::string database;
  std::string format = "text";
  std::string add;
  std::string remove;
};

absl::Status Change(const SetsOptions& options) {
  ASSIGN_OR_RETURN(const std::unique_ptr<Database> database,
                   Database::Open(options.database, Database::Access::kWrite));
  if (!options.add.empty()) {
    return (database)
        ->CreateSet(options.add, absl::StrCat("silhouette-db sets --add ", options.add))
        .status();
  }
  return database->RemoveSet(options.remove,
                             absl::StrCat("silhouette-db sets --remove ", options.remove));
}

absl::StatusOr<ExitCode> Sets(const SetsOptions& options) {
  if (!options.add.empty() || !options.remove.empty()) {
    RETURN_IF_ERROR(Change(options));
  }
  ASSIGN_OR_RETURN(const OpenedDatabase opened, OpenForReading(options.database));
  ASSIGN_OR_RETURN(const Database::Usage usage, opened.database->GetUsage());
  if (options.format == "json") {
    std::cout << SetsJson(usage).dump(2) << std::endl;
  } else {
    std::cout << SetsText(usage, opened.database->grid());
  }
  return kDone;
}

}  // namespace

void AddSets(CLI::App& app, Work& work) {
  auto options = std::make_shared<SetsOptions>();
  CLI::App* command = app.add_subcommand(
      "sets", "The sets of robot images: of the robot with its gripper open, closed, with a part");
  AddDatabaseArgument(*command, options->database);
  CLI::Option* add = command->add_option("--add", options->add, "Make this set, without images");
  command
      ->add_option("--remove", options->remove,
                   "Remove this set: its robot images, raw images and collision index are lost")
      ->excludes(add);
  AddFormatOption(*command, options->format);
  command->footer(
      "silhouette-capture run and silhouette-db import make a set if it is not there.\n"
      "Example:\n  silhouette-db sets cell.lmdb --remove gripper-open");
  command->callback([&work, options] { work = [options] { return Sets(*options); }; });
}

}  // namespace silhouette
