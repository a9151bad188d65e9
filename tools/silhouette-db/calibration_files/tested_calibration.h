// SPDX-License-Identifier: Apache-2.0
// A calibration put to the test by the robot images: what a view shows of the robot must lie on an
// epipolar band that shows it in every other view. With any-touch masks and a right calibration no
// pixel contradicts; a camera that moved or two views taken for each other make many do.
//
// Where the robot reaches the rim of the other view's image, or is not in it, it may be beyond the
// rim, and nothing can be said.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "calib/camera/calibration.h"
#include "db/store/store.h"
#include "server/collision/epipolar_bands.h"

namespace silhouette {

// Robot pixels of `view`, looked for in `other`.
struct PairContradictions {
  int view = 0;
  int other = 0;
  uint64_t configurations = 0;  // in which something could be said
  uint64_t pixels = 0;
  uint64_t contradicting = 0;
  // The configuration with the most contradicting pixels, and how many; nothing if there are none.
  std::optional<ConfigurationNumber> worst = std::nullopt;
  uint64_t worst_contradicting = 0;

  double share() const;  // contradicting / pixels, 0 of 0 is 0
};

struct Contradictions {
  uint64_t configurations = 0;            // looked at
  std::vector<PairContradictions> pairs;  // every ordered pair that has lines

  uint64_t pixels() const;  // looked for, over all pairs
  // The pair with the largest share; nullptr if no pixel was looked for.
  const PairContradictions* worst() const;
};

// The pixels of the robot in `view` whose band in `other` meets no robot pixel; `robot`: the robot
// images of one configuration, one per view.
Mask ContradictingPixels(const std::vector<Mask>& robot, const EpipolarBands& bands, int view,
                         int other);

// With its bands, and what the robot images say of them.
struct TestedCalibration {
  Calibration calibration;
  EpipolarBands bands;
  std::vector<ConfigurationNumber> samples;
  Contradictions contradictions;
};

// `margin`: mask pixels by which pixels are widened. Drawn robot images are not looked at: they
// show the calibration that they were drawn from. InvalidArgument: there are no lines between two
// views (CheckLines). Cancelled after Ctrl-C.
absl::StatusOr<TestedCalibration> TestCalibration(const Database& database,
                                                  const Snapshot& snapshot,
                                                  const storage::v1::Calibration& stored,
                                                  double margin);

// "0.031 % of 12345 robot pixels of 'top' contradict 'left'", the worst pair; or that nothing could
// be looked at.
std::string ContradictionText(const Contradictions& found,
                              const storage::v1::CellDescription& cell);

// FailedPrecondition, with the figures, if more robot pixels contradict than those of a calibration
// of these cameras, as they stood at the capture, may.
absl::Status CheckContradictions(const Contradictions& found,
                                 const storage::v1::CellDescription& cell);

}  // namespace silhouette
