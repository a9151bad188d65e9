// SPDX-License-Identifier: Apache-2.0
#include "capture/session/first_look.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/picture/picture.h"

namespace silhouette {
namespace {

constexpr char kHowToGoOn[] =
    "; none of these images was stored (see 'first_look' in docs/cell.yaml)";

// The connected areas of a mask, neighbours at corners included, that lie wholly in `within`.
Mask AreasWithin(const Mask& mask, const Mask& within) {
  cv::Mat labels;
  const int areas = cv::connectedComponents(MaskImage(mask), labels);
  std::vector<bool> inside(static_cast<size_t>(areas), true);
  for (int y = 0; y < mask.height(); ++y) {
    for (int x = 0; x < mask.width(); ++x) {
      if (!within.at(x, y)) inside[static_cast<size_t>(labels.at<int>(y, x))] = false;
    }
  }
  return Mask::FromPredicate(mask.size(), [&](int x, int y) {
    return mask.at(x, y) && inside[static_cast<size_t>(labels.at<int>(y, x))];
  });
}

std::string Quoted(const std::vector<std::string>& names) {
  return absl::StrCat("'", absl::StrJoin(names, "', '"), "'");
}

}  // namespace

size_t FirstLook::LeastArea(const Mask& mask) const {
  const double least = settings_.least_area * static_cast<double>(mask.size().pixels());
  return std::max<size_t>(1, static_cast<size_t>(std::lround(least)));
}

std::string FirstLook::Configurations() const {
  return absl::StrCat("configurations ", absl::StrJoin(numbers_, ", "));
}

std::string FirstLook::Add(ConfigurationNumber number, const std::vector<Mask>& masks) {
  numbers_.push_back(number);
  masks_.push_back(masks);
  bool seen = false;
  std::vector<std::string> cut;
  for (size_t view = 0; view < masks.size(); ++view) {
    seen = seen || masks[view].Count() >= LeastArea(masks[view]);
    if (TouchesBorder(masks[view])) cut.push_back(views_[view]);
  }
  if (!seen) {
    return absl::StrCat("configuration ", number,
                        ": no view sees the robot; check that the cameras see it, that it moved, "
                        "and that the reference images show the cell without it",
                        kHowToGoOn);
  }
  if (!cut.empty() && !settings_.may_be_cut) {
    return absl::StrCat("configuration ", number, ": the border of the image cuts the robot in ",
                        Quoted(cut),
                        "; what is beyond it is in no robot image. Turn the camera, or check the "
                        "light: a change of the whole image looks alike",
                        kHowToGoOn);
  }
  return "";
}

std::string FirstLook::Compare(ConfigurationNumber number, const std::vector<Mask>& masks,
                               const std::vector<Mask>& expected) {
  if (always_robot_.empty()) always_robot_ = expected;
  for (size_t view = 0; view < masks.size(); ++view) {
    always_robot_[view] = always_robot_[view] & expected[view];
    const size_t drawn = expected[view].Count();
    if (drawn < LeastArea(masks[view])) continue;
    const auto seen = static_cast<double>(CountCommon(masks[view].words(), expected[view].words()));
    const double overlap = seen / static_cast<double>(drawn);
    if (overlap >= settings_.least_overlap) continue;
    return absl::StrFormat(
        "configuration %d: '%s' shows the robot in the wrong place: of the image that its model "
        "has there, %.0f %% is foreground, less than %.0f %%. Check the joint values that the "
        "robot reports, that each camera feeds its own view, the calibration, and that the robot "
        "contrasts with the cell%s",
        number, views_[view], 100 * overlap, 100 * settings_.least_overlap, kHowToGoOn);
  }
  return "";
}

bool FirstLook::Still(size_t view) const {
  return std::ranges::all_of(
      masks_, [&](const std::vector<Mask>& masks) { return masks[view] == masks_[0][view]; });
}

Mask FirstLook::Apart(size_t view) const {
  Mask always = masks_[0][view];
  for (const std::vector<Mask>& masks : masks_) always = always & masks[view];
  // Rims change by a pixel from image to image.
  const Mask about = Grown(always, 1);
  Mask apart = always;
  for (const std::vector<Mask>& masks : masks_) apart = apart & AreasWithin(masks[view], about);
  return always_robot_.empty() ? apart : apart & ~Grown(always_robot_[view], 1);
}

std::string FirstLook::Judge() const {
  if (numbers_.size() < 2) return "";
  std::vector<std::string> apart;
  size_t seeing = 0;
  size_t still = 0;
  for (size_t view = 0; view < views_.size(); ++view) {
    const bool seen = std::ranges::any_of(masks_, [&](const std::vector<Mask>& masks) {
      return masks[view].Count() >= LeastArea(masks[view]);
    });
    if (!seen) continue;
    ++seeing;
    if (Still(view)) {
      ++still;
    } else if (const Mask found = Apart(view); found.Count() >= LeastArea(found)) {
      apart.push_back(views_[view]);
    }
  }
  if (still == seeing) {
    return absl::StrCat(Configurations(),
                        ": all views see the same, as if the robot did not move; check that the "
                        "cameras send new images, and that they see this robot",
                        kHowToGoOn);
  }
  // Dark or glossy parts can split the robot's image in one view, hardly in most.
  if (apart.empty() || 2 * apart.size() < seeing) return "";
  return absl::StrCat(Configurations(), ": something in ", Quoted(apart),
                      " is always foreground and apart from the robot that moves. The robot, or a "
                      "person, stands in the reference images, or something was put into the cell "
                      "since; take the reference images again. If it is a fixed part of the robot, "
                      "a URDF and a calibration in the database show that it is",
                      kHowToGoOn);
}

}  // namespace silhouette
