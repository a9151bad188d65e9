// SPDX-License-Identifier: Apache-2.0
// From a camera image to a mask: the one way in which robot images and scenes are made.
#pragma once

#include <opencv2/core.hpp>

#include "capture/segmentation/brightness.h"
#include "capture/segmentation/reference.h"
#include "capture/segmentation/settings.h"
#include "capture/segmentation/slow_light.h"
#include "db/mask/mask.h"

namespace silhouette {

// Where `image` (grey, or blue, green, red) differs from the reference: an 8-bit image, 255 where
// foreground, else 0. In turn: the brightness of the whole image is followed, every pixel is judged
// by its own noise, specks and pinholes are cleaned up, small areas are dropped. A reference
// without colour sees the image in grey, and a grey image is compared with what is grey of the
// reference. Pixels without a reference are foreground always: nothing is known of them. Areas are
// connected over edges and corners; beyond the image's rim nothing is known and nothing is cleaned
// up. `slow_light`: what the light has slowly become since the reference was made. Throws
// std::invalid_argument if the image is not of the reference's size, or a setting is not what its
// comment says.
cv::Mat Foreground(const cv::Mat& image, const Reference& reference,
                   const SegmentationSettings& settings, const SlowLight& slow_light = {});

// Foreground() with the strength of its evidence: kStrongEvidence or kWeakEvidence
// (deviating_pixels.h) where foreground. kThinEvidence where it is not, because the clean-up's
// opening took it away, but what differs joins the foreground: the fingers of a gripper and hoses,
// and noise at rims. kShadow where it was taken out as a shadow. Else 0: the empty cell.
cv::Mat GradedForeground(const cv::Mat& image, const Reference& reference,
                         const SegmentationSettings& settings, const SlowLight& slow_light = {});

// The share of a mask pixel that must be strong for the mask pixel to be, if min_cover is less.
// Where the robot's shadow just passes the limits of single pixels, noise adds slivers of it to a
// mask pixel beside the robot image. One camera pixel of 320 x 240 is 5.3 % of a mask pixel of 64 x
// 64: it suffices if it is whole within.
inline constexpr double kStrongCover = 0.05;

// A GradedForeground() in mask pixels, by DownSample().
struct GradedMask {
  Mask all;
  // The pixels of it that rest on strong evidence, on more than kStrongCover of their area.
  Mask strong;
  // Pixels with thin evidence or a shadow, in `all` or not: foreground where they show the robot.
  Mask thin;
};
GradedMask Graded(const cv::Mat& foreground, MaskSize mask_size, double min_cover);

// What becomes of an image on the way to its foreground. All images are 8-bit, 255 or 0.
struct ForegroundSteps {
  cv::Mat deviating;   // what differs, by itself or with what is around
  cv::Mat no_shadow;   // of that, what is no shadow
  cv::Mat foreground;  // what is left after the clean-up
  cv::Mat thin;        // what has thin evidence
  // By how much of its limit each pixel differs, DifferenceOverLimit().
  cv::Mat over_limit;
};

// Foreground() with its steps; slower.
ForegroundSteps StepsToForeground(const cv::Mat& image, const Reference& reference,
                                  const SegmentationSettings& settings);

// Foreground() as a mask of `mask_size`, by DownSample() with the settings' min_cover.
//
// Without slow light, on purpose. Only the live server subtracts learned light: it alone sees a
// gapless series of images. A captured mask must depend on its image and reference alone, so that
// Remask() makes the same mask again; light that changed during a capture is the sentinels' task. A
// published scene is a single image without a history. Where the light changed, pixels of the empty
// cell become foreground: the mask covers more, and nothing is learned away.
Mask Difference(const cv::Mat& image, const Reference& reference,
                const SegmentationSettings& settings, MaskSize mask_size);

// As Difference(), of an image that shows the robot and nothing else in the cell: with what has
// thin evidence. Without it the robot would not touch what its thin parts touch.
Mask RobotMask(const cv::Mat& image, const Reference& reference,
               const SegmentationSettings& settings, MaskSize mask_size);

// How close the decisions about an image's pixels are.

// By how many times its limit each pixel differs, by itself or with what is around it, whichever
// says more: CV_32FC1, at most kFarBeyond. What DeviatingPixels() finds is above 1, all else is
// not, but for what rounding leaves open; undefined pixels are kFarBeyond. For people to look at:
// in floating-point numbers, and slow. `image`: 8-bit, of the reference's size and channels. The
// settings are taken to be valid.
inline constexpr float kFarBeyond = 100;
cv::Mat DifferenceOverLimit(const cv::Mat& image, const Reference& reference,
                            const Brightness& brightness, const SegmentationSettings& settings);

}  // namespace silhouette
