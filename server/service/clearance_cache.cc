#include "server/service/clearance_cache.h"

#include <algorithm>
#include <iterator>

namespace silhouette {

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
