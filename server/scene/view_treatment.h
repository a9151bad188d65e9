// How the images of one view are treated beyond Table 1: a safety margin, and pixels that prove
// nothing.
#pragma once

#include <optional>

#include "db/mask.h"

namespace silhouette {

// A safety margin as people say it: in pixels of the masks, or in metres.
struct Margin {
  double pixels = 0;
  double metres = 0;  // turned into pixels by the calibration, worst case over the workspace
};

struct ViewTreatmentSettings {
  Margin margin;
  // Of the view's mask size: pixels, such as those of a pillar before the camera, that are unknown
  // in every scene; nothing: none.
  std::optional<Mask> ignored;
};

// The same in pixels alone.
struct ViewTreatment {
  double margin = 0;
  std::optional<Mask> ignored;
};

}  // namespace silhouette
