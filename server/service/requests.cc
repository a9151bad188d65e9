// SPDX-License-Identifier: Apache-2.0
#include "server/service/messages.h"

#include <stdexcept>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/times/times.h"
#include "db/status/status_macros.h"
#include "server/service/calls.h"

namespace silhouette {
namespace {

absl::StatusOr<absl::Time> TimeFrom(const google::protobuf::Timestamp& message,
                                    const std::string& field) {
  constexpr int64_t kYear10000 = 253'402'300'800;
  if (message.seconds() < 0 || message.seconds() >= kYear10000 || message.nanos() < 0 ||
      message.nanos() > 999'999'999) {
    return FieldError(field, "it is not a time after 1970");
  }
  return absl::FromUnixSeconds(message.seconds()) + absl::Nanoseconds(message.nanos());
}

absl::StatusOr<Mask> MaskFrom(const v1::Mask& message, const std::string& field) {
  const std::string& bits = message.bits();
  try {
    return Mask::FromBytes({message.width(), message.height()},
                           {reinterpret_cast<const uint8_t*>(bits.data()), bits.size()});
  } catch (const std::invalid_argument& error) {
    return FieldError(field, error.what());
  }
}

// When the image was taken; nothing: it does not say.
absl::StatusOr<std::optional<Moment>> CaptureFrom(const v1::ViewImage& message,
                                                  const Moment& arrived, const std::string& field) {
  std::optional<Moment> captured;
  if (message.has_capture_time()) {
    ASSIGN_OR_RETURN(const absl::Time time,
                     TimeFrom(message.capture_time(), absl::StrCat(field, ".capture_time")));
    captured = MomentOf(time, arrived);
  }
  if (!message.has_server_clock()) return captured;
  constexpr int64_t kTenThousandYears = 315'576'000'000;
  const int64_t seconds = message.server_clock().seconds();
  if (seconds > kTenThousandYears || seconds < -kTenThousandYears) {
    return FieldError(absl::StrCat(field, ".server_clock"),
                      "it is not a time of the server's clock");
  }
  const absl::Duration clock = DurationFrom(message.server_clock());
  const absl::Duration ago = arrived.running - clock;
  if (ago < absl::ZeroDuration()) {
    return absl::OutOfRangeError(
        absl::StrCat(field, ".server_clock: it is ", SpokenTime(-ago),
                     " in the future; the server's computer was restarted since the caller read "
                     "its clock: read it again"));
  }
  return Moment{captured ? captured->time : arrived.time - ago, clock};
}

absl::StatusOr<ViewInput> ViewInputFrom(const v1::ViewImage& message, const SceneSettings& settings,
                                        const Moment& arrived, const std::string& field) {
  ViewInput input;
  input.view = message.view();
  ASSIGN_OR_RETURN(input.captured, CaptureFrom(message, arrived, field));
  if (!input.captured && !settings.accept_arrival_times) {
    return FieldError(field,
                      "the image has no capture time, and one that was held up is older than its "
                      "arrival says; state server_clock or capture_time");
  }
  if (message.has_strong_mask() && message.image_case() != v1::ViewImage::kSceneMask) {
    return InvalidArgument(field, ".strong_mask goes with scene_mask only");
  }
  switch (message.image_case()) {
    case v1::ViewImage::kSceneMask: {
      ASSIGN_OR_RETURN(Mask mask,
                       MaskFrom(message.scene_mask(), absl::StrCat(field, ".scene_mask")));
      SceneMask shown{std::move(mask)};
      if (message.has_strong_mask()) {
        ASSIGN_OR_RETURN(shown.strong,
                         MaskFrom(message.strong_mask(), absl::StrCat(field, ".strong_mask")));
        if (shown.strong->size() != shown.mask.size() || !(*shown.strong - shown.mask).Empty()) {
          return InvalidArgument(field, ".strong_mask has pixels that scene_mask has not");
        }
      }
      input.image = std::move(shown);
      return input;
    }
    case v1::ViewImage::kObstacleMask: {
      ASSIGN_OR_RETURN(Mask mask,
                       MaskFrom(message.obstacle_mask(), absl::StrCat(field, ".obstacle_mask")));
      input.image = ObstacleMask{std::move(mask)};
      return input;
    }
    case v1::ViewImage::kCameraImage:
      input.image = EncodedImage{message.camera_image()};
      return input;
    case v1::ViewImage::IMAGE_NOT_SET:
      break;
  }
  return FieldError(field, "give one of scene_mask, camera_image and obstacle_mask");
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
    return FieldError(field + ".polygon", std::string(mask.status().message()));
  }
  if (!message.has_mask()) return FieldError(field, "give one of mask and polygon");
  absl::StatusOr<Mask> mask = MaskFrom(message.mask(), field + ".mask");
  if (!mask.ok() || mask->size() == size) return mask;
  return FieldError(field + ".mask",
                    absl::StrCat("it is ", mask->width(), "x", mask->height(), ", and should be ",
                                 size.width, "x", size.height));
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
      return FieldError("policy.off_grid", "this server does not know the value");
  }
}

}  // namespace

absl::StatusOr<Policy> PolicyFrom(const v1::Policy& message, const Policy& defaults, int views) {
  Policy policy = defaults;
  if (!message.preset().empty()) {
    const std::optional<Preset> preset = PresetFromName(message.preset());
    if (!preset) {
      return FieldError(
          "policy.preset",
          absl::StrCat("'", message.preset(), "' is unknown; known are ", NamesOfPresets()));
    }
    policy.preset = *preset;
    // What the server says of its default preset went with it.
    policy.min_views.reset();
  }
  if (message.has_max_occluded_views()) {
    if (policy.preset != Preset::kUncalibrated) {
      return FieldError("policy.max_occluded_views", "it goes with the preset 'uncalibrated'");
    }
    // The default, 1, is one of a single view, too.
    if (message.max_occluded_views() > std::max(1, views - 1)) {
      return FieldError("policy.max_occluded_views",
                        absl::StrCat("it must be less than ", views, ", the number of views, not ",
                                     message.max_occluded_views()));
    }
    policy.max_occluded_views = message.max_occluded_views();
    policy.min_views.reset();
  }
  if (message.has_min_views()) policy.min_views = message.min_views();
  RETURN_IF_ERROR(SetOffGrid(message, policy));
  try {
    MinViews(policy, views);
  } catch (const std::invalid_argument& error) {
    return FieldError("policy", error.what());
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
  return FieldError(field, absl::StrCat("it has ", message.positions_size(),
                                        message.positions_size() == 1 ? " position" : " positions",
                                        " and takes one for each of ", joints));
}

absl::StatusOr<SceneInput> SceneInputFrom(const v1::PublishSceneRequest& message,
                                          const SceneSettings& settings, const Moment& arrived) {
  SceneInput input;
  input.variant = message.variant();
  for (const v1::JointPosition& joint : message.joints()) {
    input.joints.push_back({joint.name(), joint.position()});
  }
  for (int i = 0; i < message.views_size(); ++i) {
    const std::string field = absl::StrCat("views[", i, "] '", message.views(i).view(), "'");
    ASSIGN_OR_RETURN(ViewInput view, ViewInputFrom(message.views(i), settings, arrived, field));
    input.views.push_back(std::move(view));
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
    if (!view) return FieldError(field, "the cell has no such view");
    std::optional<Mask>& known = pixels[static_cast<size_t>(*view)];
    if (known) return FieldError(field, "the view is given twice");
    ASSIGN_OR_RETURN(
        Mask mask,
        PixelsFrom(given, database.robot_images().mask_sizes()[static_cast<size_t>(*view)], field));
    known = std::move(mask);
  }
  return pixels;
}

absl::Duration DurationFrom(const google::protobuf::Duration& message) {
  return absl::Seconds(message.seconds()) + absl::Nanoseconds(message.nanos());
}

}  // namespace silhouette
