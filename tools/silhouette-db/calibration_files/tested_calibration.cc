#include "tools/silhouette-db/calibration_files/tested_calibration.h"

#include <utility>

#include "absl/strings/str_format.h"
#include "calib/files/calibration_message.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-db/calibration_files/calibration_files.h"

namespace silhouette {
namespace {

// Robot images that a calibration is put to the test by.
constexpr size_t kSamples = 400;
// Share of the robot's pixels that may contradict: rims that differencing lost, never a calibration
// that is worth having.
constexpr double kMostContradicting = 0.001;

}  // namespace

absl::StatusOr<TestedCalibration> TestCalibration(const Database& database,
                                                  const Snapshot& snapshot,
                                                  const storage::v1::Calibration& stored,
                                                  double margin) {
  ASSIGN_OR_RETURN(Calibration calibration, CalibrationFrom(stored));
  RETURN_IF_ERROR(CheckLines(calibration, database.cell()));
  EpipolarBands bands(calibration, database.mask_sizes(), margin);
  ASSIGN_OR_RETURN(std::vector<ConfigurationNumber> samples,
                   SampledConfigurations(database, snapshot, kSamples));
  ASSIGN_OR_RETURN(Contradictions found, FindContradictions(snapshot, bands, samples));
  return TestedCalibration{std::move(calibration), std::move(bands), std::move(samples),
                           std::move(found)};
}

std::string ContradictionText(const Contradictions& found,
                              const storage::v1::CellDescription& cell) {
  if (found.configurations == 0) return "there are no robot images to test the calibration with";
  const PairContradictions* worst = found.worst();
  if (worst == nullptr) {
    return "the robot images cannot test the calibration: the robot reaches the rim of every view";
  }
  return absl::StrFormat(
      "%.4g %% of %d robot pixels of '%s' contradict '%s' (%d configurations looked at)",
      100 * worst->share(), worst->pixels, cell.views(worst->view).name(),
      cell.views(worst->other).name(), worst->configurations);
}

absl::Status CheckContradictions(const Contradictions& found,
                                 const storage::v1::CellDescription& cell) {
  const PairContradictions* worst = found.worst();
  if (worst == nullptr || worst->share() <= kMostContradicting) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrFormat(
      "the calibration contradicts the robot images: %s, where at most %.4g %% may; is it of "
      "these cameras, as they stood at the capture?",
      ContradictionText(found, cell), 100 * kMostContradicting));
}

}  // namespace silhouette
