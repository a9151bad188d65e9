// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate: from images of AprilTags to cameras one can trust.
#include <CLI/CLI.hpp>

#include "tools/program/program.h"
#include "tools/silhouette-calibrate/commands.h"

int main(int argc, char** argv) {
  CLI::App app("Finds lenses, poses and fundamental matrices of a cell's cameras from AprilTags.",
               "silhouette-calibrate");
  app.require_subcommand(1);
  app.footer(
      "Examples:\n"
      "  silhouette-calibrate board --out wall --rows 4 --columns 6 --tag-size 30\n"
      "  silhouette-calibrate detect --images 'left=left/*.png' --boards wall.yaml --out "
      "corners.csv\n"
      "  silhouette-calibrate intrinsics --corners corners.csv --boards wall.yaml \\\n"
      "      --image-size 1280x960 --out cameras\n"
      "  silhouette-calibrate COMMAND --help\n\n"
      "Exit codes: 0 done, 1 the answer is no or the check failed, 2 a mistake in the arguments or "
      "files,\n"
      "3 the world failed.");
  silhouette::Run run;
  silhouette::AddBoardCommand(app, run);
  silhouette::AddDetectCommand(app, run);
  silhouette::AddIntrinsicsCommand(app, run);
  silhouette::AddPosesCommand(app, run);
  silhouette::AddFundamentalCommand(app, run);
  silhouette::AddCheckCommand(app, run);
  silhouette::AddRunCommand(app, run);
  silhouette::AddReportCommand(app, run);
  return silhouette::RunProgram(app, argc, argv, run);
}
