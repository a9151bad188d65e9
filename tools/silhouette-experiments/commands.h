// SPDX-License-Identifier: Apache-2.0
// The commands of silhouette-experiments. Each adds itself to the program and sets `run` when it is
// chosen.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"
#include "tools/program/program.h"

namespace silhouette {

using Run = Work;

void AddPaperCommand(CLI::App& program, Run& run);
void AddCellCommand(CLI::App& program, Run& run);
void AddCalibrationCommand(CLI::App& program, Run& run);
void AddPlacementCommand(CLI::App& program, Run& run);
void AddSegmentationCommand(CLI::App& program, Run& run);
void AddStillCommand(CLI::App& program, Run& run);
void AddFaultsCommand(CLI::App& program, Run& run);
void AddPeopleCommand(CLI::App& program, Run& run);

// When `command` is chosen, `run` makes the folder `arguments->out`, if there is such an option and
// it is given, and does `work`.
template <typename Arguments>
void RunWhenChosen(CLI::App& command, Run& run, const std::shared_ptr<Arguments>& arguments,
                   absl::StatusOr<ExitCode> (*work)(const Arguments&)) {
  command.callback([arguments, work, &run] {
    run = [arguments, work]() -> absl::StatusOr<ExitCode> {
      if constexpr (requires { arguments->out; }) {
        if (!arguments->out.empty()) RETURN_IF_ERROR(MakeFolder(arguments->out));
      }
      return work(*arguments);
    };
  });
}

}  // namespace silhouette
