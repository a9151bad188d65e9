// SPDX-License-Identifier: Apache-2.0
#include "calib/fundamental/view_pairs.h"

#include <utility>

#include "absl/strings/str_format.h"
#include "calib/fundamental/correspondences.h"
#include "calib/fundamental/epipolar_geometry.h"

namespace silhouette {
namespace {

constexpr double kModelReach = 10;  // metres before a camera

void PairFromModels(const PairedView& a, const PairedView& b, const ViewPair& seen,
                    const PairSettings& settings, PairResult& result) {
  result.f = FundamentalBetween(*a.camera, *b.camera);
  result.bow = BowBetween(*a.camera, *b.camera, a.sizes, b.sizes, kModelReach);
  result.margin = settings.undistorted_images ? 0 : result.bow->margin;
  if (result.margin > settings.most_margin) {
    result.refusal = absl::StrFormat(
        "distortion takes points up to %.3g px off the matrix's lines, for which a margin of %.3g "
        "mask pixels is needed, where %.3g is allowed (--max-margin); import the camera models "
        "themselves: their bands follow distortion exactly (--undistorted-images if the masks are "
        "made of undistorted images)",
        result.bow->off_lines, result.margin, settings.most_margin);
  }
  if (seen.corners.empty()) return;
  LineDistanceSum sum(a.sizes, b.sizes);
  for (const Correspondence& corner : seen.corners) {
    const auto undistorted = Undistorted(*a.camera, *b.camera, corner);
    if (undistorted) sum.Add(result.f, *undistorted);
  }
  result.distances = sum.Result();
}

void PairFromTags(const PairedView& a, const PairedView& b, const ViewPair& seen,
                  const PairSettings& settings, PairResult& result) {
  if (seen.corners.empty()) {
    result.unseen = true;
    return;
  }
  result.weak = CalibrateWeakly(seen, a.sizes, b.sizes, settings.most_margin, settings.seed);
  result.f = result.weak->f;
  result.margin = result.weak->margin;
  result.refusal = result.weak->refusal;
}

}  // namespace

std::vector<PairResult> FindPairs(const std::vector<PairedView>& views,
                                  std::span<const TagSighting> sightings,
                                  const PairSettings& settings) {
  std::vector<PairResult> pairs;
  for (size_t a = 0; a < views.size(); ++a) {
    for (size_t b = a + 1; b < views.size(); ++b) {
      PairResult result;
      result.a = static_cast<int>(a);
      result.b = static_cast<int>(b);
      const ViewPair seen = CornersOfPair(sightings, views[a].name, views[b].name);
      result.frames = static_cast<int>(seen.frames.size());
      result.corners = static_cast<int>(seen.corners.size());
      if (views[a].camera && views[b].camera) {
        PairFromModels(views[a], views[b], seen, settings, result);
      } else {
        PairFromTags(views[a], views[b], seen, settings, result);
      }
      if (result.f.norm() > 0) {
        result.f_of_masks = ScaledTo(result.f, views[a].sizes.image, views[a].sizes.mask,
                                     views[b].sizes.image, views[b].sizes.mask);
        result.f_of_masks.normalize();
      }
      pairs.push_back(std::move(result));
    }
  }
  return pairs;
}

}  // namespace silhouette
