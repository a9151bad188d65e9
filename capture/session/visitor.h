// Visitor: gets the robot to a configuration, waits until it stands still there, and takes its
// images.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/cell_cameras.h"
#include "capture/session/session_parts.h"
#include "db/configuration_grid.h"

namespace silhouette {

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
};

class Visitor {
 public:
  // `parts` must outlive it; `say` is told of images that are asked for again.
  Visitor(SessionParts& parts, std::function<void(const std::string&)> say)
      : parts_(parts), say_(std::move(say)) {}

  // An error is a device's, or says that the robot stands where it must not; the robot may be
  // anywhere then, and the next visit begins with asking it.
  absl::StatusOr<Visit> Go(ConfigurationNumber number);

 private:
  absl::StatusOr<Visit> TakeImages(ConfigurationNumber number);
  Visit Missed(ConfigurationNumber number, double deviation) const;

  SessionParts& parts_;
  const std::function<void(const std::string&)> say_;
  // Where the robot stands; nothing if that is not known for sure.
  std::optional<ConfigurationNumber> at_;
};

}  // namespace silhouette
