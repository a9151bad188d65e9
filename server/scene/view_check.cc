// SPDX-License-Identifier: Apache-2.0
#include "server/scene/view_check.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace silhouette {
namespace {

// Of fewer pixels that should show the robot, nothing follows; nor if fewer than that do not: rims.
constexpr size_t kFewestRobotPixels = 15;
constexpr size_t kFewestMissingPixels = 4;

class ViewCheck {
 public:
  ViewCheck(const ViewToCheck& view, const ViewCheckSettings& settings)
      : view_(view), settings_(settings) {}

  std::vector<SceneDefect> Defects(std::span<const std::string> names) {
    if (view_.condition != nullptr) CheckImage(*view_.condition, names);
    if (view_.foreground != nullptr) {
      CheckForeground(*view_.foreground);
      if (view_.robot != nullptr) CheckRobot(*view_.foreground, *view_.robot);
    }
    return std::move(defects_);
  }

 private:
  template <typename... Words>
  void Add(Reason reason, const Words&... words) {
    defects_.push_back({reason, absl::StrCat("view '", view_.name, "' ", words...)});
  }

  void CheckImage(const ImageCondition& image, std::span<const std::string> names) {
    if (image.saturated > settings_.most_saturated) {
      Add(Reason::kLightChanged,
          absl::StrFormat("is saturated on %.0f %% of its pixels: shade the camera from the light, "
                          "or shorten its exposure",
                          100 * image.saturated));
    } else if (image.gain < settings_.least_gain || image.gain > settings_.greatest_gain) {
      Add(Reason::kLightChanged,
          absl::StrFormat("is %.2f times as bright as its reference: the light or the camera's "
                          "exposure changed, or its lens is covered; restore it, or take the "
                          "references and robot images again",
                          image.gain));
    }
    if (!image.structure) return;
    if (image.other) {
      Add(Reason::kViewsSwapped, "shows what view '", names[*image.other],
          "' should: exchange their cameras");
    } else if (image.shift > settings_.most_shift) {
      Add(Reason::kCameraMoved,
          absl::StrFormat("shows the cell moved by %.1f pixels of its image: turn its camera back, "
                          "or capture references and robot images again",
                          image.shift));
    } else if (*image.structure < settings_.least_structure && defects_.empty()) {
      Add(Reason::kViewCovered,
          absl::StrFormat("shows %.0f %% of the cell's structure: its lens is covered or out of "
                          "focus, its camera turned, or something stands close before it",
                          100 * std::max(0.0, *image.structure)));
    }
  }

  Mask Counted(const Mask& pixels) const {
    return view_.ignored != nullptr ? pixels - *view_.ignored : pixels;
  }

  void CheckForeground(const Mask& foreground) {
    Mask others = Counted(foreground);
    if (view_.robot != nullptr) others = others - view_.robot->anywhere;
    const double share =
        static_cast<double>(others.Count()) / static_cast<double>(foreground.size().pixels());
    if (share <= settings_.most_foreground || !defects_.empty()) return;
    Add(Reason::kViewCovered,
        absl::StrFormat("differs from its reference on %.0f %% of its pixels, more than people do: "
                        "its lens is covered, its camera turned, or the light changed",
                        100 * share));
  }

  void CheckRobot(const Mask& foreground, const RobotCover& robot) {
    Mask expected_pixels = Counted(robot.certain);
    if (view_.base != nullptr) expected_pixels = expected_pixels - *view_.base;
    const size_t expected = expected_pixels.Count();
    if (expected < kFewestRobotPixels) return;
    const size_t missing = (expected_pixels - foreground).Count();
    const double share = static_cast<double>(missing) / static_cast<double>(expected);
    if (missing < kFewestMissingPixels || share <= settings_.most_robot_missing) return;
    Add(Reason::kRobotElsewhere,
        absl::StrFormat("shows the empty cell on %.0f %% of the pixels where the robot should be: "
                        "let the robot report its true joints, and scenes state its variant",
                        100 * share));
  }

  const ViewToCheck& view_;
  const ViewCheckSettings& settings_;
  std::vector<SceneDefect> defects_;
};

}  // namespace

std::vector<SceneDefect> CheckViews(std::span<const ViewToCheck> views,
                                    std::span<const std::string> names,
                                    const ViewCheckSettings& settings) {
  std::vector<SceneDefect> defects;
  for (const ViewToCheck& view : views) {
    std::ranges::move(ViewCheck(view, settings).Defects(names), std::back_inserter(defects));
  }
  const auto elsewhere = [](const SceneDefect& defect) {
    return defect.reason == Reason::kRobotElsewhere;
  };
  if (views.size() > 1 && std::ranges::count_if(defects, elsewhere) == 1) {
    std::erase_if(defects, elsewhere);
  }
  return defects;
}

}  // namespace silhouette
