#include "server/service/space_cache.h"

#include "server/scene/checker.h"

namespace silhouette {

std::shared_ptr<SpaceCache::Entry> SpaceCache::EntryFor(const SharedScene& scene, int min_views) {
  const std::lock_guard lock(mutex_);
  for (const std::shared_ptr<Entry>& entry : entries_) {
    if (entry->scene == scene && entry->min_views == min_views) return entry;
  }
  // Who still computes an older scene's space holds its entry.
  entries_.remove_if([&](const std::shared_ptr<Entry>& entry) { return entry->scene != scene; });
  entries_.push_front(std::make_shared<Entry>());
  entries_.front()->scene = scene;
  entries_.front()->min_views = min_views;
  if (entries_.size() > kEntries) entries_.pop_back();
  return entries_.front();
}

std::shared_ptr<const ConfigurationSpace> SpaceCache::Get(const Served& served,
                                                          const Policy& policy) {
  const std::shared_ptr<Entry> entry =
      EntryFor(served.scene, MinViews(policy, served.database->views()));
  const std::lock_guard lock(entry->mutex);
  if (entry->space == nullptr) {
    entry->space = std::make_shared<const ConfigurationSpace>(CheckAllTiles(served, policy));
  }
  return entry->space;
}

}  // namespace silhouette
