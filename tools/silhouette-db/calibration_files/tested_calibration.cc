// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-db/calibration_files/tested_calibration.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"
#include "calib/files/calibration_message.h"
#include "db/status/status_macros.h"
#include "tools/program/program.h"
#include "tools/program/progress.h"
#include "tools/silhouette-db/calibration_files/calibration_files.h"

namespace silhouette {
namespace {

// Robot images that a calibration is put to the test by.
constexpr size_t kSamples = 400;
// Share of the robot's pixels that may contradict: rims that differencing lost, never a calibration
// that is worth having.
constexpr double kMostContradicting = 0.001;

using Run = EpipolarBands::Run;

bool At(const Mask& mask, size_t pixel) {
  return (mask.words()[pixel / 64] >> (pixel % 64) & 1) != 0;
}

// Per bin of the pair how many bins before it meet the robot in `other`.
std::vector<int> BinsBefore(const Mask& robot, const EpipolarBands& bands, int view, int other) {
  const size_t bins = static_cast<size_t>(bands.bins(view, other));
  std::vector<int> starts(bins + 1, 0);  // runs that start less runs that end, per bin
  const auto runs = bands.runs(other, view);
  for (size_t q = 0; q < runs.size(); ++q) {
    if (!At(robot, q)) continue;
    for (const Run& run : runs[q]) {
      ++starts[run.begin];
      --starts[run.end];
    }
  }
  std::vector<int> before(bins + 1, 0);
  int open = 0;
  for (size_t bin = 0; bin < bins; ++bin) {
    open += starts[bin];
    before[bin + 1] = before[bin] + (open > 0 ? 1 : 0);
  }
  return before;
}

void Add(const std::vector<Mask>& robot, ConfigurationNumber number, const EpipolarBands& bands,
         PairContradictions& pair) {
  const Mask& there = robot[static_cast<size_t>(pair.other)];
  if (there.Empty() || TouchesBorder(there)) return;
  const size_t contradicting = ContradictingPixels(robot, bands, pair.view, pair.other).Count();
  ++pair.configurations;
  pair.pixels += robot[static_cast<size_t>(pair.view)].Count();
  pair.contradicting += contradicting;
  if (contradicting > pair.worst_contradicting) {
    pair.worst = number;
    pair.worst_contradicting = contradicting;
  }
}

// Numbers of records with masks, at most `most`, spread over all of them. Reads all records.
absl::StatusOr<std::vector<ConfigurationNumber>> SampledRecords(const Snapshot& snapshot,
                                                                size_t most) {
  std::vector<ConfigurationNumber> chosen;
  uint64_t met = 0;
  const absl::Status status =
      snapshot.ForEach([&](ConfigurationNumber number, const absl::StatusOr<RobotImage>& image) {
        const bool due = ++met * most / snapshot.size() > chosen.size();
        if (due && image.ok() && !image->excluded) chosen.push_back(number);
        return !StopRequested();
      });
  if (!status.ok() && !absl::IsDataLoss(status)) return status;
  return chosen;
}

// Numbers of captured configurations, at most `most`, spread over the grid; the same ones each
// time. Not all after Ctrl-C.
absl::StatusOr<std::vector<ConfigurationNumber>> SampledConfigurations(const Database& database,
                                                                       const Snapshot& snapshot,
                                                                       size_t most) {
  const ConfigurationNumber limit = database.grid().number_limit();
  const uint64_t records = snapshot.size();
  // Of few records in a large grid, reading all takes less than looking for some.
  if (records == 0 || most * limit / records > records) return SampledRecords(snapshot, most);
  // Steps of the golden section visit every number once, and are well spread wherever one stops.
  ConfigurationNumber step = std::max<ConfigurationNumber>(
      1, static_cast<ConfigurationNumber>(0.6180339887498949 * static_cast<double>(limit)));
  while (std::gcd(step, limit) != 1) ++step;
  std::vector<ConfigurationNumber> chosen;
  ConfigurationNumber number = 0;
  for (ConfigurationNumber i = 0; i < limit && chosen.size() < most && !StopRequested(); ++i) {
    if (database.grid().Contains(number)) {
      const auto image = snapshot.Find(number);
      if (!image.ok() && !absl::IsDataLoss(image.status())) return image.status();
      if (image.ok() && *image && !(*image)->excluded) chosen.push_back(number);
    }
    number = (number + step) % limit;
  }
  return chosen;
}

// Over `configurations`, not all of them after Ctrl-C; damaged records are left out.
absl::StatusOr<Contradictions> FindContradictions(
    const Snapshot& snapshot, const EpipolarBands& bands,
    const std::vector<ConfigurationNumber>& configurations) {
  Contradictions found;
  for (int view = 0; view < bands.views(); ++view) {
    for (int other = 0; other < bands.views(); ++other) {
      if (view == other || !bands.Known(view, other)) continue;
      found.pairs.push_back({.view = view, .other = other});
    }
  }
  if (configurations.empty()) return found;
  Progress progress("check", configurations.size(), "configurations");
  for (const ConfigurationNumber number : configurations) {
    if (StopRequested()) break;
    const auto image = snapshot.Find(number);
    if (!image.ok() && !absl::IsDataLoss(image.status())) return image.status();
    if (!image.ok() || !*image || (*image)->excluded) continue;
    for (PairContradictions& pair : found.pairs) Add((*image)->masks, number, bands, pair);
    progress.Update(++found.configurations);
  }
  return found;
}

}  // namespace

double PairContradictions::share() const {
  return pixels == 0 ? 0 : static_cast<double>(contradicting) / static_cast<double>(pixels);
}

uint64_t Contradictions::pixels() const {
  uint64_t sum = 0;
  for (const PairContradictions& pair : pairs) sum += pair.pixels;
  return sum;
}

const PairContradictions* Contradictions::worst() const {
  const auto worst = std::max_element(pairs.begin(), pairs.end(), [](const auto& a, const auto& b) {
    return a.share() < b.share();
  });
  return pixels() == 0 ? nullptr : &*worst;
}

Mask ContradictingPixels(const std::vector<Mask>& robot, const EpipolarBands& bands, int view,
                         int other) {
  const Mask& here = robot[static_cast<size_t>(view)];
  const std::vector<int> before = BinsBefore(robot[static_cast<size_t>(other)], bands, view, other);
  const auto runs = bands.runs(view, other);
  std::vector<uint64_t> words(here.size().words(), 0);
  for (size_t p = 0; p < runs.size(); ++p) {
    if (!At(here, p)) continue;
    const bool met = std::any_of(runs[p].begin(), runs[p].end(), [&](const Run& run) {
      return before[run.end] > before[run.begin];
    });
    if (!met) words[p / 64] |= uint64_t{1} << (p % 64);
  }
  return Mask::FromWords(here.size(), std::move(words));
}

absl::StatusOr<TestedCalibration> TestCalibration(const Database& database,
                                                  const Snapshot& snapshot,
                                                  const storage::v1::Calibration& stored,
                                                  double margin) {
  ASSIGN_OR_RETURN(Calibration calibration, CalibrationFrom(stored));
  RETURN_IF_ERROR(CheckLines(calibration, database.cell()));
  EpipolarBands bands(calibration, database.mask_sizes(), margin);
  ASSIGN_OR_RETURN(std::vector<ConfigurationNumber> samples,
                   SampledConfigurations(database, snapshot, kSamples));
  ASSIGN_OR_RETURN(const auto drawn, snapshot.DrawnImages());
  ASSIGN_OR_RETURN(
      Contradictions found,
      FindContradictions(snapshot, bands, drawn ? std::vector<ConfigurationNumber>() : samples));
  if (StopRequested()) return absl::CancelledError("stopped; run it again");
  return TestedCalibration{std::move(calibration), std::move(bands), std::move(samples),
                           std::move(found)};
}

std::string ContradictionText(const Contradictions& found,
                              const storage::v1::CellDescription& cell) {
  if (found.configurations == 0) {
    return "there are no captured robot images to test the calibration with";
  }
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
