// SPDX-License-Identifier: Apache-2.0
// Doubts.
#include <algorithm>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/time/time.h"
#include "capture/devices/camera_settings.h"
#include "common/times/times.h"
#include "tools/cell/cell.h"

namespace silhouette {
namespace {

// The checks of the server that the file switches off, by their keys.
std::vector<std::string> ChecksSwitchedOff(const ServerSettings& server) {
  const ViewCheckSettings& check = server.scene.view_check;
  const LifeSettings& life = server.live.life;
  const std::pair<const char*, bool> checks[] = {
      {"view_check: least_gain", check.least_gain == 0},
      {"view_check: greatest_gain", check.greatest_gain >= 10},
      {"view_check: most_saturated", check.most_saturated == 1},
      {"view_check: least_structure", check.least_structure == 0},
      {"view_check: most_shift", check.most_shift >= 20},
      {"view_check: most_foreground", check.most_foreground == 1},
      {"view_check: most_robot_missing", check.most_robot_missing == 1},
      {"live: least_noise", life.least_noise == 0},
      {"live: least_change", life.least_change == 0}};
  std::vector<std::string> off;
  for (const auto& [key, is_off] : checks) {
    if (is_off) off.push_back(absl::StrCat("'", key, "'"));
  }
  return off;
}

// Of a view's camera; 0: it has none.
struct Delays {
  absl::Duration latency;
  absl::Duration timeout;
};

Delays DelaysOf(const ImageSource& source) {
  return std::visit(
      [](const auto& camera) {
        Delays delays;
        if constexpr (requires { camera.latency; }) delays.latency = camera.latency;
        if constexpr (requires { camera.trigger; }) {
          if (camera.trigger == CameraTrigger::kSoftware) delays.latency = absl::ZeroDuration();
        }
        if constexpr (requires { camera.timeout; }) delays.timeout = camera.timeout;
        return delays;
      },
      source);
}

std::string Called(const std::vector<std::string>& views) {
  return absl::StrCat(views.size() == 1 ? "view '" : "views '", absl::StrJoin(views, "', '"), "'");
}

// Of times after which a robot that does not report, or does not move on, is stopped.
void DoubtRobot(const Cell& cell, std::vector<std::string>& doubts) {
  constexpr absl::Duration kLong = absl::Seconds(30);
  const auto long_time = [&](const std::string& key, absl::Duration time, const std::string& what) {
    if (time <= kLong) return;
    doubts.push_back(absl::StrCat(key, ": a robot that ", what, " is stopped only after ",
                                  SpokenTime(time),
                                  "; a number without a unit is in seconds, milliseconds are "
                                  "written as '500 ms'"));
  };
  long_time("capture: arrival_timeout", cell.capture.arrival_timeout, "does not move on");
  std::visit(
      [&](const auto& driver) {
        if constexpr (requires { driver.timeout; }) {
          long_time("robot: driver: timeout", driver.timeout, "no longer reports its position");
        }
      },
      cell.robot.driver);
}

// Of cameras with which a live server's scenes are stale for long.
void DoubtSources(const Cell& cell, std::vector<std::string>& doubts) {
  const absl::Duration max_age = cell.server.scene.max_age;
  std::map<absl::Duration, std::vector<std::string>> late;    // views, by their latency
  std::map<absl::Duration, std::vector<std::string>> silent;  // views, by their timeout
  for (const ViewSettings& view : cell.views) {
    const Delays delays = DelaysOf(view.source);
    // An image is taken for as old as its latency when it comes, and the next one comes at the
    // earliest a latency later.
    if (2 * delays.latency >= 0.9 * max_age) late[delays.latency].push_back(view.name);
    if (delays.timeout >= max_age) silent[delays.timeout].push_back(view.name);
  }
  for (const auto& [latency, views] : late) {
    doubts.push_back(
        absl::StrCat(Called(views), ": with --live and a latency of ", SpokenTime(latency),
                     " a scene is more than ", SpokenTime(2 * latency),
                     " old before the next one comes, and is stale meanwhile: state a ",
                     "greater 'server: max_age' than ", SpokenTime(max_age),
                     ", or the camera's latency if it is less"));
  }
  for (const auto& [timeout, views] : silent) {
    doubts.push_back(absl::StrCat(
        Called(views), ": with --live a silent camera delays all views by its timeout, ",
        SpokenTime(timeout),
        ", and the whole cell is unknown: state a 'timeout' of less than 'server: max_age', ",
        SpokenTime(max_age)));
  }
}

// Of a limit in camera pixels that is above its default, and above what `most` says of a view.
void DoubtSize(const Cell& cell, int SegmentationSettings::*limit,
               const std::function<double(const ViewSettings&)>& most, const std::string& effect,
               std::vector<std::string>& doubts) {
  const double value = cell.segmentation.*limit;
  std::vector<std::string> views;
  double right = value;
  for (const ViewSettings& view : cell.views) {
    const double largest = std::max<double>(SegmentationSettings{}.*limit, most(view));
    if (value <= largest) continue;
    views.push_back(view.name);
    right = std::min(right, largest);
  }
  if (views.empty()) return;
  doubts.push_back(absl::StrCat("segmentation: ", effect, ": in ", Called(views),
                                " hands or whole people are missed; state ",
                                static_cast<int>(right), " or less"));
}

// Of clean-ups that take away hands. One covers more than three mask pixels, and is two of them
// wide.
void DoubtCleanUp(const Cell& cell, std::vector<std::string>& doubts) {
  const auto width = [](const ViewSettings& view) {
    return static_cast<double>(view.image_width) / view.mask_size.width;
  };
  const auto height = [](const ViewSettings& view) {
    return static_cast<double>(view.image_height) / view.mask_size.height;
  };
  const int area = cell.segmentation.min_blob_pixels;
  DoubtSize(
      cell, &SegmentationSettings::min_blob_pixels,
      [&](const ViewSettings& view) { return 3 * width(view) * height(view); },
      absl::StrCat("min_blob_pixels: ", area, " drops areas of fewer camera pixels"), doubts);
  const int radius = cell.segmentation.clean_up_radius;
  DoubtSize(
      cell, &SegmentationSettings::clean_up_radius,
      [&](const ViewSettings& view) { return std::min(width(view), height(view)) - 0.5; },
      absl::StrCat("clean_up_radius: ", radius, " removes what is thinner than ", 2 * radius + 1,
                   " camera pixels"),
      doubts);
}

// Of masks that miss what covers little, or differs little from the cell.
void DoubtLimits(const SegmentationSettings& settings, std::vector<std::string>& doubts) {
  constexpr double kSeveral = 3;  // times the default
  constexpr double kMostNoise = kSeveral * SegmentationSettings{}.noise_factor;
  constexpr double kMostDifference = kSeveral * SegmentationSettings{}.min_difference;
  if (settings.min_cover > 0) {
    doubts.push_back(absl::StrFormat(
        "segmentation: min_cover: %g: what covers less of a mask pixel is missed; leave it out",
        settings.min_cover));
  }
  if (settings.noise_factor > kMostNoise) {
    doubts.push_back(absl::StrFormat(
        "segmentation: noise_factor: %g: people who differ from the cell by less than %g times the "
        "camera's noise are missed; state %g or less",
        settings.noise_factor, settings.noise_factor, kMostNoise));
  }
  // What the single pixels do not show, the mean of those around may.
  const double least = settings.faint_difference > 0
                           ? std::min(settings.min_difference, settings.faint_difference)
                           : settings.min_difference;
  if (least > kMostDifference) {
    doubts.push_back(absl::StrFormat(
        "segmentation: min_difference: %g, faint_difference: %g: people who differ from the cell "
        "by less than %g of 255 grey levels are missed; state a min_difference of %g or less",
        settings.min_difference, settings.faint_difference, least, kMostDifference));
  }
}

// Of a payload that is drawn about several links, of which some may carry nothing: what is nearer
// to them is behind the robot in all images.
void DoubtPayload(const Cell& cell, std::vector<std::string>& doubts) {
  constexpr double kWithinMostBodies = 0.1;  // metres
  if (!cell.robot.drawn || cell.robot.payload_radius <= kWithinMostBodies) return;
  const std::vector<bool> outermost = cell.robot.model->Outermost();
  std::vector<std::string> carriers;
  for (size_t link = 0; link < outermost.size(); ++link) {
    if (outermost[link]) carriers.push_back(cell.robot.model->links()[link].name);
  }
  if (carriers.size() < 2) return;
  doubts.push_back(absl::StrFormat(
      "robot: payload_radius: %.2g m is drawn about each of the links '%s': people nearer to "
      "them are hidden; leave those that carry nothing out of the URDF",
      cell.robot.payload_radius, absl::StrJoin(carriers, "', '")));
}

// Of limits that seem to be in millimetres.
void DoubtSlides(const Cell& cell, std::vector<std::string>& doubts) {
  constexpr double kLongSlide = 10;  // metres
  for (const GridJoint& joint : cell.grid.joints()) {
    const auto slides = cell.joint_slides.find(joint.name);
    if (slides == cell.joint_slides.end() || !slides->second) continue;
    if (joint.upper - joint.lower <= kLongSlide) continue;
    doubts.push_back(absl::StrFormat(
        "joint '%s': its limits, %g to %g, are %g m apart; if they are millimetres, state metres "
        "in the URDF, or a unit in the cell file: {name: %s, lower: %g mm, upper: %g mm}",
        joint.name, joint.lower, joint.upper, joint.upper - joint.lower, joint.name, joint.lower,
        joint.upper));
  }
}

}  // namespace

std::vector<std::string> Doubts(const Cell& cell) {
  constexpr absl::Duration kOld = absl::Seconds(10);
  constexpr absl::Duration kApart = absl::Seconds(1);
  const SceneSettings& scene = cell.server.scene;
  std::vector<std::string> doubts;
  const auto long_time = [&](const std::string& key, absl::Duration time,
                             const std::string& consequence) {
    doubts.push_back(absl::StrFormat(
        "server: %s: free verdicts may rest on images %s %s; a number without a unit is in "
        "seconds, milliseconds are written as '500 ms'",
        key, SpokenTime(time), consequence));
  };
  if (scene.max_age > kOld) long_time("max_age", scene.max_age, "old");
  if (scene.max_skew > kApart) {
    long_time("max_skew", scene.max_skew, "apart, between which people move");
  }
  if (const auto off = ChecksSwitchedOff(cell.server); !off.empty()) {
    doubts.push_back(absl::StrCat(
        "server: ", absl::StrJoin(off, ", "),
        ": these values switch checks off, and verdicts may be free though what they find is "
        "wrong (docs/live.md); leave them out, or state values nearer to the defaults"));
  }
  DoubtLimits(cell.segmentation, doubts);
  DoubtCleanUp(cell, doubts);
  DoubtRobot(cell, doubts);
  DoubtPayload(cell, doubts);
  constexpr double kPerson = 0.25;
  if (cell.sound && cell.sound->least_obstacle > kPerson) {
    doubts.push_back(absl::StrFormat(
        "sound: least_obstacle: %.2g m is a radius: people are 0.3 to 0.5 m thick, and are missed "
        "where the robot hides them; state 0.15 or less",
        cell.sound->least_obstacle));
  }
  constexpr double kSlowPerson = 1;  // m/s
  if (cell.separation && cell.separation->settings.human_speed < kSlowPerson) {
    doubts.push_back(absl::StrFormat(
        "separation: human_speed: %.2g m/s is slower than people walk, about 1.6 m/s (ISO 13855): "
        "distances are too small for them",
        cell.separation->settings.human_speed));
  }
  constexpr double kOfChord = 1.05;  // grid_move is along the arc, max_move along its chord
  if (!cell.robot.drawn && cell.grid_move > kOfChord * kMostMove) {
    doubts.push_back(absl::StrFormat(
        "grid: steps: the robot moves by up to %.2g m from one grid value to the next: people are "
        "0.3 to 0.5 m thick, and between grid values they may be in no robot image; state more "
        "steps, or 'max_move: 0.1' in their place",
        cell.grid_move));
  } else if (!cell.robot.drawn && cell.sound && cell.grid_move > cell.sound->least_obstacle) {
    doubts.push_back(absl::StrFormat(
        "grid: the robot moves by up to %.3f m from one grid value to the next, more than sound: "
        "least_obstacle, %.3f m: an obstacle between grid values may be in no robot image and is "
        "then missed; lower max_move or add steps, and capture again what was captured",
        cell.grid_move, cell.sound->least_obstacle));
  }
  DoubtSources(cell, doubts);
  DoubtSlides(cell, doubts);
  return doubts;
}

}  // namespace silhouette
