// SPDX-License-Identifier: Apache-2.0
#include "server/scene/what_is_missed.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace silhouette {
namespace {

// How thick parts of a slim adult are, in metres: rough, and rather too thin than too thick.
struct PartOfPerson {
  const char* name;
  double thickness;
};
constexpr PartOfPerson kPartsOfPeople[] = {
    {"a finger", 0.015}, {"a hand", 0.022}, {"a forearm", 0.07}, {"a head", 0.14}, {"a body", 0.18},
};

// "a finger, a hand and a forearm are thinner"
std::string ThinnerThan(double thickness) {
  std::vector<std::string> thinner;
  for (const PartOfPerson& part : kPartsOfPeople) {
    if (part.thickness < thickness) thinner.emplace_back(part.name);
  }
  if (thinner.empty()) return "no part of a person is thinner";
  const std::string last = thinner.back();
  thinner.pop_back();
  if (thinner.empty()) return absl::StrCat(last, " is thinner");
  return absl::StrCat(absl::StrJoin(thinner, ", "), " and ", last, " are thinner");
}

}  // namespace

std::string WhatIsMissed(const Policy& policy, int views, double least_obstacle) {
  if (IsSound(policy.preset)) {
    const double thickness = 2 * least_obstacle;
    return absl::StrFormat(
        "an obstacle that the robot hides is found if it is at least %.3f m thick; %s. What is "
        "thinner is missed where the robot hides it from more than %d of %d views",
        thickness, ThinnerThan(thickness), MaxOccludedViews(policy, views), views);
  }
  if (IsCalibrated(policy.preset)) {
    return "an obstacle of any size, such as a hand close to the robot, is missed where the robot "
           "hides it from all views";
  }
  return absl::StrFormat(
      "an obstacle of any size, such as a hand close to the robot, is missed where the robot hides "
      "it from more than %d of %d views",
      views - MinViews(policy, views), views);
}

}  // namespace silhouette
