// SPDX-License-Identifier: Apache-2.0
// silhouette: asks silhouette-server, publishes scenes, plans paths.
#include <CLI/CLI.hpp>
#include <cstdlib>
#include <string>
#include <vector>

#include "tools/program/program.h"
#include "tools/silhouette/commands.h"

namespace silhouette {
namespace {

// "-.5" as "-0.5": the command line would take it for an option.
std::vector<std::string> WithNumbersSpeltOut(int argc, char** argv) {
  std::vector<std::string> arguments(argv, argv + argc);
  for (std::string& argument : arguments) {
    if (argument.starts_with("-.")) argument.insert(1, "0");
  }
  return arguments;
}

int Main(int argc, char** argv) {
  setenv("GRPC_VERBOSITY", "NONE", /*overwrite=*/0);
  CLI::App app(
      "Asks silhouette-server whether the robot may be somewhere, publishes scenes, plans.",
      "silhouette");
  Session session;
  AddServerOptions(app, session);
  app.fallthrough();
  app.require_subcommand(1);
  AddCheckCommand(app, session);
  AddPathCommand(app, session);
  AddSpaceCommand(app, session);
  AddWatchCommand(app, session);
  AddSceneCommands(app, session);
  AddRegionCommands(app, session);
  AddExplainCommand(app, session);
  AddReplayCommand(app, session);
  AddPlanCommand(app, session);
  app.footer(
      "Joint values are in radians (prismatic joints: metres), in the order of the grid's joints;\n"
      "30deg is in degrees. Exit codes: 0 done, 1 the answer is no (not free, no path), 2 a "
      "mistake\n"
      "in the arguments or files, 3 the world failed.\n\n"
      "Example:\n"
      "  silhouette scene publish images/ && silhouette check 0.1,-30deg\n"
      "  silhouette plan -100deg,70deg 100deg,70deg --picture configuration-space.png");

  std::vector<std::string> arguments = WithNumbersSpeltOut(argc, argv);
  std::vector<char*> pointers;
  for (std::string& argument : arguments) pointers.push_back(argument.data());
  return RunProgram(app, argc, pointers.data(), [&] { return session.run(); });
}

}  // namespace
}  // namespace silhouette

int main(int argc, char** argv) { return silhouette::Main(argc, argv); }
