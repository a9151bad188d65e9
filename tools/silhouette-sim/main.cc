// SPDX-License-Identifier: Apache-2.0
// silhouette-sim: pictures and truth of the simulated cell.
#include <CLI/CLI.hpp>

#include "tools/program/program.h"
#include "tools/silhouette-sim/commands.h"

int main(int argc, char** argv) {
  using namespace silhouette;
  CLI::App app("Pictures, truth and devices of the simulated cell that a cell.yaml names.",
               "silhouette-sim");
  app.require_subcommand(1);
  app.footer(
      "Examples:\n"
      "  silhouette-sim render --cell cell.yaml --scene obstacles.yaml \\\n"
      "      --configuration 0.5,-30deg --out images\n"
      "  silhouette-sim contact --cell cell.yaml --scene obstacles.yaml --configuration "
      "0.5,-30deg\n"
      "  silhouette-sim truth --cell cell.yaml --scene obstacles.yaml --out truth.csv\n"
      "  silhouette-sim path --cell cell.yaml --scene obstacles.yaml --path path.json\n"
      "  silhouette-sim calibration --cell cell.yaml --out cameras\n"
      "  silhouette-sim serve --cell cell.yaml --robot simple_message --cameras rtsp\n\n"
      "Exit codes: 0 done, 1 the robot touches an obstacle, 2 wrong arguments or files,\n"
      "3 the world failed.");
  Run run;
  for (const auto add : {AddRenderCommand, AddContactCommand, AddServeCommand, AddTruthCommand,
                         AddPathCommand, AddCalibrationCommand}) {
    add(app, run);
  }
  return RunProgram(app, argc, argv, run);
}
