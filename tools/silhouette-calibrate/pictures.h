// SPDX-License-Identifier: Apache-2.0
// Pictures of what the commands find.
#pragma once

#include <map>
#include <opencv2/core/mat.hpp>
#include <span>
#include <string>
#include <vector>

#include "calib/camera/calibration.h"
#include "calib/detection/image_tags.h"
#include "calib/fundamental/tag_drift.h"
#include "calib/fundamental/view_pairs.h"
#include "calib/intrinsics/solve_lenses.h"
#include "common/picture/picture.h"

namespace silhouette {

struct BandPictures {
  const std::vector<PairedView>& views;
  const Calibration& calibration;
  double margin = 0;  // mask pixels
  // Corners that are marked: of `frame`, or of all frames if it is empty.
  std::span<const TagSighting> sightings;
  std::string frame;
  std::map<std::string, Picture> images;  // by view; views without one are drawn plain
};

// The views `a` and `b` side by side: above some pixels of a and their bands in b, below the other
// way round. Pixels at which both saw the corner of a tag, whose place in the other view is marked,
// where there are any.
Picture PaintBands(const BandPictures& pictures, int a, int b);

// The image with the tags' outlines, ids and corners; `image` as it was looked at.
Picture PictureOfTags(const cv::Mat& image, const ImageTags& tags);

// All corners that a view has seen, over the cells of its coverage.
Picture PictureOfCoverage(const std::string& view, const Coverage& coverage);

// Each residual (pixels) as a line from its corner to where it was projected, lengthened so that
// the `rms` per axis can be seen, no line longer than 120 pixels of the picture. Fields of the
// image are darker the more corners they have, and white without any.
Picture PictureOfResiduals(const std::string& view, PixelSize image, double rms,
                           const std::vector<LensResidual>& residuals, const std::string& caption);

// Where the lens is known, and how well: the darker, the less.
Picture PictureOfLensMap(const SolvedCamera& camera);

// Arrows from where corners were to where they are, lengthened so that they can be seen.
Picture PaintDrift(const ViewDrift& drift, const ViewSizes& sizes, double limit_mask);

}  // namespace silhouette
