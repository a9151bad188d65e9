// SPDX-License-Identifier: Apache-2.0
// Rendered boards of each kind, as a camera sees them that somebody shows a board to: what
// detection finds of them, what lens follows, and what OpenCV makes of the same images.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "calib/boards/board.h"
#include "tools/silhouette-experiments/calibration/error_lines.h"

namespace silhouette::calibration_experiment {

struct BoardLine {
  const char* name;
  const char* meaning;
  Board board;
};

// One of each kind that detection reads.
const std::vector<BoardLine>& BoardLines();

// Of corners that were looked for in images.
class CornerCount {
 public:
  void AddImage(size_t visible) { visible_ += visible; }
  // A corner that is there; `error`: from where it is, pixels.
  void AddFound(double error) { errors_.push_back(error); }
  void AddFalse() { ++false_; }

  size_t visible() const { return visible_; }
  size_t found() const { return errors_.size(); }
  size_t false_corners() const { return false_; }
  double ShareFound() const;
  double Rms() const;                     // per axis, pixels
  double Percentile(int per_cent) const;  // of the distance, pixels; 0 of none

 private:
  size_t visible_ = 0;
  size_t false_ = 0;
  std::vector<double> errors_;
};

struct BoardResult {
  CornerCount corners;
  ChiSquared stated;      // of the errors of the corners found, against their stated sigma
  CornerCount of_opencv;  // without visible corners: OpenCV does not read the board
  LineResult lens;        // others: cv::calibrateCamera with OpenCV's corners
};

// Adds a session of `images` images of 1280 x 960 pixels. The board is as wide as a sixth to two
// thirds of the image, tilted by up to 50 degrees, turned by chance; in every third image a part of
// it may be outside, but for chessboards and circles. Internal: a solver failed.
absl::Status MeasureBoardLine(const BoardLine& line, int images, uint64_t seed,
                              BoardResult& result);

}  // namespace silhouette::calibration_experiment
