// SPDX-License-Identifier: Apache-2.0
// After down-sampling to masks of 64 x 64, the bands that the server uses hold every true
// correspondence: with camera models as they are, with weak calibration given the margin it asks
// for.
#include <gtest/gtest.h>

#include <random>

#include "calib/fundamental/epipolar_geometry.h"
#include "calib/fundamental/weak_calibration.h"
#include "server/collision/epipolar_bands.h"
#include "tests/calib/fundamental/seen_cell.h"

namespace silhouette {
namespace {

constexpr MaskSize kMask{64, 64};

int MaskPixelOf(const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d scaled = ScaledTo(pixel, {640, 480}, {64, 64});
  return static_cast<int>(std::lround(scaled.y())) * 64 + static_cast<int>(std::lround(scaled.x()));
}

// Points of the cell whose pixels' bands do not meet, of `points` that both cameras see.
int Misses(const EpipolarBands& bands, const CameraModel& a, const CameraModel& b, int points,
           uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any(-1, 1);
  int misses = 0;
  for (int seen = 0; seen < points;) {
    const Eigen::Vector3d point(2 * any(random), 2 * any(random), 1.2 + 1.2 * any(random));
    const auto at_a = a.Project(point);
    const auto at_b = b.Project(point);
    if (!at_a || !at_b || !a.Contains(*at_a) || !b.Contains(*at_b)) continue;
    ++seen;
    misses += bands.Meet(0, MaskPixelOf(*at_a), 1, MaskPixelOf(*at_b)) ? 0 : 1;
  }
  return misses;
}

TEST(Bands, OfCameraModelsHoldEveryCorrespondenceWithoutAMargin) {
  for (const double k1 : {0.0, -0.2}) {
    const auto cameras = CellCameras(k1);
    for (const size_t other : {1u, 2u}) {
      const EpipolarBands bands(
          {.cameras = {cameras[0].model, cameras[other].model}, .fundamental_matrices = {}},
          std::vector<MaskSize>{kMask, kMask});
      EXPECT_EQ(Misses(bands, cameras[0].model, cameras[other].model, 250000, 11), 0)
          << "k1 = " << k1 << ", camera " << other;
    }
  }
}

struct Session {
  size_t frames;
  double sigma;  // pixels
  double k1;
  size_t other;  // camera
};

// How many correspondences the bands of a session miss.
class WeakBands {
 public:
  explicit WeakBands(const Session& session)
      : cameras_(CellCameras(session.k1)), session_(session) {
    const BoardFrames board = CarriedBoard(cameras_, session.frames, 3, session.sigma);
    found_ = CalibrateWeakly(
        CornersOfPair(board.sightings, cameras_[0].view, cameras_[session.other].view),
        SizesOf(cameras_[0].model), SizesOf(cameras_[session.other].model), 5, 1);
  }

  const WeakCalibration& found() const { return found_; }
  int MissesWith(double margin) const {
    const EpipolarBands bands({.cameras = {}, .fundamental_matrices = {{0, 1, found_.f_of_masks}}},
                              std::vector<MaskSize>{kMask, kMask}, margin);
    return Misses(bands, cameras_[0].model, cameras_[session_.other].model, 200000, 12);
  }

 private:
  std::vector<NamedCamera> cameras_;
  Session session_;
  WeakCalibration found_;
};

TEST(Bands, OfWeakCalibrationHoldEveryCorrespondenceWithTheMarginItAsksFor) {
  // A careful session, some of few frames and corners that are worth little, and lenses that bow.
  const Session sessions[] = {{60, 0.03, 0, 1}, {15, 0.5, 0, 1},      {15, 1, 0, 2},
                              {30, 1, 0, 1},    {60, 0.03, -0.02, 1}, {60, 0.03, -0.05, 2}};
  int would_miss = 0;
  for (const Session& session : sessions) {
    const WeakBands bands(session);
    ASSERT_FALSE(bands.found().refusal) << *bands.found().refusal;
    EXPECT_EQ(bands.MissesWith(bands.found().margin), 0)
        << session.frames << " frames, " << session.sigma << " px, k1 = " << session.k1;
    would_miss += bands.MissesWith(0);
  }
  EXPECT_GT(would_miss, 0);  // or the margin would not have been put to the test
}

TEST(Bands, OfACarefulWeakCalibrationNeedFarLessThanTheServersMargin) {
  const WeakBands bands({60, 0.03, 0, 1});
  EXPECT_LT(bands.found().margin, 0.03);
}

}  // namespace
}  // namespace silhouette
