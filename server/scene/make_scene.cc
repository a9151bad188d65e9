// SPDX-License-Identifier: Apache-2.0
#include "server/scene/make_scene.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "capture/segmentation/deviating_pixels.h"
#include "capture/segmentation/difference.h"
#include "common/picture/camera_image.h"
#include "common/picture/image_file.h"
#include "common/times/times.h"
#include "db/mask/mask.h"
#include "db/status/status_macros.h"
#include "server/scene/robot_in_scene.h"
#include "server/scene/scene.h"
#include "server/scene/served_database.h"
#include "server/scene/view_check.h"

namespace silhouette {

namespace {

std::string SizeText(int width, int height) { return absl::StrCat(width, "x", height); }

absl::Status CheckMask(const Mask& mask, MaskSize size) {
  if (mask.size() == size) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("the mask is ", SizeText(mask.width(), mask.height()), ", and should be ",
                   SizeText(size.width, size.height)));
}

absl::StatusOr<SceneMask> ShownBy(const EncodedImage& image, const ServedDatabase& database,
                                  int view, const SegmentationSettings& settings) {
  const Reference& reference = database.reference(view);
  const absl::Status unreadable = absl::InvalidArgumentError(
      "the camera image cannot be decoded; send a whole PNG or JPEG image");
  const std::optional<cv::Size> told = SizeOfCameraImage(image.bytes);
  if (!told) return unreadable;
  if (*told != reference.size()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the camera image is ", SizeText(told->width, told->height), ", and its reference image ",
        SizeText(reference.size().width, reference.size().height)));
  }
  const std::optional<cv::Mat> decoded = DecodeCameraImage(image.bytes);
  if (!decoded) return unreadable;
  RETURN_IF_ERROR(CheckUsedBits("the camera image", image.bytes, *decoded));
  try {
    return SceneMaskOf(*decoded, GradedForeground(*decoded, reference, settings), database, view,
                       settings.min_cover);
  } catch (const cv::Exception&) {
    return unreadable;
  }
}

absl::StatusOr<SceneMask> ShownIn(const ServedDatabase& database, int view, const ViewInput& input,
                                  const SegmentationSettings& segmentation) {
  const MaskSize size = database.robot_images().mask_sizes()[static_cast<size_t>(view)];
  if (const auto* scene = std::get_if<SceneMask>(&input.image)) {
    RETURN_IF_ERROR(CheckMask(scene->mask, size));
    if (scene->strong) RETURN_IF_ERROR(CheckMask(*scene->strong, size));
    for (const Mask& before : scene->strong_before) RETURN_IF_ERROR(CheckMask(before, size));
    if (scene->thin) RETURN_IF_ERROR(CheckMask(*scene->thin, size));
    return *scene;
  }
  if (const auto* obstacles = std::get_if<ObstacleMask>(&input.image)) {
    RETURN_IF_ERROR(CheckMask(obstacles->mask, size));
    return SceneMask{obstacles->mask};
  }
  if (!database.has_references()) {
    return absl::FailedPreconditionError(
        "the database has no reference images to difference a camera image with; take them, or "
        "publish scene masks");
  }
  return ShownBy(std::get<EncodedImage>(input.image), database, view, segmentation);
}

// The view that the input speaks of, and is the first to.
absl::StatusOr<int> NewView(const ServedDatabase& database, const SceneInput& input,
                            const Scene& scene, const std::string& name) {
  const std::optional<int> view = database.ViewOf(name);
  if (!view) {
    std::vector<std::string> known;
    for (int i = 0; i < database.views(); ++i) known.push_back(database.view_name(i));
    return absl::InvalidArgumentError(
        absl::StrCat("the cell has no such view; its views are ", absl::StrJoin(known, ", ")));
  }
  if (scene.views[static_cast<size_t>(*view)] || input.without_views.contains(name)) {
    return absl::InvalidArgumentError("the view is given twice");
  }
  return *view;
}

// When the image was taken.
absl::StatusOr<Moment> CaptureOf(const ViewInput& input, const Moment& arrived) {
  const Moment captured = input.captured.value_or(arrived);
  if (captured.running <= arrived.running + kClockTolerance) return captured;
  return absl::InvalidArgumentError(
      absl::StrCat("capture_time is ", SpokenTime(captured.running - arrived.running),
                   " in the future; let the clocks of camera and server agree"));
}

// By view, of those that were made of camera images.
using Conditions = std::vector<std::optional<ImageCondition>>;

// Mask pixels from the rim of one to the rim of another: up to one pixel further, and up to two.
constexpr double kBeside = 1;
constexpr double kBetweenImages = 1.5;

// What of the evidence `strong` is on the robot, or was in all images before (SceneMask).
Mask Lasting(const Mask& strong, const std::vector<Mask>& before, const Mask& robot) {
  Mask lasting = before.back() - robot;
  const auto into = [&](const Mask& next) {
    return next & (Grown(lasting, kBeside) | Grown(lasting - next, kBetweenImages));
  };
  for (size_t i = before.size() - 1; i > 0; --i) lasting = into(before[i - 1] - robot);
  return strong & (robot | into(strong));
}

absl::Status AddView(const ServedDatabase& database, int view, const ViewInput& input,
                     const SegmentationSettings& segmentation, absl::Time captured,
                     const std::vector<RobotCover>& covers, Scene& scene, Conditions& conditions) {
  ASSIGN_OR_RETURN(SceneMask shown, ShownIn(database, view, input, segmentation));
  const auto at = static_cast<size_t>(view);
  if (shown.thin && !covers.empty()) {
    shown.mask = shown.mask | (*shown.thin & covers[at].anywhere);
  }
  if (shown.strong && !shown.strong_before.empty() && !covers.empty()) {
    shown.strong = Lasting(*shown.strong, shown.strong_before, covers[at].anywhere);
  }
  const ViewTreatment& treatment = database.treatment(view);
  scene.views[at] = SceneView{.name = input.view,
                              .captured = captured,
                              .foreground = std::move(shown.mask),
                              .strong = std::move(shown.strong),
                              .separates_robot = std::holds_alternative<ObstacleMask>(input.image),
                              .ignored = treatment.ignored,
                              .margin = treatment.margin};
  conditions[at] = shown.condition;
  return absl::OkStatus();
}

void MakeObstacleImages(const std::vector<RobotCover>& covers, WeakRim weak_rim, Scene& scene) {
  if (covers.empty()) return;
  for (size_t view = 0; view < scene.views.size(); ++view) {
    if (!scene.views[view]) continue;
    SceneView& seen = *scene.views[view];
    const Mask& foreground = seen.foreground;
    const RobotCover& robot = covers[view];
    ObstacleImage image = seen.separates_robot
                              ? ObstacleImage::FromObstacles(foreground, robot.anywhere)
                              : ObstacleImage::FromScene(foreground, robot.anywhere, robot.certain);
    if (seen.strong && weak_rim == WeakRim::kUnknown) {
      image = image.WithoutWeakRim(*seen.strong, robot.anywhere);
    }
    if (seen.ignored) image = image.Ignoring(*seen.ignored);
    seen.core_error_pixels = static_cast<uint32_t>(Core(image.error()).Count());
    scene.obstacle_images[view] = image.WithMargin(seen.margin);
    scene.without_margins[view] = std::move(image);
  }
}

// Where the robot is, as far as the input says so.
absl::StatusOr<RobotInScene> RobotOf(const ServedDatabase& database, const SceneInput& input,
                                     const SceneSettings& settings) {
  if (!input.joints.empty() || input.without_joints.empty()) {
    return FindRobot(database, input.joints, settings.fixed_joint_tolerance);
  }
  return RobotInScene{
      .covers = {},
      .defects = {{Reason::kRobotPositionUnknown,
                   absl::StrCat("where the robot was is not known: ", input.without_joints)}}};
}

std::string WhyMissing(const SceneInput& input, const std::string& view) {
  const auto why = input.without_views.find(view);
  return why == input.without_views.end() ? "publish the images of all views together"
                                          : why->second;
}

std::string WhyNoVariant(const ServedDatabase& whole, const SceneInput& input) {
  if (!input.without_variant.empty()) return input.without_variant;
  return absl::StrCat("the database has no variant '", input.variant, "'; capture it, or ",
                      "publish the scene with one of ", absl::StrJoin(whole.variants(), ", "));
}

// What is wrong with what the views of the scene show.
std::vector<SceneDefect> DefectsOfViews(const ServedDatabase& database,
                                        const SceneSettings& settings, const Conditions& conditions,
                                        const std::vector<RobotCover>& covers, const Scene& scene) {
  std::vector<std::string> names;
  std::vector<ViewToCheck> checked;
  for (size_t view = 0; view < scene.views.size(); ++view) {
    names.push_back(database.view_name(static_cast<int>(view)));
    const std::optional<SceneView>& seen = scene.views[view];
    if (!seen) continue;
    checked.push_back({.name = seen->name,
                       .condition = conditions[view] ? &*conditions[view] : nullptr,
                       .foreground = seen->separates_robot ? nullptr : &seen->foreground,
                       .robot = covers.empty() ? nullptr : &covers[view],
                       .base = &database.robot_images().permanent(static_cast<int>(view)),
                       .ignored = seen->ignored ? &*seen->ignored : nullptr});
  }
  return CheckViews(checked, names, settings.view_check);
}

void FindDefects(const ServedDatabase& database, const SceneSettings& settings,
                 const SceneInput& input, const Conditions& conditions,
                 const std::vector<RobotCover>& covers, Scene& scene) {
  if (!database.margins_known().ok()) {
    scene.defects.push_back(
        {Reason::kMarginUnknown, std::string(database.margins_known().message())});
  }
  if (scene.skew > settings.max_skew) {
    scene.defects.push_back(
        {Reason::kSceneSkewed,
         absl::StrCat("the images were taken ", SpokenTimeAbove(settings.max_skew, scene.skew),
                      " apart, more than max_skew, ", SpokenTime(settings.max_skew),
                      "; trigger the cameras together")});
  }
  std::ranges::move(DefectsOfViews(database, settings, conditions, covers, scene),
                    std::back_inserter(scene.defects));
  Failing missing;
  for (int view = 0; view < database.views(); ++view) {
    const std::optional<SceneView>& seen = scene.views[static_cast<size_t>(view)];
    const std::string& name = database.view_name(view);
    if (!seen) {
      missing.Add(name, WhyMissing(input, name));
    } else if (seen->core_error_pixels >
               settings.max_core_error * static_cast<double>(seen->foreground.size().pixels())) {
      scene.defects.push_back(
          {Reason::kErrorArea,
           absl::StrCat("view '", name, "' shows background where the robot should be, on ",
                        seen->core_error_pixels, " of ", seen->foreground.size().pixels(),
                        " pixels, rims not counted: the robot is not "
                        "where it says, the camera moved, or the light changed")});
    }
  }
  for (const Failing::Group& group : missing.groups()) {
    scene.defects.push_back(
        {Reason::kViewMissing,
         absl::StrCat(group.Named("view"),
                      group.several() ? " are missing and count" : " is missing and counts",
                      " as showing an obstacle; ", group.why)});
  }
}

absl::Status InField(const absl::Status& status, size_t i, const ViewInput& input) {
  return absl::Status(status.code(),
                      absl::StrCat("views[", i, "] '", input.view, "': ", status.message()));
}

}  // namespace

SceneMask SceneMaskOf(const cv::Mat& image, const cv::Mat& foreground,
                      const ServedDatabase& database, int view, double min_cover) {
  const auto at = static_cast<size_t>(view);
  GradedMask mask = Graded(foreground, database.robot_images().mask_sizes()[at], min_cover);
  return {std::move(mask.all), std::move(mask.strong),
          ConditionOf(image, foreground > kShadow, database.outlines(), at), std::move(mask.thin)};
}

absl::StatusOr<Scene> MakeScene(const ServedDatabase& whole, const SceneInput& input,
                                const SceneSettings& settings,
                                const SegmentationSettings& segmentation, const Moment& arrived) {
  const ServedDatabase* variant =
      input.without_variant.empty() ? whole.Variant(input.variant) : nullptr;
  const ServedDatabase& database = variant != nullptr ? *variant : whole;
  if (input.views.empty() && input.without_views.empty()) {
    return absl::InvalidArgumentError("views: a scene has an image of at least one view");
  }
  const auto views = static_cast<size_t>(database.views());
  Scene scene;
  scene.generation = database.generation();
  scene.arrived = arrived;
  scene.joints = input.joints;
  scene.variant = variant != nullptr              ? variant->variant()
                  : input.without_variant.empty() ? input.variant
                                                  : "";
  scene.views.resize(views);
  scene.obstacle_images.resize(views);
  scene.without_margins.resize(views);
  ASSIGN_OR_RETURN(RobotInScene robot, RobotOf(database, input, settings));
  Conditions conditions(views);
  scene.oldest = {absl::InfiniteFuture(), absl::InfiniteDuration()};
  absl::Duration newest = -absl::InfiniteDuration();
  for (size_t i = 0; i < input.views.size(); ++i) {
    const ViewInput& view = input.views[i];
    if (std::holds_alternative<LeftOut>(view.image)) continue;
    const absl::StatusOr<Moment> captured = CaptureOf(view, arrived);
    if (!captured.ok()) return InField(captured.status(), i, view);
    const absl::StatusOr<int> number = NewView(database, input, scene, view.view);
    if (!number.ok()) return InField(number.status(), i, view);
    const absl::Status added = AddView(database, *number, view, segmentation, captured->time,
                                       robot.covers, scene, conditions);
    if (!added.ok()) return InField(added, i, view);
    if (captured->running < scene.oldest.running) scene.oldest = *captured;
    newest = std::max(newest, captured->running);
  }
  if (scene.oldest.running == absl::InfiniteDuration()) {  // no image
    scene.oldest = arrived;
    newest = arrived.running;
  }
  scene.skew = newest - scene.oldest.running;
  // A stamp of a clock that is a little ahead makes no image younger than its arrival.
  scene.oldest.running = std::min(scene.oldest.running, arrived.running);
  scene.newest = std::min(newest, arrived.running);
  if (variant == nullptr) {
    robot.covers.clear();
    robot.defects.insert(robot.defects.begin(),
                         {Reason::kVariantUnknown, WhyNoVariant(whole, input)});
  }
  scene.defects = std::move(robot.defects);
  MakeObstacleImages(robot.covers, settings.weak_rim, scene);
  FindDefects(database, settings, input, conditions, robot.covers, scene);
  return scene;
}

}  // namespace silhouette
