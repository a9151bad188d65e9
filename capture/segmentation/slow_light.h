// SPDX-License-Identifier: Apache-2.0
// SlowLight: what slow changes of the light - the sun that moves on, lamps that age - have made of
// the reference's brightness, place by place.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <vector>

#include "capture/segmentation/reference.h"

namespace silhouette {

// A coarse grid of factors over the image, between which it is interpolated. It follows the light
// only where nothing but the empty cell is seen, only slowly, and only within limits. What stands
// in the cell does not teach it, however long it stands there. Where it hides the cell the light is
// only estimated: what happens to be as bright, and as plain, as the cell would be by that estimate
// is background meanwhile; if it moves then, it may be taken for the cell. Immutable: learning
// gives a new one.
class SlowLight {
 public:
  static constexpr int kColumns = 8;
  static constexpr int kRows = 6;
  // Most that a factor changes within a second, and that it may be away from 1.
  static constexpr double kRate = 0.005;
  static constexpr double kMost = 0.4;
  // Shares of the reference's brightness, see Learn().
  static constexpr double kLeft = 0.04;
  static constexpr double kSame = 0.01;

  // As at the reference: 1 everywhere.
  SlowLight() = default;

  // Whether it is 1 everywhere.
  bool none() const { return factors_.empty(); }
  // The factor of the grey levels of pixel (x, y) in an image of `size`.
  double At(double x, double y, cv::Size size) const;
  // The factors of a row of pixels, by the same.
  void Row(int y, cv::Size size, std::span<float> factors) const;

  // The light after an image that was taken `seconds` after the one before. `foreground` is what
  // GradedForeground() made of it: what is not 0, and what is near it, teaches nothing, nor do
  // saturated, dark and undefined pixels, nor a place most of which was hidden: what hid it may be
  // there still. Such a place counts again once its brightness is within kSame of its factor
  // before, or by kLeft outside all that it has been since. If neither happens after what hid it
  // has left, the place stays unlearnt, which is the safe side, until a new SlowLight begins. Where
  // too little is left, the light changes as it does elsewhere: by the plane through the other
  // places' factors; if there are too few of these, not at all. What the whole image's brightness
  // has become is left out, so that the factors are 1 on the average: that is followed in every
  // image. The time constant of learning is 20 s. Throws std::invalid_argument if image, reference
  // and foreground differ in size, or the first two in channels.
  SlowLight Learn(const cv::Mat& image, const Reference& reference, const cv::Mat& foreground,
                  double seconds) const;

 private:
  // Of a place: its brightness since, as a share of the reference's, and its factor before.
  struct Hidden {
    double least = 1;
    double greatest = 1;
    double factor = 1;
  };

  std::vector<double> factors_;                // row by row; empty: 1
  std::vector<std::optional<Hidden>> hidden_;  // likewise; empty: none is
};

}  // namespace silhouette
