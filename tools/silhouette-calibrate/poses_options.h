// The options by which commands are told what `ReadPoseProblem` reads.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "tools/silhouette-calibrate/poses_inputs.h"

namespace silhouette {

// `degrees`: whether joint values without a unit are degrees (WithUnit).
void AddPoseSources(CLI::App& command, PoseSources& sources, bool& degrees);

PoseSources WithUnit(PoseSources sources, bool degrees);

// Where the data make no calibration, but would with joint values in the other unit: a sentence
// that says so; else empty.
std::string HintOfUnit(const PoseSources& sources);

}  // namespace silhouette
