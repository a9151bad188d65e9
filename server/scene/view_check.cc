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
// With three views and more the limit is that many times most_robot_missing: there are more views
// in which someone may hide some of it.
constexpr double kOfManyViews = 1.7;

// Of the pixels which the robot certainly covers, its base apart.
struct RobotPixels {
  size_t expected = 0;
  size_t missing = 0;  // show background

  double share() const {
    return missing == 0 ? 0 : static_cast<double>(missing) / static_cast<double>(expected);
  }
};

RobotPixels RobotPixelsOf(const ViewToCheck& view) {
  if (view.foreground == nullptr || view.robot == nullptr) return {};
  Mask expected = view.robot->certain;
  if (view.ignored != nullptr) expected = expected - *view.ignored;
  if (view.base != nullptr) expected = expected - *view.base;
  const RobotPixels pixels{expected.Count(), (expected - *view.foreground).Count()};
  return pixels.expected < kFewestRobotPixels ? RobotPixels() : pixels;
}

void CheckRobot(std::span<const ViewToCheck> views, double most_missing,
                std::vector<SceneDefect>& defects) {
  std::vector<RobotPixels> robot;
  size_t pixels = 0;
  double sum = 0;
  double greatest = 0;
  for (const ViewToCheck& view : views) {
    robot.push_back(RobotPixelsOf(view));
    pixels += robot.back().missing;
    sum += robot.back().share();
    greatest = std::max(greatest, robot.back().share());
  }
  const double missing = views.size() > 1 ? sum - greatest : sum;
  const double limit = views.size() > 2 ? kOfManyViews * most_missing : most_missing;
  if (pixels < kFewestMissingPixels || missing <= limit) return;
  for (size_t view = 0; view < views.size(); ++view) {
    if (robot[view].missing == 0) continue;
    defects.push_back(
        {Reason::kRobotElsewhere,
         absl::StrFormat("view '%s' shows the empty cell on %.0f %% of the pixels where the robot "
                         "should be: let the robot report its true joints, and scenes state its "
                         "variant",
                         views[view].name, 100 * robot[view].share())});
  }
}

class ViewCheck {
 public:
  ViewCheck(const ViewToCheck& view, const ViewCheckSettings& settings)
      : view_(view), settings_(settings) {}

  std::vector<SceneDefect> Defects(std::span<const std::string> names) {
    if (view_.condition != nullptr) CheckImage(*view_.condition, names);
    if (view_.foreground != nullptr) CheckForeground(*view_.foreground);
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

  void CheckForeground(const Mask& foreground) {
    Mask others = view_.ignored != nullptr ? foreground - *view_.ignored : foreground;
    if (view_.robot != nullptr) others = others - view_.robot->anywhere;
    const double share =
        static_cast<double>(others.Count()) / static_cast<double>(foreground.size().pixels());
    if (share <= settings_.most_foreground || !defects_.empty()) return;
    Add(Reason::kViewCovered,
        absl::StrFormat("differs from its reference on %.0f %% of its pixels, more than people do: "
                        "its lens is covered, its camera turned, or the light changed",
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
  CheckRobot(views, settings.most_robot_missing, defects);
  return defects;
}

}  // namespace silhouette
