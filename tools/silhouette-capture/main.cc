// SPDX-License-Identifier: Apache-2.0
#include <opencv2/core/utility.hpp>

#include "tools/silhouette-capture/commands.h"

int main(int argc, char** argv) {
  using namespace silhouette;
  CLI::App app(
      "Captures the robot images of a cell: drives the robot through every configuration of the\n"
      "grid and stores its mask in each view.",
      "silhouette-capture");
  app.require_subcommand(1);
  app.footer(
      "Examples:\n"
      "  silhouette-capture init --urdf robot.urdf       the first cell.yaml\n"
      "  silhouette-capture cameras                      which cameras there are\n"
      "  silhouette-capture check --cell cell.yaml       all that can be known before it moves\n"
      "  silhouette-capture reference --cell cell.yaml   images of the empty cell, first of all\n"
      "  silhouette-capture run --cell cell.yaml --dry-run\n"
      "  silhouette-capture run --cell cell.yaml         again after any interruption\n"
      "  silhouette-capture draw --cell cell.yaml --from cell.lmdb --database drawn.lmdb\n"
      "  silhouette-capture status --cell cell.yaml\n"
      "  silhouette-capture report --cell cell.yaml --out report\n"
      "  silhouette-capture tune --cell cell.yaml --try 'faint_side: 7'\n"
      "  silhouette-capture verify-model --cell cell.yaml   of a robot whose images are drawn");
  Work work;
  for (const auto add : {AddInit, AddCameras, AddCheck, AddReference, AddRun, AddDraw, AddStatus,
                         AddReport, AddRemask, AddTune, AddVerifyModel}) {
    add(app, work);
  }
  // Images are small: handing their parts to other threads costs more than it saves.
  cv::setNumThreads(1);
  return RunProgram(app, argc, argv, work);
}
