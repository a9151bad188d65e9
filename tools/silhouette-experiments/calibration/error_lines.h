// SPDX-License-Identifier: Apache-2.0
// What calibration finds from sessions with model errors, held against the truth and against what
// other programs find.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "tools/silhouette-experiments/calibration/figures.h"
#include "tools/silhouette-experiments/calibration/model_errors.h"

namespace silhouette::calibration_experiment {

// Of one line, over several runs. The errors are of workspace points, exactly where they are in
// truth: pixels for lenses, metres for poses.
struct LineResult {
  RootMeanSquare error;       // of the runs that were not refused
  RootMeanSquare others;      // the best other program's, of the same runs; without count: none ran
  RootMeanSquare comparable;  // the own error in runs that have that of others
  ChiSquared predicted;       // of the errors, against the predicted uncertainty
  int runs = 0;
  int others_failed = 0;       // runs in which the other program found nothing
  std::string others_failure;  // the last one's reason
  std::string refusal;         // the last one's reason
  int refused = 0;
  double most_refused = 0;  // share of the runs, to meet the goals
};

// Adds a run's errors, and those of others if they have any.
void AddRun(const RootMeanSquare& own, const RootMeanSquare& others, LineResult& result);

// Whether a solver's status is a refusal, which is then noted.
bool IsRefusal(const absl::Status& status, LineResult& result);

// `others`: whether mrcal-calibrate-cameras is to be run as well. NotFound: there is none.
// Internal: a solver failed.
absl::Status MeasureLensLine(const ErrorLine& line, uint64_t seed, bool others, LineResult& result);

// Beside the best of the methods of cv::calibrateHandEye, by the truth.
absl::Status MeasurePoseLine(const ErrorLine& line, uint64_t seed, LineResult& result);

// The own error over that of the others, less 1; 0 without others.
double WorseThanOthers(const LineResult& result);

// No more runs refused than the line states; at most 2 % worse than others, which have a result if
// they were asked; and errors as predicted (chi2 per degree of freedom 0.7 to 1.4).
bool MeetsGoals(const LineResult& result);

}  // namespace silhouette::calibration_experiment
