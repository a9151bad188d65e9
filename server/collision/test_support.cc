// SPDX-License-Identifier: Apache-2.0
// What a CollisionChecker takes of its TestSupport.
#include "server/collision/test_support.h"

#include <algorithm>
#include <stdexcept>

#include "server/collision/collision_checker.h"

namespace silhouette {

void CollisionChecker::TakePrepared(const TestSupport& support) {
  // Where a view is missing, what is occupied may be hidden_possible.
  if (support.drawn == nullptr || missing_views_ > 0) return;
  if (&support.drawn->robot() != table_.drawn().get()) return;  // prepared for another one
  drawn_ = support.drawn;
  if (table_.has_nodes()) node_is_free_ = support.node_is_free;
  always_hiding_ = true;
  for (int view = 0; view < table_.views(); ++view) {
    const ObstacleImage& image = *obstacle_images_[static_cast<size_t>(view)];
    const MaskWords always = table_.permanent(view).words();
    always_hiding_ = always_hiding_ && (Intersects(image.unknown().words(), always) ||
                                        Intersects(image.error().words(), always));
  }
}

void CollisionChecker::CheckSpace(const Policy& policy, const TestSupport& support) {
  if (support.possible_space == nullptr) {
    throw std::invalid_argument("the preset '" + NameOf(policy.preset) +
                                "' needs the space of possible obstacles");
  }
  const VoxelSpace& space = support.possible_space->space();
  bool fits = space.views() == table_.views();
  for (int view = 0; fits && view < space.views(); ++view) {
    fits = space.mask_size(view) == table_.mask_sizes()[static_cast<size_t>(view)] &&
           support.possible_space->sees(view) ==
               obstacle_images_[static_cast<size_t>(view)].has_value();
  }
  if (!fits) throw std::invalid_argument("the space of possible obstacles is not the scene's");
  possible_space_ = support.possible_space;
  voxels_decide_ = policy.preset == Preset::kSound;
  robot_may_touch_ = support.robot_may_touch;
  if (voxels_decide_) robot_may_meet_ = support.robot_may_meet;
  if (table_.drawn() != nullptr) workspace_ = support.workspace;
}

void CollisionChecker::PrepareLines(const Policy& policy, const TestSupport& support) {
  if (support.bands == nullptr) {
    throw std::invalid_argument("the preset '" + NameOf(policy.preset) + "' needs a calibration");
  }
  if (!std::ranges::equal(support.bands->mask_sizes(), table_.mask_sizes())) {
    throw std::invalid_argument("the calibration does not fit the views");
  }
  if (policy.preset == Preset::kCalibrated) {
    searched_bands_ = support.bands;
    return;
  }
  resolved_ = support.resolved;
  if (resolved_ == nullptr) {
    own_resolved_ = ResolvedObstacleImages(obstacle_images_, *support.bands);
    return;
  }
  bool fits = resolved_->size() == obstacle_images_.size();
  for (size_t view = 0; fits && view < resolved_->size(); ++view) {
    const std::optional<Mask>& plane = (*resolved_)[view];
    fits = plane.has_value() == obstacle_images_[view].has_value() &&
           (!plane || plane->size() == table_.mask_sizes()[view]);
  }
  if (!fits) throw std::invalid_argument("the resolved images are not those of the scene");
}

}  // namespace silhouette
