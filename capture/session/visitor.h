// SPDX-License-Identifier: Apache-2.0
// Visitor: gets the robot to a configuration, waits until it stands still there, and takes its
// images.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "calib/robot/drawing/drawn_robot.h"
#include "capture/segmentation/reference.h"
#include "capture/segmentation/settings.h"
#include "capture/session/capture_observer.h"
#include "capture/session/capture_settings.h"
#include "capture/session/cell_cameras.h"
#include "capture/session/cell_robot.h"
#include "capture/session/travel.h"
#include "db/mask/configuration_grid.h"
#include "db/mask/mask.h"
#include "db/store/store.h"

namespace silhouette {

// What a capture session is made of.

struct SessionParts {
  Database* database;
  const Travel* travel;
  CellRobot robot;
  CellCameras cameras;
  std::vector<Reference> references;  // one per view; empty: they are yet to be made
  CaptureSettings settings;
  SegmentationSettings segmentation;
  // Where the model says that the robot is; nothing: it is not known.
  std::optional<DrawnRobot> expected = std::nullopt;
};

struct Visit {
  enum class Outcome {
    kMissed,       // a joint is not where it should be, or did not stay there
    kUnreachable,  // there is no way around the forbidden regions
    kTaken,
  };
  Outcome outcome = Outcome::kMissed;
  std::string why;  // unless kTaken: one sentence
  // If kTaken: the joints as measured just before the images, the largest deviation from what was
  // commanded before and after them (radians, metres), and the images.
  std::vector<double> measured;
  double deviation = 0;
  ImageSet images;
  // The sets before, by view, in which the robot stood as still: still_images sets in all.
  std::vector<std::vector<cv::Mat>> earlier;
};

// The robot image of each view: the union over all sets of the visit. Where the robot alone was
// foreground once, it may be again: at faint rims, such as those of its shadow, noise decides from
// image to image. A pixel that a scene finds there must not count as an obstacle. A larger test
// image only makes more configurations occupied.
std::vector<Mask> RobotMasks(const SessionParts& parts, const Visit& visit);

class Visitor {
 public:
  // Both must outlive it; images that are asked for again are reported to `observer`.
  Visitor(SessionParts& parts, const CaptureObserver& observer)
      : parts_(parts), observer_(observer) {}

  // An error is a device's, or says that the robot stands where it must not, or moved when it
  // should stand; the robot may be anywhere then, and the next visit begins with asking it.
  // Unavailable: a device is lost, and may come back; so is a camera that repeats an image.
  // Cancelled: a stop was requested before a move; the robot stands still.
  absl::StatusOr<Visit> Go(ConfigurationNumber number);

  // The same straight to a place that need not be in the grid, whatever is in the way.
  absl::StatusOr<Visit> GoStraight(const Configuration& place);

  // Tells the robot to stop, and reports if that fails. Somebody may move the robot by hand then:
  // the next visit begins with asking it where it is.
  void StopRobot();

  // Whether Go() ended the last time because the robot was lost, or it could not be stopped since.
  bool robot_lost() const { return robot_lost_; }

 private:
  // CellRobot::Measure(). It and MoveTo() notice that the robot is lost.
  absl::StatusOr<std::vector<double>> Measure(absl::Duration since = -absl::InfiniteDuration());
  absl::Status MoveTo(const Configuration& place);
  // Until measurements and images say that the robot has settled, or for settle_timeout.
  absl::StatusOr<Visit> TakeImages(const Configuration& place, const std::string& name);
  // Measures, takes one set of images, measures. Without `why` unless kTaken: all is well, but more
  // sets are needed.
  absl::StatusOr<Visit> Look(const Configuration& place, const std::string& name);
  // A view whose image is not that of the set before. Adds the set to those that are alike.
  std::optional<std::string> ChangedView(const ImageSet& images);
  // The joints are not where they were commanded.
  Visit Missed(const std::string& name, const std::vector<double>& commanded,
               const std::vector<double>& measured);

  SessionParts& parts_;
  const CaptureObserver& observer_;
  // Where the robot stands; nothing if that is not known for sure.
  std::optional<ConfigurationNumber> at_;
  bool robot_lost_ = false;
  // The last sets of images that were alike, oldest first.
  std::vector<std::vector<cv::Mat>> alike_;
};

}  // namespace silhouette
