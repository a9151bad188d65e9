// SPDX-License-Identifier: Apache-2.0
#include "calib/fundamental/correspondences.h"

#include <algorithm>
#include <map>
#include <stdexcept>
#include <tuple>

#include "calib/boards/board.h"

namespace silhouette {
namespace {

constexpr double kUsualSigma = 0.1;  // pixels

using TagInFrame = std::tuple<std::string, std::string, int>;  // frame, family, id

std::map<TagInFrame, const TagSighting*> SightingsOf(std::span<const TagSighting> sightings,
                                                     const std::string& view) {
  std::map<TagInFrame, const TagSighting*> found;
  for (const TagSighting& sighting : sightings) {
    if (sighting.view != view) continue;
    if (!found.emplace(TagInFrame{sighting.frame, sighting.family, sighting.tag}, &sighting)
             .second) {
      throw std::invalid_argument("view '" + view + "' has tag " + std::to_string(sighting.tag) +
                                  " of " + sighting.family + " twice in frame '" + sighting.frame +
                                  "': every tag may be in the cell only once, and no mirror");
    }
  }
  return found;
}

double SigmaOf(const TagSighting& sighting) {
  return sighting.sigma > 0 ? sighting.sigma : kUsualSigma;
}

}  // namespace

ViewPair CornersOfPair(std::span<const TagSighting> sightings, const std::string& view_a,
                       const std::string& view_b) {
  const auto in_a = SightingsOf(sightings, view_a);
  const auto in_b = SightingsOf(sightings, view_b);
  ViewPair pair{.view_a = view_a, .view_b = view_b, .frames = {}, .corners = {}};
  int tags = 0;
  for (const auto& [key, a] : in_a) {  // by frame, as the keys are sorted
    const auto found = in_b.find(key);
    if (found == in_b.end()) continue;
    const TagSighting* b = found->second;
    if (IsAmbiguousFamily(a->family) || a->corners.size() != b->corners.size()) continue;
    if (pair.frames.empty() || pair.frames.back() != a->frame) pair.frames.push_back(a->frame);
    for (size_t i = 0; i < a->corners.size(); ++i) {
      pair.corners.push_back({.a = a->corners[i],
                              .b = b->corners[i],
                              .sigma_a = SigmaOf(*a),
                              .sigma_b = SigmaOf(*b),
                              .frame = static_cast<int>(pair.frames.size()) - 1,
                              .tag = tags});
    }
    ++tags;
  }
  return pair;
}

std::vector<Correspondence> Chosen(std::span<const Correspondence> corners,
                                   const std::vector<bool>& which) {
  std::vector<Correspondence> chosen;
  for (size_t i = 0; i < corners.size(); ++i) {
    if (which[i]) chosen.push_back(corners[i]);
  }
  return chosen;
}

std::vector<std::string> ViewsOf(std::span<const TagSighting> sightings) {
  std::vector<std::string> views;
  for (const TagSighting& sighting : sightings) {
    if (std::ranges::find(views, sighting.view) == views.end()) {
      views.push_back(sighting.view);
    }
  }
  return views;
}

}  // namespace silhouette
