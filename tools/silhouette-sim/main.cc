// SPDX-License-Identifier: Apache-2.0
// silhouette-sim: pictures and truth of the simulated cell.
#include <CLI/CLI.hpp>

#include "tools/program/program.h"
#include "tools/silhouette-sim/commands.h"

int main(int argc, char** argv) {
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
      "Exit codes: 0 done, 1 the robot touches an obstacle, 2 a mistake in the arguments or "
      "files,\n"
      "3 the world failed.");
  silhouette::Run run;
  silhouette::AddRenderCommand(app, run);
  silhouette::AddContactCommand(app, run);
  silhouette::AddServeCommand(app, run);
  silhouette::AddTruthCommand(app, run);
  silhouette::AddPathCommand(app, run);
  silhouette::AddCalibrationCommand(app, run);
  return silhouette::RunProgram(app, argc, argv, [&] { return run(); });
}
