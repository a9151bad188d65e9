// SPDX-License-Identifier: Apache-2.0
#include "server/scene/view_check.h"

#include <algorithm>
#include <iterator>
#include <string_view>
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
// Where the views have too few such pixels each, all but one have this share of theirs together at
// least.
constexpr double kFewPixelsMissing = 0.5;
// A robot that is there fills more than this share of what it may cover.
constexpr double kLeastSeen = 0.05;

// Of what the robot covers in a view, its base apart.
struct RobotPixels {
  size_t certain = 0;   // pixels that it covers
  size_t missing = 0;   // of these, background
  size_t anywhere = 0;  // pixels that it may cover
  size_t seen = 0;      // of these, foreground

  bool Tells() const { return certain >= kFewestRobotPixels; }
  double share() const {
    return Tells() ? static_cast<double>(missing) / static_cast<double>(certain) : 0;
  }
  bool Unseen() const {
    return static_cast<double>(seen) < kLeastSeen * static_cast<double>(anywhere);
  }
};

// Of a view that has both, foreground and robot.
RobotPixels RobotPixelsOf(const ViewToCheck& view) {
  const auto counted = [&view](Mask pixels) {
    if (view.ignored != nullptr) pixels = pixels - *view.ignored;
    return view.base != nullptr ? pixels - *view.base : pixels;
  };
  const Mask certain = counted(view.robot->certain);
  const Mask anywhere = counted(view.robot->anywhere);
  return {certain.Count(), (certain - *view.foreground).Count(), anywhere.Count(),
          (anywhere & *view.foreground).Count()};
}

// Whether views miss more of the robot than may be, each by itself.
bool MissesMuch(std::span<const RobotPixels> robot, double most_missing) {
  size_t pixels = 0;
  double sum = 0;
  double greatest = 0;
  for (const RobotPixels& view : robot) {
    if (view.Tells()) pixels += view.missing;
    sum += view.share();
    greatest = std::max(greatest, view.share());
  }
  const double missing = robot.size() > 1 ? sum - greatest : sum;
  const double limit = robot.size() > 2 ? kOfManyViews * most_missing : most_missing;
  return pixels >= kFewestMissingPixels && missing > limit;
}

// Whether all views but the one that misses most, together, miss most of the robot: what each of
// them shows of a thin robot in coarse masks may be too little.
bool MissesMostTogether(std::span<const RobotPixels> robot) {
  RobotPixels all;
  RobotPixels most;
  for (const RobotPixels& view : robot) {
    all.certain += view.certain;
    all.missing += view.missing;
    if (view.missing > most.missing) most = view;
  }
  if (robot.size() > 1) {
    all.certain -= most.certain;
    all.missing -= most.missing;
  }
  return all.Tells() && all.share() > kFewPixelsMissing;
}

// Whether all views but one, of those in which the robot may cover enough, show nothing there; of
// several views, two at least.
bool Nowhere(std::span<const RobotPixels> robot) {
  size_t able = 0;
  size_t unseen = 0;
  for (const RobotPixels& view : robot) {
    if (view.anywhere < kFewestRobotPixels) continue;
    ++able;
    if (view.Unseen()) ++unseen;
  }
  return unseen >= std::min<size_t>(robot.size(), 2) && unseen + 1 >= able;
}

void CheckRobot(std::span<const ViewToCheck> views, double most_missing,
                std::vector<SceneDefect>& defects) {
  std::vector<RobotPixels> robot;
  std::vector<std::string_view> names;
  for (const ViewToCheck& view : views) {
    if (view.foreground == nullptr || view.robot == nullptr) continue;
    const RobotPixels pixels = RobotPixelsOf(view);
    if (pixels.anywhere == 0) continue;
    robot.push_back(pixels);
    names.push_back(view.name);
  }
  const bool nowhere = Nowhere(robot);
  if (!nowhere && !MissesMuch(robot, most_missing) && !MissesMostTogether(robot)) return;
  for (size_t view = 0; view < robot.size(); ++view) {
    const RobotPixels& pixels = robot[view];
    if (pixels.missing == 0 && !(nowhere && pixels.Unseen())) continue;
    const double share =
        pixels.missing > 0
            ? static_cast<double>(pixels.missing) / static_cast<double>(pixels.certain)
            : 1 - static_cast<double>(pixels.seen) / static_cast<double>(pixels.anywhere);
    defects.push_back(
        {Reason::kRobotElsewhere,
         absl::StrFormat("view '%s' shows the empty cell on %.0f %% of the pixels where the robot "
                         "should be: let the robot report its true joints, and scenes state its "
                         "variant",
                         names[view], 100 * share)});
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
