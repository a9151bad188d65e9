// SPDX-License-Identifier: Apache-2.0
// The subcommands of `silhouette`. Each adds itself to the program; when it is chosen, it puts what
// is to be done into `run`.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <utility>

#include "absl/status/statusor.h"
#include "tools/program/program.h"
#include "tools/silhouette/options.h"

namespace silhouette {

using Run = std::function<absl::StatusOr<ExitCode>()>;

// When `command` is chosen, `run` calls `action` with the session and the arguments that it read.
template <typename Arguments>
void Runs(CLI::App& command, const Session& session, Run& run, std::shared_ptr<Arguments> arguments,
          absl::StatusOr<ExitCode> (*action)(const Session&, const Arguments&)) {
  command.callback([arguments = std::move(arguments), action, &session, &run] {
    run = [arguments, action, &session] { return action(session, *arguments); };
  });
}

void AddCheckCommand(CLI::App& program, Session& session, Run& run);
void AddPathCommand(CLI::App& program, Session& session, Run& run);
void AddSpaceCommand(CLI::App& program, Session& session, Run& run);
void AddWatchCommand(CLI::App& program, Session& session, Run& run);
void AddPlanCommand(CLI::App& program, Session& session, Run& run);
void AddExplainCommand(CLI::App& program, Session& session, Run& run);
// Below `region`.
void AddRegionAllowCommand(CLI::App& region, Session& session, Run& run);
void AddRegionRevokeCommand(CLI::App& region, Session& session, Run& run);
void AddRegionListCommand(CLI::App& region, Session& session, Run& run);
// Below `scene`.
void AddScenePublishCommand(CLI::App& scene, Session& session, Run& run);
void AddSceneLiveCommand(CLI::App& scene, Session& session, Run& run);
void AddSceneVariantCommand(CLI::App& scene, Session& session, Run& run);
void AddSceneShowCommand(CLI::App& scene, Session& session, Run& run);

}  // namespace silhouette
