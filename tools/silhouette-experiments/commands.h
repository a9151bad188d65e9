// SPDX-License-Identifier: Apache-2.0
// The commands of silhouette-experiments. Each adds itself to the program and sets `run` when it is
// chosen.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "common/picture/files.h"
#include "tools/program/program.h"

namespace silhouette {

inline constexpr char kExperiments[] = "silhouette-experiments";

using Run = std::function<int()>;

void AddPaperCommand(CLI::App& program, Run& run);
void AddCellCommand(CLI::App& program, Run& run);
void AddCalibrationCommand(CLI::App& program, Run& run);
void AddPlacementCommand(CLI::App& program, Run& run);
void AddSegmentationCommand(CLI::App& program, Run& run);
void AddStillCommand(CLI::App& program, Run& run);
void AddFaultsCommand(CLI::App& program, Run& run);
void AddPeopleCommand(CLI::App& program, Run& run);

// When `command` is chosen, `run` makes the folder `arguments->out`, if there is such an option and
// it is given, and does `work`. An error is printed on stderr.
template <typename Arguments>
void RunWhenChosen(CLI::App& command, Run& run, const std::shared_ptr<Arguments>& arguments,
                   absl::StatusOr<ExitCode> (*work)(const Arguments&)) {
  command.callback([arguments, work, &run] {
    run = [arguments, work]() -> int {
      if constexpr (requires { arguments->out; }) {
        const std::string& out = arguments->out;
        const absl::Status made = out.empty() ? absl::OkStatus() : MakeFolder(out);
        if (!made.ok()) return Report(kExperiments, made);
      }
      const absl::StatusOr<ExitCode> code = work(*arguments);
      return code.ok() ? *code : Report(kExperiments, code.status());
    };
  });
}

}  // namespace silhouette
