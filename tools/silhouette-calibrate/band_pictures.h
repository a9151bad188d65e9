// Pictures that show whether epipolar bands are where they should be: a pixel here, its band there.
#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "calib/camera/calibration.h"
#include "common/picture/picture.h"
#include "tools/silhouette-calibrate/fundamental_views.h"

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

}  // namespace silhouette
