// SPDX-License-Identifier: Apache-2.0
#include "server/service/messages.h"

#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "server/scene/checker.h"

namespace silhouette {

namespace {

v1::Verdict::State StateToMessage(State state) {
  switch (state) {
    case State::kFree:
      return v1::Verdict::STATE_FREE;
    case State::kOccupied:
      return v1::Verdict::STATE_OCCUPIED;
    case State::kUnknown:
      break;
  }
  return v1::Verdict::STATE_UNKNOWN;
}

}  // namespace

void ToMessage(absl::Time time, google::protobuf::Timestamp* message) {
  const int64_t seconds = absl::ToUnixSeconds(time);
  message->set_seconds(seconds);
  message->set_nanos(
      static_cast<int32_t>(absl::ToInt64Nanoseconds(time - absl::FromUnixSeconds(seconds))));
}

void ToMessage(absl::Duration duration, google::protobuf::Duration* message) {
  absl::Duration rest;
  message->set_seconds(absl::IDivDuration(duration, absl::Seconds(1), &rest));
  message->set_nanos(static_cast<int32_t>(absl::ToInt64Nanoseconds(rest)));
}

v1::Verdict::Reason ToMessage(Reason reason) { return static_cast<v1::Verdict::Reason>(reason); }

void ToMessage(const Verdict& verdict, std::span<const ViewEvidence> evidence,
               std::span<const std::string> regions, std::optional<double> clearance,
               const ServedDatabase& database, v1::Verdict* message) {
  const bool decided = verdict.state() != State::kUnknown;
  message->set_state(StateToMessage(verdict.state()));
  message->set_reason(ToMessage(verdict.reason()));
  message->set_hidden_possible(verdict.hidden_possible());
  message->mutable_regions()->Add(regions.begin(), regions.end());
  if (decided && clearance) message->set_clearance(*clearance);
  for (size_t view = 0; view < evidence.size(); ++view) {
    v1::ViewEvidence& seen = *message->add_views();
    seen.set_view(database.view_name(static_cast<int>(view)));
    seen.set_obstacle_pixels(evidence[view].obstacle_pixels);
    seen.set_unknown_pixels(evidence[view].unknown_pixels);
    seen.set_error_pixels(evidence[view].error_pixels);
    seen.set_missing(evidence[view].missing);
    if (decided && evidence[view].distance) seen.set_distance(*evidence[view].distance);
  }
}

void ToMessage(const PathClearance& narrowest, v1::PathPlace* message) {
  message->set_segment(narrowest.segment);
  message->set_fraction(narrowest.fraction);
  message->mutable_configuration()->mutable_positions()->Add(narrowest.configuration.begin(),
                                                             narrowest.configuration.end());
}

void ToMessage(const Policy& policy, int views, v1::Policy* message) {
  message->set_preset(NameOf(policy.preset));
  if (policy.min_views) message->set_min_views(*policy.min_views);
  // Also beside min_views: it counts for requests that name the preset. With the other presets a
  // request must not have it, and what is returned here can be asked for.
  if (policy.preset == Preset::kUncalibrated) {
    message->set_max_occluded_views(
        policy.max_occluded_views.value_or(DefaultOccludedViews(views)));
  }
  message->set_off_grid(policy.off_grid == OffGrid::kCell ? v1::OFF_GRID_CELL
                                                          : v1::OFF_GRID_NEAREST);
}

void ToMessage(const ConfigurationGrid& grid, const ServingSettings& settings, v1::Grid* message) {
  for (const GridJoint& joint : grid.joints()) {
    v1::GridJoint& added = *message->add_joints();
    added.set_name(joint.name);
    added.set_lower(joint.lower);
    added.set_upper(joint.upper);
    added.set_steps(joint.steps);
    added.set_continuous(joint.continuous);
    const std::optional<bool> slides = Slides(settings, joint);
    if (slides) added.set_slides(*slides);
  }
  for (int edge : grid.tile_edges()) message->add_tile_edges(edge);
}

void ToMessage(const Mask& mask, v1::Mask* message) {
  message->set_width(mask.width());
  message->set_height(mask.height());
  message->set_bits(mask.ToBytes());
}

void ToMessage(const Served& served, const Policy& policy, const Moment& now, v1::Basis* message) {
  message->set_database_generation(served.database->generation());
  message->set_cell_name(served.database->cell().name());
  message->set_cell_digest(served.database->cell_digest());
  message->set_variant(served.database->variant());
  message->set_unverified_model(served.database->unverified_model());
  ToMessage(now.running, message->mutable_server_clock());
  if (served.scene == nullptr) return;
  message->set_scene_id(served.scene->id);
  message->set_scene_variant(served.scene->variant);
  ToMessage(served.scene->oldest.time, message->mutable_scene_time());
  ToMessage(served.scene->AgeAt(now), message->mutable_scene_age());
  for (const std::string& name : RegionsIn(served, policy)) message->add_regions(name);
}

void ToMessage(const AllowedRegion& region, const ServedDatabase& database, const Moment& now,
               v1::AllowedRegion* message) {
  message->set_name(region.name);
  for (size_t view = 0; view < region.pixels.size(); ++view) {
    if (!region.pixels[view]) continue;
    v1::RegionPixels& pixels = *message->add_views();
    pixels.set_view(database.view_name(static_cast<int>(view)));
    ToMessage(*region.pixels[view], pixels.mutable_mask());
  }
  ToMessage(region.end - now.running, message->mutable_remaining());
  ToMessage(region.end_time, message->mutable_end_time());
}

void ToMessage(const SceneDefect& defect, v1::SceneDefect* message) {
  message->set_reason(ToMessage(defect.reason));
  message->set_message(defect.message);
}

void ToMessage(const Scene& scene, bool include_planes, std::span<const SceneDefect> defects,
               v1::Scene* message) {
  message->set_id(scene.id);
  message->set_database_generation(scene.generation);
  message->set_variant(scene.variant);
  ToMessage(scene.oldest.time, message->mutable_time());
  ToMessage(scene.skew, message->mutable_skew());
  for (const JointPosition& joint : scene.joints) {
    v1::JointPosition& added = *message->add_joints();
    added.set_name(joint.name);
    added.set_position(joint.position);
  }
  for (size_t i = 0; i < scene.views.size(); ++i) {
    if (!scene.views[i]) continue;
    const SceneView& seen = *scene.views[i];
    v1::SceneView& view = *message->add_views();
    view.set_view(seen.name);
    ToMessage(seen.captured, view.mutable_capture_time());
    view.set_foreground_pixels(static_cast<uint32_t>(seen.foreground.Count()));
    view.set_core_error_pixels(seen.core_error_pixels);
    view.set_margin(seen.margin);
    if (seen.ignored) view.set_ignored_pixels(static_cast<uint32_t>(seen.ignored->Count()));
    if (include_planes) ToMessage(seen.foreground, view.mutable_scene());
    if (include_planes && seen.ignored) ToMessage(*seen.ignored, view.mutable_ignored());
    if (include_planes && seen.strong) ToMessage(*seen.strong, view.mutable_strong());
    view.set_separates_robot(seen.separates_robot);
    if (!scene.obstacle_images[i]) continue;
    const ObstacleImage& image = *scene.obstacle_images[i];
    view.set_obstacle_pixels(static_cast<uint32_t>(image.obstacle().Count()));
    view.set_unknown_pixels(static_cast<uint32_t>(image.unknown().Count()));
    view.set_error_pixels(static_cast<uint32_t>(image.error().Count()));
    if (!include_planes) continue;
    ToMessage(image.obstacle(), view.mutable_obstacle());
    ToMessage(image.unknown(), view.mutable_unknown());
    ToMessage(image.error(), view.mutable_error());
  }
  for (const SceneDefect& defect : defects) ToMessage(defect, message->add_defects());
}

namespace {

// As GetDatabaseResponse.corrupt counts.
uint64_t Corrupt(const RobotImageTable& images) {
  return images.Count(RobotImageState::kCorrupt) + images.Count(RobotImageState::kEmpty);
}

}  // namespace

void ToMessage(const ServedDatabase& database, const ServingSettings& settings,
               v1::GetDatabaseResponse* message) {
  const RobotImageTable& images = database.robot_images();
  message->set_cell_name(database.cell().name());
  message->set_cell_digest(database.cell_digest());
  message->set_generation(database.generation());
  ToMessage(database.grid(), settings, message->mutable_grid());
  for (const auto& joint : database.cell().fixed_joints()) {
    v1::JointPosition& added = *message->add_fixed_joints();
    added.set_name(joint.name());
    added.set_position(joint.position());
  }
  for (int i = 0; i < database.views(); ++i) {
    const auto& view = database.cell().views(i);
    v1::View& added = *message->add_views();
    added.set_name(view.name());
    added.set_image_width(view.image_width());
    added.set_image_height(view.image_height());
    added.set_mask_width(view.mask_width());
    added.set_mask_height(view.mask_height());
    const ViewTreatment& treatment = database.treatment(i);
    added.set_margin(treatment.margin);
    if (treatment.ignored) {
      added.set_ignored_pixels(static_cast<uint32_t>(treatment.ignored->Count()));
    }
    message->add_permanent_pixels(static_cast<uint32_t>(images.permanent(i).Count()));
  }
  message->set_images(images.drawn() != nullptr ? "drawn" : "captured");
  message->set_configurations(database.grid().size());
  message->set_captured(images.Count(RobotImageState::kPresent));
  message->set_excluded(images.Count(RobotImageState::kExcluded));
  message->set_corrupt(Corrupt(images));
  for (const std::string& name : database.variants()) {
    const RobotImageTable& of_variant = database.Variant(name)->robot_images();
    v1::RobotImageVariant& variant = *message->add_variants();
    variant.set_name(name);
    variant.set_captured(of_variant.Count(RobotImageState::kPresent));
    variant.set_excluded(of_variant.Count(RobotImageState::kExcluded));
    variant.set_corrupt(Corrupt(of_variant));
  }
  ToMessage(DefaultPolicy(settings, database), database.views(), message->mutable_default_policy());
  message->set_calibrated(database.bands() != nullptr);
  for (const Preset preset : AllPresets()) {
    if (database.CanServe({.preset = preset}).ok()) message->add_presets(NameOf(preset));
  }
}

namespace {

void LatencyToMessage(const LatencyFigures& figures, v1::AcquisitionLatency* message) {
  message->set_count(figures.count);
  ToMessage(figures.median, message->mutable_median());
  ToMessage(figures.p99, message->mutable_p99());
  ToMessage(figures.longest, message->mutable_longest());
}

// What both messages have.
template <typename Message>
void ErrorsToMessage(const DeviceStatus& device, Message* message) {
  message->set_serving(device.serving);
  message->set_errors(device.errors);
  message->set_fault(device.fault);
  message->set_last_error(device.last_error);
  if (!device.last_error.empty()) {
    ToMessage(device.last_error_time, message->mutable_last_error_time());
  }
}

}  // namespace

void ToMessage(const LiveStatus& status, v1::Acquisition* message) {
  message->set_serving(status.serving);
  ToMessage(status.started, message->mutable_start_time());
  message->set_scenes(status.scenes);
  message->set_lost_sets(status.lost_sets);
  message->set_fault(status.fault);
  for (const DeviceStatus& camera : status.cameras) {
    v1::AcquiredCamera& added = *message->add_cameras();
    added.set_view(camera.name);
    added.set_images(camera.good);
    ErrorsToMessage(camera, &added);
    if (camera.last) ToMessage(*camera.last, added.mutable_last_image_time());
    if (camera.age) ToMessage(*camera.age, added.mutable_last_image_age());
  }
  v1::AcquiredRobot& robot = *message->mutable_robot();
  robot.set_samples(status.robot.good);
  ErrorsToMessage(status.robot, &robot);
  if (status.robot.age) ToMessage(*status.robot.age, robot.mutable_last_sample_age());
  LatencyToMessage(status.to_scene, message->mutable_to_scene());
  LatencyToMessage(status.to_map, message->mutable_to_map());
}

void ToMessage(const KnownVariant& known, const std::vector<std::string>& variants,
               v1::RobotVariant* message) {
  const absl::StatusOr<std::string> variant = known.OfLaterImages(variants);
  if (variant.ok()) {
    message->set_variant(*variant);
  } else {
    message->set_unknown(std::string(variant.status().message()));
  }
  message->set_changing(known.changing());
}

}  // namespace silhouette
