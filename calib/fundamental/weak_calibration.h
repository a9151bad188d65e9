// Weak calibration: the fundamental matrix of two views straight from tags that both saw at once.
// Nothing of cameras, boards or robot needs to be known; lenses must not bow lines.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "calib/fundamental/correspondences.h"
#include "calib/fundamental/lens_estimate.h"
#include "calib/fundamental/line_distances.h"

namespace silhouette {

struct WeakCalibration {
  // Why there is no matrix, with the mend; nothing if there is one.
  std::optional<std::string> refusal;

  Eigen::Matrix3d f = Eigen::Matrix3d::Zero();  // x_b' F x_a = 0, pixels of the camera images
  Eigen::Matrix3d f_of_masks = Eigen::Matrix3d::Zero();
  int outliers = 0;  // corners that were not believed, of all of the pair's
  // By how much the believed corners differ from the matrix, in units of what they are said to be
  // wrong by; about 1.
  double spread = 0;
  // Corners that the matrices they are judged by were not fitted to: a fifth of the frames is left
  // out at a time, or of the tags, if there are less than ten places of a board. Frames in which
  // nothing was moved stay together.
  LineDistances held_out;
  bool frames_held_out = false;
  // Mask pixels by which the matrix may be wrong, anywhere in the images: four standard deviations
  // of what the corners say.
  double predicted_margin = 0;
  LensEstimate lenses;
  // Whether the corners show that lenses bow lines.
  bool bowed = false;
  // What the server needs as calibration.margin: the greater of predicted_margin and held_out's,
  // and what lenses that bow lines take besides.
  double margin = 0;
  std::vector<std::string> warnings;  // in plain words
};

// `most_margin`: a matrix that needs more is refused. The same seed gives the same result.
WeakCalibration CalibrateWeakly(const ViewPair& pair, const ViewSizes& a, const ViewSizes& b,
                                double most_margin, uint32_t seed);

}  // namespace silhouette
