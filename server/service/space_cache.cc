// SPDX-License-Identifier: Apache-2.0
#include "server/service/space_cache.h"

#include <algorithm>
#include <iterator>

namespace silhouette {

namespace {

// The policy, with all said that it leaves open and nothing that the grid's own configurations do
// not depend on: equal policies give equal spaces.
Policy OnGrid(const Policy& policy, int views) {
  Policy plain;
  plain.min_views = MinViews(policy, views);
  if (policy.preset == Preset::kUncalibrated || policy.preset == Preset::kPaper) return plain;
  plain.preset = policy.preset;
  if (IsSound(policy.preset)) plain.max_occluded_views = MaxOccludedViews(policy, views);
  return plain;
}

}  // namespace

std::shared_ptr<SpaceCache::Entry> SpaceCache::EntryFor(const Served& served,
                                                        const Policy& policy) {
  const SharedScene& scene = served.scene;
  const std::lock_guard lock(mutex_);
  for (const std::shared_ptr<Entry>& entry : entries_) {
    if (entry->scene == scene && entry->database == served.database && entry->policy == policy) {
      return entry;
    }
  }
  auto made = std::make_shared<Entry>();
  made->scene = scene;
  made->database = served.database;
  made->policy = policy;
  // Who was overtaken by a newer scene does not take its maps away.
  if (!entries_.empty() && entries_.front()->scene->id > scene->id) return made;
  // Who still computes an older scene's space holds its entry.
  entries_.remove_if([&](const std::shared_ptr<Entry>& entry) { return entry->scene != scene; });
  entries_.push_front(made);
  if (entries_.size() > kEntries) entries_.pop_back();
  return made;
}

std::shared_ptr<const ConfigurationSpace> SpaceCache::Get(const Served& served,
                                                          const Policy& policy) {
  const std::shared_ptr<Entry> entry = EntryFor(served, OnGrid(policy, served.database->views()));
  return entry->space.Get(
      [&] { return std::make_shared<const ConfigurationSpace>(served, policy); });
}

std::shared_ptr<const ConfigurationSpace> SpaceCache::Find(const Served& served,
                                                           const Policy& policy) {
  const Policy plain = OnGrid(policy, served.database->views());
  const std::lock_guard lock(mutex_);
  for (const std::shared_ptr<Entry>& entry : entries_) {
    if (entry->scene != served.scene || entry->database != served.database) continue;
    if (!(entry->policy == plain)) continue;
    const auto* made = entry->space.made();
    return made != nullptr ? *made : nullptr;
  }
  return nullptr;
}

std::shared_ptr<const ClearanceSpace> ClearanceCache::Get(
    const Served& served, const Policy& policy,
    const std::shared_ptr<const ConfigurationSpace>& verdicts, const std::vector<double>& levels) {
  const std::lock_guard lock(mutex_);
  // Maps are shared, too: the same map is the same scene and policy.
  const auto found = std::ranges::find_if(entries_, [&](const Entry& entry) {
    return entry.space->verdicts() == verdicts && entry.space->levels() == levels;
  });
  if (found != entries_.end()) {
    entries_.splice(entries_.begin(), entries_, found);
    return found->space;
  }
  // Who still works on an older scene holds its space.
  std::erase_if(entries_, [&](const Entry& entry) { return entry.scene != served.scene; });
  entries_.push_front(
      {served.scene, std::make_shared<const ClearanceSpace>(verdicts, served, policy, levels)});
  uint64_t bytes = entries_.front().space->bytes();
  entries_.erase(std::find_if(std::next(entries_.begin()), entries_.end(),
                              [&](const Entry& entry) {
                                bytes += entry.space->bytes();
                                return bytes > bytes_;
                              }),
                 entries_.end());
  if (entries_.size() > kEntries) entries_.pop_back();
  return entries_.front().space;
}

}  // namespace silhouette
