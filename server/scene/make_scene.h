// SPDX-License-Identifier: Apache-2.0
// Makes a scene of images and joint values.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "capture/segmentation/image_condition.h"
#include "capture/segmentation/settings.h"
#include "db/mask/mask.h"
#include "server/scene/clock.h"
#include "server/scene/scene.h"
#include "server/scene/scene_settings.h"
#include "server/scene/served_database.h"

namespace silhouette {

// Images may be stamped this much ahead of the server's clock.
inline constexpr absl::Duration kClockTolerance = absl::Milliseconds(100);

// The difference to the reference image: foreground pixels.
struct SceneMask {
  Mask mask;
  // The pixels of it that rest on strong evidence (GradedMask); nothing: that is not known, and
  // none counts as weak.
  std::optional<Mask> strong = std::nullopt;
  // Of the camera image that the mask was made of, where there was one.
  std::optional<ImageCondition> condition = std::nullopt;
  // Further pixels that are foreground if the robot is there (GradedMask::thin): its thin parts are
  // seen, as in its images, and a shadow on it does not make it missing; nothing: none.
  std::optional<Mask> thin = std::nullopt;
  // What `strong` was of the view's images just before, the newest first. Outside the robot,
  // evidence is then strong only if it lasted through all of them: each had some in the mask pixel
  // or its neighbours, or two mask pixels away where the next one has none any more. Noise at the
  // rim of a shadow comes and goes, a hand stays where it was or came from. What stands beside it
  // does not vouch for it. Empty: there was no image just before, and all counts.
  std::vector<Mask> strong_before = {};
};
// Of a camera image of a view of the database, and its GradedForeground(). Throws what
// ConditionOf() does.
SceneMask SceneMaskOf(const cv::Mat& image, const cv::Mat& foreground,
                      const ServedDatabase& database, int view, double min_cover);

// From a sensor that separates obstacles from the robot: the obstacle pixels.
struct ObstacleMask {
  Mask mask;
};
// An encoded camera image (PNG or JPEG), to be differenced with the view's reference image.
struct EncodedImage {
  std::string bytes;
};

// An image that came and is not used: SceneInput::without_views says why.
struct LeftOut {};

struct ViewInput {
  std::string view;
  std::optional<Moment> captured;  // nothing: the moment of arrival
  std::variant<SceneMask, ObstacleMask, EncodedImage, LeftOut> image;
};

struct SceneInput {
  std::vector<JointPosition> joints;
  std::vector<ViewInput> views;
  // Why there are no joints, where that is known; they are then not asked for.
  std::string without_joints = "";
  // Why a view has no image among `views`, by its name, where that is known.
  std::map<std::string, std::string> without_views = {};
  // The variant that shows the robot as it is: its tool, the part that it carries.
  // Empty: the default variant.
  std::string variant = "";
  // Why that is not known: one sentence; `variant` is then not asked for.
  std::string without_variant = "";
};

// Makes a scene of images that arrived at the moment `arrived`. `whole`: the database with all of
// its variants. What is wrong with the state of the
// cell becomes a defect of the scene; InvalidArgument, naming the field, is for input that says
// nothing of the cell: no view at all, nor why; an unknown view or joint or one that is given
// twice, a mask or an image of the wrong size, an image that cannot be decoded, a time in the
// future, a joint value that is not finite. FailedPrecondition: a camera image, and the database
// has no reference images.
absl::StatusOr<Scene> MakeScene(const ServedDatabase& whole, const SceneInput& input,
                                const SceneSettings& settings,
                                const SegmentationSettings& segmentation, const Moment& arrived);

}  // namespace silhouette
