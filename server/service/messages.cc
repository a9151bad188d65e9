#include "server/service/messages.h"

#include <stdexcept>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "server/scene/checker.h"

namespace silhouette {
namespace {

absl::Status InField(const std::string& field, const std::string& message) {
  return absl::InvalidArgumentError(absl::StrCat(field, ": ", message));
}

void SetTime(absl::Time time, google::protobuf::Timestamp* message) {
  const int64_t seconds = absl::ToUnixSeconds(time);
  message->set_seconds(seconds);
  message->set_nanos(
      static_cast<int32_t>(absl::ToInt64Nanoseconds(time - absl::FromUnixSeconds(seconds))));
}

absl::StatusOr<absl::Time> TimeFrom(const google::protobuf::Timestamp& message,
                                    const std::string& field) {
  constexpr int64_t kYear10000 = 253'402'300'800;
  if (message.seconds() < 0 || message.seconds() >= kYear10000 || message.nanos() < 0 ||
      message.nanos() > 999'999'999) {
    return InField(field, "it is not a time after 1970");
  }
  return absl::FromUnixSeconds(message.seconds()) + absl::Nanoseconds(message.nanos());
}

absl::StatusOr<Mask> MaskFrom(const v1::Mask& message, const std::string& field) {
  const std::string& bits = message.bits();
  try {
    return Mask::FromBytes({message.width(), message.height()},
                           {reinterpret_cast<const uint8_t*>(bits.data()), bits.size()});
  } catch (const std::invalid_argument& error) {
    return InField(field, error.what());
  }
}

absl::StatusOr<ViewInput> ViewInputFrom(const v1::ViewImage& message, const std::string& field) {
  ViewInput input;
  input.view = message.view();
  if (message.has_capture_time()) {
    const absl::StatusOr<absl::Time> time =
        TimeFrom(message.capture_time(), absl::StrCat(field, ".capture_time"));
    if (!time.ok()) return time.status();
    input.captured = *time;
  }
  switch (message.image_case()) {
    case v1::ViewImage::kSceneMask: {
      absl::StatusOr<Mask> mask =
          MaskFrom(message.scene_mask(), absl::StrCat(field, ".scene_mask"));
      if (!mask.ok()) return mask.status();
      input.image = SceneMask{*std::move(mask)};
      return input;
    }
    case v1::ViewImage::kObstacleMask: {
      absl::StatusOr<Mask> mask =
          MaskFrom(message.obstacle_mask(), absl::StrCat(field, ".obstacle_mask"));
      if (!mask.ok()) return mask.status();
      input.image = ObstacleMask{*std::move(mask)};
      return input;
    }
    case v1::ViewImage::kCameraImage:
      input.image = EncodedImage{message.camera_image()};
      return input;
    case v1::ViewImage::IMAGE_NOT_SET:
      break;
  }
  return InField(field, "give one of scene_mask, camera_image and obstacle_mask");
}

absl::StatusOr<Mask> PixelsFrom(const v1::RegionPixels& message, MaskSize size,
                                const std::string& field) {
  if (message.has_polygon()) {
    std::vector<std::pair<double, double>> corners;
    for (const v1::Point& corner : message.polygon().corners()) {
      corners.emplace_back(corner.x(), corner.y());
    }
    absl::StatusOr<Mask> mask = PixelsInPolygon(size, corners);
    if (mask.ok()) return mask;
    return InField(field + ".polygon", std::string(mask.status().message()));
  }
  if (!message.has_mask()) return InField(field, "give one of mask and polygon");
  absl::StatusOr<Mask> mask = MaskFrom(message.mask(), field + ".mask");
  if (!mask.ok() || mask->size() == size) return mask;
  return InField(field + ".mask", absl::StrCat("it is ", mask->width(), "x", mask->height(),
                                               ", and should be ", size.width, "x", size.height));
}

v1::Verdict::State ToMessage(State state) {
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

std::string NamesOfPresets() {
  return absl::StrJoin(AllPresets(), ", ", [](std::string* out, Preset preset) {
    absl::StrAppend(out, "'", NameOf(preset), "'");
  });
}

absl::Status SetOffGrid(const v1::Policy& message, Policy& policy) {
  switch (message.off_grid()) {
    case v1::OFF_GRID_UNSPECIFIED:
      return absl::OkStatus();
    case v1::OFF_GRID_CELL:
      policy.off_grid = OffGrid::kCell;
      return absl::OkStatus();
    case v1::OFF_GRID_NEAREST:
      policy.off_grid = OffGrid::kNearest;
      return absl::OkStatus();
    default:
      return InField("policy.off_grid", "this server does not know the value");
  }
}

// How lines are searched.
absl::Status SetLines(const v1::Policy& message, Policy& policy) {
  constexpr char kCalibratedOnly[] = "it goes with the presets 'calibrated' and 'paper-calibrated'";
  const bool calibrated = IsCalibrated(policy.preset);
  if (message.has_errors_convict()) {
    if (!calibrated) return InField("policy.errors_convict", kCalibratedOnly);
    policy.errors_convict = message.errors_convict();
  }
  if (message.epipolar() == v1::EPIPOLAR_UNSPECIFIED) return absl::OkStatus();
  if (!calibrated) return InField("policy.epipolar", kCalibratedOnly);
  switch (message.epipolar()) {
    case v1::EPIPOLAR_INTERSECTION:
      policy.epipolar = EpipolarDomain::kIntersection;
      return absl::OkStatus();
    case v1::EPIPOLAR_OBSTACLE:
      policy.epipolar = EpipolarDomain::kObstacle;
      return absl::OkStatus();
    default:
      return InField("policy.epipolar", "this server does not know the value");
  }
}

}  // namespace

void ToMessage(absl::Duration duration, google::protobuf::Duration* message) {
  absl::Duration rest;
  message->set_seconds(absl::IDivDuration(duration, absl::Seconds(1), &rest));
  message->set_nanos(static_cast<int32_t>(absl::ToInt64Nanoseconds(rest)));
}

grpc::Status ToGrpc(const absl::Status& status) {
  if (status.ok()) return grpc::Status::OK;
  return grpc::Status(static_cast<grpc::StatusCode>(status.code()), std::string(status.message()));
}

absl::Status FromGrpc(const grpc::Status& status) {
  return absl::Status(static_cast<absl::StatusCode>(status.error_code()), status.error_message());
}

absl::StatusOr<Policy> PolicyFrom(const v1::Policy& message, const Policy& defaults, int views) {
  Policy policy = defaults;
  if (!message.preset().empty()) {
    const std::optional<Preset> preset = PresetFromName(message.preset());
    if (!preset) {
      return InField("policy.preset", absl::StrCat("'", message.preset(),
                                                   "' is unknown; known are ", NamesOfPresets()));
    }
    policy.preset = *preset;
    // What the server says of its default preset went with it.
    policy.min_views.reset();
    policy.epipolar.reset();
    policy.errors_convict.reset();
  }
  if (message.has_max_occluded_views()) {
    if (policy.preset != Preset::kUncalibrated) {
      return InField("policy.max_occluded_views", "it goes with the preset 'uncalibrated'");
    }
    policy.max_occluded_views = message.max_occluded_views();
    policy.min_views.reset();
  }
  if (message.has_min_views()) policy.min_views = message.min_views();
  if (absl::Status status = SetLines(message, policy); !status.ok()) return status;
  if (absl::Status status = SetOffGrid(message, policy); !status.ok()) return status;
  try {
    MinViews(policy, views);
  } catch (const std::invalid_argument& error) {
    return InField("policy", error.what());
  }
  return policy;
}

absl::StatusOr<Configuration> ConfigurationFrom(const v1::Configuration& message,
                                                const ConfigurationGrid& grid,
                                                const std::string& field) {
  if (message.positions_size() == grid.dimensions()) {
    return Configuration(message.positions().begin(), message.positions().end());
  }
  std::string joints;
  for (const GridJoint& joint : grid.joints()) {
    absl::StrAppend(&joints, joints.empty() ? "" : ", ", joint.name);
  }
  return InField(field, absl::StrCat("it has ", message.positions_size(),
                                     " positions and takes one for each of ", joints));
}

absl::StatusOr<SceneInput> SceneInputFrom(const v1::PublishSceneRequest& message) {
  SceneInput input;
  for (const v1::JointPosition& joint : message.joints()) {
    input.joints.push_back({joint.name(), joint.position()});
  }
  for (int i = 0; i < message.views_size(); ++i) {
    const std::string field = absl::StrCat("views[", i, "] '", message.views(i).view(), "'");
    absl::StatusOr<ViewInput> view = ViewInputFrom(message.views(i), field);
    if (!view.ok()) return view.status();
    input.views.push_back(*std::move(view));
  }
  return input;
}

absl::StatusOr<std::vector<std::optional<Mask>>> RegionPixelsFrom(
    const v1::AllowRegionRequest& message, const ServedDatabase& database) {
  std::vector<std::optional<Mask>> pixels(static_cast<size_t>(database.views()));
  for (int i = 0; i < message.views_size(); ++i) {
    const v1::RegionPixels& given = message.views(i);
    const std::string field = absl::StrCat("views[", i, "] '", given.view(), "'");
    const std::optional<int> view = database.ViewOf(given.view());
    if (!view) return InField(field, "the cell has no such view");
    std::optional<Mask>& known = pixels[static_cast<size_t>(*view)];
    if (known) return InField(field, "the view is given twice");
    absl::StatusOr<Mask> mask =
        PixelsFrom(given, database.robot_images().mask_sizes()[static_cast<size_t>(*view)], field);
    if (!mask.ok()) return mask.status();
    known = *std::move(mask);
  }
  return pixels;
}

absl::Duration DurationFrom(const google::protobuf::Duration& message) {
  return absl::Seconds(message.seconds()) + absl::Nanoseconds(message.nanos());
}

v1::Verdict::Reason ToMessage(Reason reason) { return static_cast<v1::Verdict::Reason>(reason); }

void ToMessage(const Verdict& verdict, std::span<const ViewEvidence> evidence,
               std::span<const std::string> regions, std::optional<double> clearance,
               const ServedDatabase& database, v1::Verdict* message) {
  const bool decided = verdict.state() != State::kUnknown;
  message->set_state(ToMessage(verdict.state()));
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

void ToMessage(const Policy& policy, v1::Policy* message) {
  message->set_preset(NameOf(policy.preset));
  if (policy.min_views) message->set_min_views(*policy.min_views);
  if (policy.preset == Preset::kUncalibrated && !policy.min_views) {
    message->set_max_occluded_views(policy.max_occluded_views);
  }
  message->set_off_grid(policy.off_grid == OffGrid::kCell ? v1::OFF_GRID_CELL
                                                          : v1::OFF_GRID_NEAREST);
  if (!IsCalibrated(policy.preset)) return;
  message->set_epipolar(EpipolarDomainOf(policy) == EpipolarDomain::kIntersection
                            ? v1::EPIPOLAR_INTERSECTION
                            : v1::EPIPOLAR_OBSTACLE);
  message->set_errors_convict(ErrorsConvict(policy));
}

void ToMessage(const ConfigurationGrid& grid, v1::Grid* message) {
  for (const GridJoint& joint : grid.joints()) {
    v1::GridJoint& added = *message->add_joints();
    added.set_name(joint.name);
    added.set_lower(joint.lower);
    added.set_upper(joint.upper);
    added.set_steps(joint.steps);
    added.set_continuous(joint.continuous);
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
  ToMessage(now.running, message->mutable_server_clock());
  if (served.scene == nullptr) return;
  message->set_scene_id(served.scene->id);
  SetTime(served.scene->oldest, message->mutable_scene_time());
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
  SetTime(region.end_time, message->mutable_end_time());
}

void ToMessage(const Scene& scene, bool include_planes, const SceneSettings& settings,
               const Moment& now, v1::Scene* message) {
  message->set_id(scene.id);
  message->set_database_generation(scene.generation);
  SetTime(scene.oldest, message->mutable_time());
  ToMessage(scene.skew(), message->mutable_skew());
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
    SetTime(seen.captured, view.mutable_capture_time());
    view.set_foreground_pixels(static_cast<uint32_t>(seen.foreground.Count()));
    view.set_core_error_pixels(seen.core_error_pixels);
    view.set_margin(seen.margin);
    if (seen.ignored) view.set_ignored_pixels(static_cast<uint32_t>(seen.ignored->Count()));
    if (include_planes) ToMessage(seen.foreground, view.mutable_scene());
    if (include_planes && seen.ignored) ToMessage(*seen.ignored, view.mutable_ignored());
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
  for (const SceneDefect& defect : scene.defects) {
    v1::SceneDefect& added = *message->add_defects();
    added.set_reason(ToMessage(defect.reason));
    added.set_message(defect.message);
  }
  if (const absl::Duration age = scene.AgeAt(now); age > settings.max_age) {
    v1::SceneDefect& added = *message->add_defects();
    added.set_reason(v1::Verdict::REASON_SCENE_STALE);
    added.set_message(absl::StrCat(
        "the oldest image is ", absl::FormatDuration(age), " old, older than max_age, ",
        absl::FormatDuration(settings.max_age), "; publish a new scene"));
  }
}

void ToMessage(const ServedDatabase& database, const Policy& default_policy,
               v1::GetDatabaseResponse* message) {
  const RobotImageTable& images = database.robot_images();
  message->set_cell_name(database.cell().name());
  message->set_generation(database.generation());
  ToMessage(database.grid(), message->mutable_grid());
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
  message->set_configurations(database.grid().size());
  message->set_captured(images.Count(RobotImageState::kPresent));
  message->set_excluded(images.Count(RobotImageState::kExcluded));
  message->set_corrupt(images.Count(RobotImageState::kCorrupt));
  ToMessage(default_policy, message->mutable_default_policy());
  message->set_calibrated(database.bands() != nullptr);
  for (const Preset preset : AllPresets()) {
    if (database.CanServe({.preset = preset}).ok()) message->add_presets(NameOf(preset));
  }
}

}  // namespace silhouette
