// SPDX-License-Identifier: Apache-2.0
// The devices of a cell as capture sees them: a robot that moves to joint values, and cameras that
// take one simultaneous set of images. A real cell, the simulated cell and the faulty devices of
// the tests stand behind the same two interfaces.
//
// Calls block; an implementation need not be thread-safe.
#pragma once

#include <cstdint>
#include <iterator>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace silhouette {

// One camera image: `channels` bytes per pixel (1: grey; 3: blue, green, red), row by row from the
// top left.
struct CameraImage {
  int width = 0;
  int height = 0;
  int channels = 1;
  std::vector<uint8_t> pixels;
  absl::Time captured = absl::UnixEpoch();
};

// Where the robot is.
struct RobotState {
  std::vector<double> positions;  // one for each of Robot::joints(); radians, metres
  bool moving = false;
  // The positions were not measured before this, by the running clock. Nothing: they were measured
  // during the call that returned them.
  std::optional<absl::Duration> not_before = std::nullopt;
};

class Robot {
 public:
  virtual ~Robot() = default;

  // The names of all joints that can be moved, in the robot's order.
  virtual const std::vector<std::string>& joints() const = 0;

  // Moves to `positions`, in the order of joints(), and returns when the robot has arrived.
  // InvalidArgument: wrong number of values, or beyond a limit. DeadlineExceeded: no arrival.
  // Unavailable: no connection. Cancelled: an operator stops. Each failure ends in a stop command.
  virtual absl::Status MoveTo(std::span<const double> positions) = 0;

  virtual absl::StatusOr<RobotState> State() = 0;

  // Stops at once. May be called from another thread while MoveTo blocks.
  virtual absl::Status Stop() = 0;
};

class CameraRig {
 public:
  virtual ~CameraRig() = default;

  // The names of the views, in the order that Grab() returns them.
  virtual const std::vector<std::string>& views() const = 0;

  // Triggers all cameras at once and returns one image per view. Unavailable or DeadlineExceeded,
  // naming the view, if one does not deliver: a set is complete or it is an error.
  virtual absl::StatusOr<std::vector<CameraImage>> Grab() = 0;

  // The same view by view, for who can use a set that is not complete: per view its image, or why
  // there is none. Cameras that can only tell of the whole set give its error to every view.
  virtual std::vector<absl::StatusOr<CameraImage>> GrabEach() {
    absl::StatusOr<std::vector<CameraImage>> set = Grab();
    if (!set.ok()) return {views().size(), absl::StatusOr<CameraImage>(set.status())};
    return {std::make_move_iterator(set->begin()), std::make_move_iterator(set->end())};
  }
};

// CameraSource: a camera, or several that are read together, as CameraSet triggers and reads them.

// Need not be thread-safe, but may be opened, triggered and destroyed by another thread. Trigger()
// and Wait() take turns.
// Messages do not name the view of a source that has only one: the caller knows it.
class CameraSource {
 public:
  // In the order of views().
  using EachImage = std::vector<absl::StatusOr<CameraImage>>;

  virtual ~CameraSource() = default;

  // The views that it takes images of.
  virtual const std::vector<std::string>& views() const = 0;

  // How long its images may take, once all sources of a set have been triggered.
  virtual absl::Duration timeout() const = 0;

  // Whether the device is there, for all that is known. If not, Open() comes before Trigger().
  virtual bool ready() const { return true; }

  // Tries to reach a device that was lost, with all settings, which may take seconds: those of
  // several sources are reached at the same time. Unavailable: it is still not there.
  virtual absl::Status Open() { return absl::OkStatus(); }

  // Asks for one image of every view and returns without waiting for any. Unavailable: the device
  // is not there, or no longer.
  virtual absl::Status Trigger() = 0;

  // The images, in the order of views(). None of them was taken before Trigger(); `captured` is the
  // earliest moment at which each can have been taken, by this machine's wall clock. `deadline`: by
  // the running clock. Errors, of one image or of all: DeadlineExceeded: it did not come. DataLoss:
  // it is not whole, or of another time. Unavailable: the device is not there any more. OutOfRange:
  // the recording has no more images. After an error the source is as ready as after a success.
  virtual absl::StatusOr<EachImage> Wait(absl::Duration deadline) = 0;
};

}  // namespace silhouette
