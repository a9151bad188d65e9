// SPDX-License-Identifier: Apache-2.0
// A missing configuration explained: the cause, and a sentence that says it of this one.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "capture/sim/ray_scene.h"
#include "tools/silhouette-experiments/cell/cause.h"
#include "tools/silhouette-experiments/cell/trial.h"

namespace silhouette::cell_experiment {

struct Explanation {
  Cause cause = Cause::kUnexplained;
  std::string sentence;
  Eigen::Vector3d place = Eigen::Vector3d::Zero();  // of contact, in the world
};

// Explains missing configurations of one scene after the other. Not thread-safe. What it is made
// from must outlive it.
class Explainer {
 public:
  explicit Explainer(const TrialSetting& setting);

  // One per policy of `missed`, in their order.
  std::vector<Explanation> Explain(const ViewedScene& viewed, const MissedConfiguration& missed);

 private:
  Place At(const ViewedScene& viewed, const std::vector<Mask>& test_images,
           const Eigen::Vector3d& point);
  // Why the robot's image covers a pixel on whose line of sight through a place it is not.
  Cause CoverOf(const ViewedScene& viewed, size_t view, const Eigen::Vector2d& pixel);
  bool RobotInPixel(size_t view, const Eigen::Vector2d& pixel) const;
  std::string Sentence(const ViewedScene& viewed, const CauseFound& found, const Place& place,
                       const ContactPoint& contact, const Policy& policy) const;
  std::string Hidden(const Place& place, const ContactPoint& contact) const;
  double DifferenceAt(const ViewedScene& viewed, size_t view, const Eigen::Vector3d& point) const;

  const TrialSetting& setting_;
  std::vector<CameraModel> cameras_;       // by view, of the camera's images
  std::vector<CameraModel> mask_cameras_;  // by view, of the masks
  BodyRays robot_;                         // as it stands in the scene that is looked at
};

}  // namespace silhouette::cell_experiment
