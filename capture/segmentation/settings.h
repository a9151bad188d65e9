// SPDX-License-Identifier: Apache-2.0
// How camera images become masks. The robot images and the scenes of a cell are made with the same
// settings, so that they err in the same way.
#pragma once

#include <string>

namespace silhouette {

// What a shadow on the empty cell is.
enum class Shadows { kForeground, kIgnore };

struct SegmentationSettings {
  // A pixel is foreground if it differs from the reference by more than `noise_factor` standard
  // deviations of its own noise, and by more than `min_difference` grey levels (0..255), in any
  // channel.
  double noise_factor = 6;
  double min_difference = 8;
  // Where single pixels say nothing, the mean difference over the faint_side x faint_side pixels
  // around says foreground if it is more than this many grey levels, and more than `noise_factor`
  // standard deviations of that mean: obstacles nearly as bright as what is behind them; 0: no.
  double faint_difference = 2;
  // Likewise if their root mean square difference, beyond what is noise, is more than this many
  // grey levels: obstacles as bright as what is behind them in the mean, but not its texture; 0:
  // no.
  double texture_difference = 2.25;
  // Odd, 3 to kMostFaintSide.
  int faint_side = 9;
  static constexpr int kMostFaintSide = 15;
  // Whether a change of the whole image's brightness is taken out first.
  bool follow_brightness = true;
  // Radius, in camera pixels, of the opening that removes specks and of the closing that fills
  // pinholes; 0: none; at most kMostCleanUpRadius.
  int clean_up_radius = 1;
  static constexpr int kMostCleanUpRadius = 15;
  // In robot images the opening takes away nothing that joins what it leaves: fingers of a gripper.
  bool keep_thin_parts = true;
  // Foreground areas of fewer camera pixels are dropped.
  int min_blob_pixels = 12;
  // A mask pixel is foreground if more than this share of the camera pixels under it is; 0: any.
  double min_cover = 0;
  // With kIgnore, what FindShadows() is certain of is taken out before the clean-up.
  Shadows shadows = Shadows::kForeground;

  bool operator==(const SegmentationSettings&) const = default;
};

// One `key: value` a line in alphabetical order, as the database keeps it. Keys that came later
// than the first databases are left out where they say what LeftOutOfDescriptions() does, or change
// nothing.
std::string Describe(const SegmentationSettings& settings);

// What a key means that a description leaves out. Never to be changed: databases rest on it. Keys
// that no description leaves out have their defaults.
SegmentationSettings LeftOutOfDescriptions();

// The settings as they are written into a cell file, on one line, without what is a default:
// "segmentation: {faint_side: 11, min_difference: 6}".
std::string CellFileLine(const SegmentationSettings& settings);

}  // namespace silhouette
