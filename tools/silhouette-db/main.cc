// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-db/commands.h"

int main(int argc, char** argv) {
  using namespace silhouette;
  CLI::App app("Inspects and maintains the database of a cell.", "silhouette-db");
  app.require_subcommand(1);
  app.footer(
      "Examples:\n"
      "  silhouette-db info cell.lmdb\n"
      "  silhouette-db verify cell.lmdb\n"
      "  silhouette-db COMMAND --help");
  Work work;
  for (const auto add :
       {AddInfo, AddVerify, AddCoverage, AddShow, AddSheet, AddVariants, AddStats, AddExport,
        AddImport, AddIndex, AddCompact, AddDiff, AddMerge, AddCalibration, AddAudit}) {
    add(app, work);
  }
  return RunProgram(app, argc, argv, work);
}
