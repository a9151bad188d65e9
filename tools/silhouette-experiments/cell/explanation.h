// SPDX-License-Identifier: Apache-2.0
// Why a policy reported a configuration free where robot and obstacle touch: from the true places
// of contact and from the images there.
//
// A place of contact convicts a configuration by itself if a view shows an obstacle there and, for
// calibrated presets, no view shows background there (Table 3); without a calibration as many views
// must show an obstacle as the policy asks for. Where the robot itself is on the line of sight, in
// front or behind, background subtraction cannot show an obstacle. So a missing configuration is
// *hidden* if no place of contact would convict it even in perfect images - in all views, or in
// more than the policy allows for; else something went wrong at the place that would.
//
// The sound presets promise to find every obstacle that is a union of balls of the least size and
// that background subtraction shows. So what they miss is explained only if no such ball that holds
// a place of contact lies in the obstacle (*size*), or if every such ball has a pixel that shows
// background (*contrast*); one that has none is *unexplained*: a fault.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/sim/ray_scene.h"
#include "server/collision/policy.h"
#include "tools/silhouette-experiments/cell/trial.h"

namespace silhouette::cell_experiment {

enum class Cause : uint8_t {
  kHidden = 0,  // by the robot in all views: no camera could see it
  kOccluded,    // by the robot in some views, more than the policy allows for
  kContrast,    // background subtraction: it looks like the empty cell
  kRim,         // discretisation: a mask pixel that the robot covers in part
  kRobotCell,   // discretisation: the robot stands between grid points, its image is a union
  kShadow,      // background subtraction: the robot's image has its shadow
  kGrown,       // the robot's drawn image is larger than the robot: tolerance, growth, margin
  kRobotImage,  // the robot image of the test configuration lacks the place
  kTestCell,    // discretisation: the images of the grid cell's corners lack the place
  kSize,        // sound presets: the obstacle has no room for the least obstacle there
  kUnexplained,
};
inline constexpr size_t kCauses = 11;

// "hidden", "contrast", ...
std::string NameOf(Cause cause);

// What one view has of one place of contact.
struct PlaceInView {
  // Whether the robot, as it stood in the scene, is on the line of sight, before or behind.
  bool robot_in_line = false;
  // The pixel of the place in the obstacle image, ...
  enum Plane : uint8_t { kBackground, kObstacle, kUnknown, kError } plane = kBackground;
  // ... and whether the test robot image has it.
  bool in_test_image = false;
  // Where the robot is not in line but its image covers the pixel: why.
  Cause cover = Cause::kRim;
};

// Per view.
using Place = std::vector<PlaceInView>;

struct CauseFound {
  Cause cause = Cause::kUnexplained;
  size_t place = 0;  // the place that the cause speaks of
  size_t view = 0;   // the view with the fault; kHidden, kOccluded, kSize, kUnexplained: 0
};

// `places`: at least one, all of as many views. `on_grid`: where the test configuration is. Under
// the sound presets kSize stands for a place where all views are as they should be.
CauseFound FindCause(std::span<const Place> places, const Policy& policy, bool on_grid);

// A missing configuration explained: the cause, and a sentence about it.
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
  // FindCause's for a sound preset, looked into where all views are as they should be.
  CauseFound SoundCause(const ViewedScene& viewed, std::span<const ContactPoint> points,
                        std::span<const Place> places, const CauseFound& found) const;
  // A view that shows background somewhere on the ball, by the obstacle images; nothing: none does.
  std::optional<size_t> ViewThrough(const ViewedScene& viewed, const Eigen::Vector3d& centre,
                                    double radius) const;
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

struct ExplainedConfiguration {
  MissedConfiguration missed;
  std::vector<Explanation> explanations;  // one per policy of `missed`
};

struct SceneRecord {
  int number = 0;
  bool robot_on_grid = false;
  Reason blocked = Reason::kNone;                   // then nothing was tested
  std::vector<std::array<Tally, kWheres>> tallies;  // by policy
  std::vector<ExplainedConfiguration> missing;
};

// Makes scene `number` of an experiment.
using SceneSource = std::function<RandomScene(int number)>;

// The trial of one scene.
absl::StatusOr<SceneRecord> RunScene(const TrialSetting& setting, Explainer& explainer,
                                     const SceneSource& source, int number);

}  // namespace silhouette::cell_experiment
