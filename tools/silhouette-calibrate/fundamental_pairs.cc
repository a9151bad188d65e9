#include "tools/silhouette-calibrate/fundamental_pairs.h"

#include <algorithm>
#include <iostream>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/fundamental/epipolar_geometry.h"

namespace silhouette {
namespace {

using nlohmann::ordered_json;

constexpr double kFundamentalPairsReach = 10;  // metres before a camera

void FromModels(const PairedView& a, const PairedView& b, const ViewPair& seen,
                const PairSettings& settings, PairResult& result) {
  result.f = FundamentalBetween(*a.camera, *b.camera);
  result.bow = BowBetween(*a.camera, *b.camera, a.sizes, b.sizes, kFundamentalPairsReach);
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

void FromTags(const PairedView& a, const PairedView& b, const ViewPair& seen,
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

ordered_json MatrixJson(const Eigen::Matrix3d& f) {
  ordered_json rows = ordered_json::array();
  for (int row = 0; row < 3; ++row) rows.push_back({f(row, 0), f(row, 1), f(row, 2)});
  return rows;
}

ordered_json DistancesJson(const LineDistances& distances) {
  return {{"corners", distances.corners},
          {"rms_px", distances.rms},
          {"noise_px", distances.noise},
          {"median_px", distances.median},
          {"worst_px", distances.worst}};
}

ordered_json PairJson(const std::vector<PairedView>& views, const PairResult& pair) {
  ordered_json json = {{"view_a", views[static_cast<size_t>(pair.a)].name},
                       {"view_b", views[static_cast<size_t>(pair.b)].name},
                       {"frames", pair.frames},
                       {"corners", pair.corners},
                       {"unseen", pair.unseen},
                       {"refusal", nullptr}};
  if (pair.refusal) json["refusal"] = *pair.refusal;
  if (pair.f.norm() > 0) {
    json["F_of_images"] = MatrixJson(pair.f);
    json["F_of_masks"] = MatrixJson(pair.f_of_masks);
    json["margin"] = pair.margin;
  }
  if (pair.weak && pair.f.norm() > 0) {
    json["outliers"] = pair.weak->outliers;
    json["spread"] = pair.weak->spread;
    json["predicted_margin"] = pair.weak->predicted_margin;
    json["held_out"] = DistancesJson(pair.weak->held_out);
    json["held_out"]["by"] = pair.weak->frames_held_out ? "frames" : "tags";
    json["lenses_bow"] = pair.weak->bowed;
  }
  if (pair.weak) json["warnings"] = pair.weak->warnings;
  if (pair.bow) {
    json["bow"] = {{"curve_px", pair.bow->curve},
                   {"off_lines_px", pair.bow->off_lines},
                   {"margin", pair.bow->margin}};
  }
  if (pair.distances) json["distances"] = DistancesJson(*pair.distances);
  return json;
}

std::string DistancesText(const LineDistances& distances) {
  return absl::StrFormat(
      "%d corners, %.3f px rms from their lines (%.3f by the corners' own sigma), median %.3f, "
      "worst %.2f",
      distances.corners, distances.rms, distances.noise, distances.median, distances.worst);
}

std::string PairText(const PairResult& pair) {
  if (pair.unseen) return "no tag was seen by both at once: the pair has no lines";
  if (pair.weak && pair.f.norm() == 0) return "";
  std::string text;
  if (pair.weak) {
    text = absl::StrFormat("%s held out by %s; %d of %d wrong; margin %.3f mask px",
                           DistancesText(pair.weak->held_out),
                           pair.weak->frames_held_out ? "frames" : "tags", pair.weak->outliers,
                           pair.corners, pair.margin);
  } else if (pair.distances) {
    text = DistancesText(*pair.distances);
  } else {
    text = "from the camera models";
  }
  if (pair.bow && pair.bow->off_lines > 0) {
    absl::StrAppendFormat(
        &text,
        "\n  distortion bows epipolar lines by up to %.1f px and takes points up to %.1f px off "
        "the matrix's: that is\n  true of undistorted pixels only, or with a margin of %.2g mask "
        "pixels; bands of the camera models follow distortion",
        pair.bow->curve, pair.bow->off_lines, pair.bow->margin);
  }
  return text;
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
        FromModels(views[a], views[b], seen, settings, result);
      } else {
        FromTags(views[a], views[b], seen, settings, result);
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

void PrintPairs(const std::vector<PairedView>& views, const std::vector<PairResult>& pairs,
                bool refusals) {
  for (const PairResult& pair : pairs) {
    std::cout << views[static_cast<size_t>(pair.a)].name << " - "
              << views[static_cast<size_t>(pair.b)].name << ": " << PairText(pair) << "\n";
    if (pair.refusal && refusals) std::cout << "  refused: " << *pair.refusal << "\n";
    if (!pair.weak) continue;
    for (const std::string& warning : pair.weak->warnings) {
      std::cout << "  note: " << warning << "\n";
    }
  }
}

ordered_json PairsJson(const std::vector<PairedView>& views, const std::vector<PairResult>& pairs) {
  ordered_json json = {{"views", ordered_json::array()}, {"pairs", ordered_json::array()}};
  for (const PairedView& view : views) {
    const ViewSizes& sizes = view.sizes;
    json["views"].push_back({{"name", view.name},
                             {"image_size", {sizes.image.width, sizes.image.height}},
                             {"mask_size", {sizes.mask.width, sizes.mask.height}},
                             {"camera", view.camera.has_value()}});
  }
  double margin = 0;
  for (const PairResult& pair : pairs) {
    json["pairs"].push_back(PairJson(views, pair));
    if (!pair.refusal) margin = std::max(margin, pair.margin);
  }
  json["margin"] = margin;
  return json;
}

}  // namespace silhouette
