// SPDX-License-Identifier: Apache-2.0
#include "server/scene/scene_store.h"

#include <algorithm>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/times/times.h"

namespace silhouette {

namespace {

// What is left of a scene if it is not known what the robot looks like in it.
void ForgetVariant(Scene& scene, const std::string& why) {
  scene.variant.clear();
  std::ranges::fill(scene.obstacle_images, std::nullopt);
  std::ranges::fill(scene.without_margins, std::nullopt);
  std::erase_if(scene.defects, [](const auto& d) { return d.reason == Reason::kVariantUnknown; });
  scene.defects.insert(scene.defects.begin(), {Reason::kVariantUnknown, why});
}

// By how much a scene is older than the one that is served. Its newest image counts: late images of
// some views do not keep away what the others show now. Only between scenes whose newest images are
// equally new, the oldest count.
absl::Duration OlderBy(const Scene& scene, const Scene& served) {
  const absl::Duration older = served.newest - scene.newest;
  if (absl::AbsDuration(older) > kClockJitter) return older;
  return served.oldest.running - scene.oldest.running;
}

}  // namespace

absl::StatusOr<Served> WithVariant(Served served, const std::string& name) {
  if (served.whole == nullptr) served.whole = served.database;
  const std::string& wanted =
      name.empty() && served.scene != nullptr ? served.scene->variant : name;
  std::shared_ptr<const ServedDatabase> variant = ServedDatabase::VariantOf(served.whole, wanted);
  if (variant != nullptr) {
    served.database = std::move(variant);
  } else if (!name.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("variant: the database has no variant '", name,
                                                   "'; its variants are ",
                                                   absl::StrJoin(served.whole->variants(), ", ")));
  }
  return served;
}

SceneStore::SceneStore(std::shared_ptr<const ServedDatabase> database, size_t kept)
    : kept_(std::max<size_t>(kept, 1)), database_(std::move(database)) {}

absl::StatusOr<SharedScene> SceneStore::Publish(
    Scene scene, const std::shared_ptr<const ServedDatabase>& database) {
  const std::lock_guard lock(mutex_);
  if (database != database_) {
    return absl::AbortedError(
        "the database was replaced while the scene was being made; publish it again");
  }
  // It has no image that later ones would have to be newer than.
  if (std::ranges::none_of(scene.views, [](const auto& view) { return view.has_value(); })) {
    scene.newest = scenes_.empty() ? absl::ZeroDuration() : scenes_.back()->newest;
  }
  if (!scenes_.empty()) {
    const absl::Duration older = OlderBy(scene, *scenes_.back());
    if (older > kClockJitter) {
      return absl::FailedPreconditionError(absl::StrCat("the images are ", SpokenTime(older),
                                                        " older than those of scene ",
                                                        scenes_.back()->id, ", which is served"));
    }
  }
  return Add(std::move(scene));
}

SharedScene SceneStore::Add(Scene scene) {
  if (IsWithdrawn(scene)) ForgetVariant(scene, why_withdrawn_);
  scene.id = ++last_id_;
  scenes_.push_back(std::make_shared<const Scene>(std::move(scene)));
  if (scenes_.size() > kept_) scenes_.pop_front();
  NoteChange();
  return scenes_.back();
}

void SceneStore::Withdraw(const std::string& why, const Moment& now) {
  const std::lock_guard lock(mutex_);
  withdrawn_until_ = std::max(withdrawn_until_, now.running);
  why_withdrawn_ = why;
  if (!scenes_.empty()) Add(*scenes_.back());
  NoteChange();
  last_withdrawn_ = last_id_;
}

uint64_t SceneStore::last_withdrawn() const {
  const std::lock_guard lock(mutex_);
  return last_withdrawn_;
}

bool SceneStore::Withdrawn(const Scene& scene) const {
  const std::lock_guard lock(mutex_);
  return IsWithdrawn(scene);
}

void SceneStore::ReplaceDatabase(std::shared_ptr<const ServedDatabase> database) {
  const std::lock_guard lock(mutex_);
  database_replaced_ = database_replaced_ || !scenes_.empty();
  scenes_.clear();
  regions_.Clear();
  with_regions_ = nullptr;
  NoteChange();
  database_.swap(database);  // the last reader frees the old one
}

SharedScene SceneStore::WithRegions(const SharedScene& scene, const RegionSet& regions) {
  if (regions.regions.empty()) return scene;
  if (with_regions_ == nullptr || with_regions_of_scene_ != scene->id ||
      with_regions_of_revision_ != regions.revision) {
    Scene changed = *scene;
    std::vector<double> margins;
    for (const std::optional<SceneView>& view : scene->views) {
      margins.push_back(view ? view->margin : 0);
    }
    changed.region_effects =
        Apply(regions, margins, changed.without_margins, changed.obstacle_images);
    with_regions_ = std::make_shared<const Scene>(std::move(changed));
    with_regions_of_scene_ = scene->id;
    with_regions_of_revision_ = regions.revision;
  }
  return with_regions_;
}

Served SceneStore::Newest(const Moment& now) {
  const std::lock_guard lock(mutex_);
  const std::shared_ptr<const RegionSet> regions = regions_.InForce(now);
  if (!scenes_.empty()) {
    return {database_, WithRegions(scenes_.back(), *regions), Reason::kNone, regions, trust_,
            database_};
  }
  return {database_, nullptr, database_replaced_ ? Reason::kGenerationMismatch : Reason::kNoScene,
          regions,   trust_,  database_};
}

absl::StatusOr<AllowedRegion> SceneStore::Allow(
    const std::string& name, std::vector<std::optional<Mask>> pixels, absl::Duration duration,
    const Moment& now, const std::shared_ptr<const ServedDatabase>& database) {
  const std::lock_guard lock(mutex_);
  if (database != database_) {
    return absl::AbortedError("the database was replaced meanwhile; allow the region again");
  }
  NoteChange();
  return regions_.Allow(name, std::move(pixels), duration, now);
}

bool SceneStore::Revoke(const std::string& name, const Moment& now) {
  const std::lock_guard lock(mutex_);
  NoteChange();
  return regions_.Revoke(name, now);
}

std::vector<AllowedRegion> SceneStore::TakeEnded(const Moment& now) {
  const std::lock_guard lock(mutex_);
  return regions_.TakeEnded(now);
}

void SceneStore::SetTrust(std::shared_ptr<const CalibrationTrust> trust) {
  const std::lock_guard lock(mutex_);
  trust_ = std::move(trust);
  NoteChange();
}

std::shared_ptr<const CalibrationTrust> SceneStore::trust() const {
  const std::lock_guard lock(mutex_);
  return trust_;
}

std::shared_ptr<const ServedDatabase> SceneStore::database() const {
  const std::lock_guard lock(mutex_);
  return database_;
}

bool SceneStore::Revoked(const RegionSet& regions) const {
  const std::lock_guard lock(mutex_);
  const RegionSet& now = *regions_.set();
  if (regions.revision == now.revision) return false;
  return !std::ranges::all_of(regions.regions, [&](const AllowedRegion& region) {
    return std::ranges::any_of(now.regions, [&](const AllowedRegion& other) {
      return other.name == region.name && other.pixels == region.pixels && other.end >= region.end;
    });
  });
}

void SceneStore::NoteChange() {
  ++changes_;
  changed_.notify_all();
}

uint64_t SceneStore::WaitForChange(uint64_t seen, std::chrono::milliseconds longest,
                                   const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, stop, longest, [&] { return changes_ != seen; });
  return changes_;
}

absl::Duration SceneStore::LongestGap() const {
  const std::lock_guard lock(mutex_);
  if (scenes_.size() < 2) return absl::InfiniteDuration();
  absl::Duration longest;
  for (size_t i = 1; i < scenes_.size(); ++i) {
    const Scene &former = *scenes_[i - 1], &next = *scenes_[i];
    // A scene without images has `newest` of an earlier one, and came at `oldest`.
    const absl::Duration before = std::max(former.newest, former.oldest.running);
    longest =
        std::max({longest, next.newest - before, next.oldest.running - former.oldest.running});
  }
  return longest;
}

SharedScene SceneStore::Find(uint64_t id) const {
  const std::lock_guard lock(mutex_);
  if (scenes_.empty()) return nullptr;
  if (id == 0) return scenes_.back();
  for (const SharedScene& scene : scenes_) {
    if (scene->id == id) return scene;
  }
  return nullptr;
}

}  // namespace silhouette
