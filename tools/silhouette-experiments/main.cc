// SPDX-License-Identifier: Apache-2.0
// silhouette-experiments measures collision checking against the truth.
#include <CLI/CLI.hpp>

#include "tools/program/program.h"
#include "tools/silhouette-experiments/commands.h"

int main(int argc, char** argv) {
  CLI::App app("Measures collision checking against the truth.", "silhouette-experiments");
  app.require_subcommand(1);
  app.footer(
      "Examples:\n"
      "  silhouette-experiments paper --experiments figure7\n"
      "  silhouette-experiments cell --cell cell.yaml --database cell.lmdb --out out\n"
      "  silhouette-experiments cell --cell cell.yaml --database cell.lmdb --scenes 0 --hidden 50\n"
      "  silhouette-experiments calibration --runs 10\n"
      "  silhouette-experiments placement --cell cell.yaml --places places.yaml --out out\n"
      "  silhouette-experiments segmentation --cell cell.yaml --scenes 20\n"
      "  silhouette-experiments faults --cell cell.yaml --minutes 60\n"
      "  silhouette-experiments still --cell cell.yaml --database cell.lmdb\n"
      "  silhouette-experiments people --cell cell.yaml --database cell.lmdb --out out\n\n"
      "Exit codes: 0 done, 2 a mistake in the arguments or files, 3 the world failed.");
  silhouette::Run run;
  silhouette::AddPaperCommand(app, run);
  silhouette::AddCellCommand(app, run);
  silhouette::AddCalibrationCommand(app, run);
  silhouette::AddPlacementCommand(app, run);
  silhouette::AddSegmentationCommand(app, run);
  silhouette::AddStillCommand(app, run);
  silhouette::AddFaultsCommand(app, run);
  silhouette::AddPeopleCommand(app, run);
  return silhouette::RunProgram(app, argc, argv, run);
}
