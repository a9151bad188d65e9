// SPDX-License-Identifier: Apache-2.0
#include "server/live/acquisition.h"

#include <algorithm>
#include <opencv2/core.hpp>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "capture/segmentation/deviating_pixels.h"
#include "capture/segmentation/difference.h"
#include "db/status/status_macros.h"
#include "server/scene/robot_in_scene.h"

namespace silhouette {
namespace {

std::vector<bool> HaveNoise(const storage::v1::CellDescription& cell,
                            const std::set<std::string>& without_noise) {
  std::vector<bool> have;
  for (const storage::v1::View& view : cell.views()) {
    have.push_back(!without_noise.contains(view.name()));
  }
  return have;
}

// How often a view's slow light learns, and how long ago the image before may have been taken.
constexpr absl::Duration kLearnInterval = absl::Seconds(1);
constexpr absl::Duration kLongestGap = absl::Seconds(10);
// Through how many images before it evidence at the robot's rim has to last.
constexpr size_t kEvidenceImages = 2;

bool SameReference(const Reference& a, const Reference& b) {
  return a.size() == b.size() && a.channels() == b.channels() &&
         cv::norm(a.mean(), b.mean(), cv::NORM_INF) == 0 &&
         cv::norm(a.noise(), b.noise(), cv::NORM_INF) == 0;
}

// What a view sees in `image`, which is as the cell says (ImageJudge). `light` learns from it, if
// `since`, the time since it did so, is long enough; it is then set to 0.
absl::StatusOr<SceneMask> SeenIn(const CameraImage& image, const ServedDatabase& database, int view,
                                 const SegmentationSettings& segmentation, SlowLight& light,
                                 absl::Duration& since) {
  try {
    const cv::Mat pixels(image.height, image.width, image.channels == 3 ? CV_8UC3 : CV_8UC1,
                         const_cast<uint8_t*>(image.pixels.data()));
    const Reference& reference = database.reference(view);
    const cv::Mat seen = reference.channels() == 1 ? Grey(pixels) : pixels;
    const cv::Mat foreground = GradedForeground(pixels, reference, segmentation, light);
    if (segmentation.follow_brightness && since >= kLearnInterval &&
        seen.channels() == reference.channels()) {
      const absl::Duration learnt = std::min(since, kLongestGap);
      light = light.Learn(seen, reference, foreground, absl::ToDoubleSeconds(learnt));
      since = absl::ZeroDuration();
    }
    return SceneMaskOf(pixels, foreground, database, view, segmentation.min_cover);
  } catch (const std::exception& error) {
    return absl::InternalError(error.what());
  }
}

}  // namespace

Acquisition::Acquisition(const LiveConfig& config, LiveScenes scenes, JointsBetween joints,
                         std::shared_ptr<LiveRecord> record,
                         const storage::v1::CellDescription& cell)
    : config_(config),
      scenes_(std::move(scenes)),
      joints_(std::move(joints)),
      record_(std::move(record)),
      cell_(cell),
      judge_(cell, config.scene.max_age),
      life_(config.live.life, HaveNoise(cell, config.without_noise)),
      helpers_(config.live.threads) {}

absl::Status Acquisition::Take(GrabbedImages set) {
  const std::shared_ptr<const ServedDatabase> database = scenes_.database();
  if (!database->has_references()) {
    return absl::FailedPreconditionError("the database has no reference images any more");
  }
  const Moment arrived = set.arrived;
  SceneInput input;
  auto images = UsableImages(std::move(set), *database, input);
  const bool none =
      std::ranges::none_of(images, [](const auto& image) { return image.has_value(); });
  const bool news = judge_.TakeNews();
  absl::Status status;
  if (none) {
    status = absl::UnavailableError(
        absl::StrCat("no image can be used: ", input.without_views.begin()->second));
    // The newest scene may rest on images of a camera that was frozen already.
    if (!life_.AnyDead()) return status;
  } else if (!news) {
    return absl::OkStatus();
  }
  // What is wrong from here on is no fault of the cameras.
  const absl::StatusOr<SharedScene> published =
      Publish(database, images, arrived, std::move(input));
  if (!published.ok()) {
    record_->NoteLostSet(published.status());
    return status;
  }
  LiveImages of_scene{.scene = (*published)->id, .images = {}};
  for (std::optional<LiveImage>& image : images) {
    std::optional<CameraImage>& added = of_scene.images.emplace_back();
    if (image) added = std::move(image->image);
  }
  record_->NoteImages(std::move(of_scene));
  return status;
}

void Acquisition::NoteUnusable(size_t view, const absl::Status& why, SceneInput& input) {
  record_->NoteImageError(view, why);
  input.without_views[cell_.views(static_cast<int>(view)).name()] = std::string(why.message());
}

std::vector<std::optional<Acquisition::LiveImage>> Acquisition::UsableImages(
    GrabbedImages set, const ServedDatabase& database, SceneInput& input) {
  std::vector<std::optional<LiveImage>> images(set.images.size());
  for (size_t view = 0; view < images.size(); ++view) {
    absl::StatusOr<CameraImage>& image = set.images[view];
    const absl::StatusOr<Moment> taken =
        image.ok() ? judge_.Judge(view, *image, set.asked, set.arrived) : image.status();
    absl::Status status = taken.status();
    if (status.ok()) {
      status = life_.Judge(view, *image, database.reference(static_cast<int>(view)));
    }
    if (!status.ok()) {
      NoteUnusable(view, status, input);
      continue;
    }
    record_->NoteImage(view, *taken, set.arrived);
    images[view] = LiveImage{*std::move(image), *taken};
  }
  return images;
}

std::vector<bool> Acquisition::MovedWithTheRobot(
    const ServedDatabase& database, const std::vector<std::optional<LiveImage>>& images,
    const std::vector<const Mask*>& masks, SceneInput& input) {
  std::vector<bool> live(images.size(), true);
  const ServedDatabase* variant =
      input.without_variant.empty() ? database.Variant(input.variant) : nullptr;
  if (variant == nullptr || input.joints.empty()) return live;
  const auto robot = FindRobot(*variant, input.joints, config_.scene.fixed_joint_tolerance);
  if (!robot.ok() || robot->covers.empty()) return live;
  for (size_t view = 0; view < images.size(); ++view) {
    if (!images[view]) continue;
    const absl::Status moved = life_.JudgeMotion(view, robot->covers[view], *masks[view],
                                                 database.reference(static_cast<int>(view)));
    live[view] = moved.ok();
    if (!moved.ok()) NoteUnusable(view, moved, input);
  }
  return live;
}

absl::StatusOr<SharedScene> Acquisition::Publish(
    const std::shared_ptr<const ServedDatabase>& database,
    const std::vector<std::optional<LiveImage>>& images, const Moment& arrived, SceneInput input) {
  if (light_of_ != database) {
    lights_.resize(images.size());
    for (size_t view = 0; view < images.size(); ++view) {
      const int v = static_cast<int>(view);
      const bool same =
          light_of_ != nullptr && SameReference(light_of_->reference(v), database->reference(v));
      if (!same) lights_[view] = {};
    }
    light_of_ = database;
    lights_learnt_ = arrived.running;
    since_learnt_.assign(images.size(), absl::ZeroDuration());
    before_.assign(images.size(), {});
    life_.ForgetRobot();
  }
  for (absl::Duration& since : since_learnt_) since += arrived.running - lights_learnt_;
  lights_learnt_ = arrived.running;
  std::vector<absl::StatusOr<SceneMask>> seen(images.size(), SceneMask());
  // A stamp of a clock that is ahead makes no image younger than its arrival.
  const auto taken_of = [&](size_t view) {
    return std::min(images[view]->taken.running, arrived.running);
  };
  const auto gap_of = [&](size_t view) { return taken_of(view) - before_[view].taken; };
  helpers_.ForEach(images.size(), [&](size_t view) {
    if (!images[view]) return;
    seen[view] = SeenIn(images[view]->image, *database, static_cast<int>(view),
                        config_.segmentation, lights_[view], since_learnt_[view]);
  });
  record_->NoteMasks(arrived);
  absl::Duration oldest = absl::InfiniteDuration();
  absl::Duration newest = -absl::InfiniteDuration();
  for (size_t view = 0; view < images.size(); ++view) {
    if (!images[view]) continue;
    if (!seen[view].ok()) return seen[view].status();
    const absl::Duration taken = taken_of(view);
    oldest = std::min(oldest, taken);
    newest = std::max(newest, taken);
    std::vector<Mask>& before = before_[view].strong;
    if (gap_of(view) > config_.live.evidence_gap) before.clear();
    seen[view]->strong_before = before;
    before.insert(before.begin(), *seen[view]->strong);
    if (before.size() > kEvidenceImages) before.pop_back();
    before_[view].taken = taken;
  }
  if (oldest > newest) oldest = newest = arrived.running;
  absl::StatusOr<std::vector<JointPosition>> joints = joints_(oldest, newest);
  record_->NoteJoined(joints.status());
  if (joints.ok()) {
    input.joints = *std::move(joints);
  } else {
    input.without_joints = std::string(joints.status().message());
  }
  const absl::StatusOr<std::string> variant =
      record_->known_variant().Of(oldest, database->variants());
  if (variant.ok()) {
    input.variant = *variant;
  } else {
    input.without_variant = std::string(variant.status().message());
  }
  std::vector<const Mask*> masks;
  for (const absl::StatusOr<SceneMask>& view : seen) masks.push_back(&view->mask);
  const std::vector<bool> live = MovedWithTheRobot(*database, images, masks, input);
  for (size_t view = 0; view < images.size(); ++view) {
    if (!images[view] || !live[view]) continue;
    input.views.push_back({.view = database->view_name(static_cast<int>(view)),
                           .captured = images[view]->taken,
                           .image = *std::move(seen[view])});
  }
  ASSIGN_OR_RETURN(Scene scene,
                   MakeScene(*database, input, config_.scene, config_.segmentation, arrived));
  ASSIGN_OR_RETURN(SharedScene published, scenes_.publish(std::move(scene), database));
  record_->NoteScene(arrived);
  return published;
}

}  // namespace silhouette
