// SPDX-License-Identifier: Apache-2.0
// NoiseModel: how large the errors in a bundle are, by the data themselves.
//
// What the sightings state of their sigma is true of detection, not of print, paper and lens.
// Therefore it only weighs the corners of a part against each other; the noise of the part is a
// variance component that the residuals give. What is stated of robot and survey is a floor: an
// exact robot is not known to be exact.
#pragma once

#include "calib/poses/pose_bundle.h"

namespace silhouette {

// The sigma of a corner of which the sightings state `stated`: where a part is noisier than stated,
// every corner has the excess too; where it is less noisy, all are so by the same factor.
double CornerSigma(double stated, double part_stated, double part_sigma);

// Sorts the corners into parts, with the sigma with which every solve begins, whatever was stated.
void AddParts(Bundle& bundle);

// How many times the stated sigmas the errors are.
struct NoiseFactors {
  double image = 0;
  double robot = 0;         // 0: not known
  double survey = 0;        // 0: not known
  double chi2_per_dof = 0;  // with the sigmas of robot and survey as stated
};

class NoiseModel {
 public:
  // Changes the sigmas of the bundle's corners, flanges and board poses; it must outlive this.
  explicit NoiseModel(Bundle& bundle) : bundle_(bundle) {}

  enum class By {
    kMedians,  // outliers do no harm
    kSquares,  // exact, where they are marked
  };
  // At a minimum with its statistics. Returns whether a sigma changed so much that it is to be
  // adjusted again.
  bool Estimate(const BundleStatistics& statistics, By by);

  // At a minimum with its statistics.
  NoiseFactors Factors(const BundleStatistics& statistics) const;

 private:
  bool EstimateParts(const BundleStatistics& statistics, By by);

  Bundle& bundle_;
  double robot_scale_ = 1;
  double survey_scale_ = 1;
};

}  // namespace silhouette
