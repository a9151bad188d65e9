#include "server/scene/clearance_space.h"

#include <utility>

#include "server/scene/checker.h"

namespace silhouette {

ClearanceSpace::ClearanceSpace(std::shared_ptr<const ConfigurationSpace> verdicts, Served served,
                               const Policy& policy, std::vector<double> levels)
    : verdicts_(std::move(verdicts)),
      served_(std::move(served)),
      policy_(policy),
      levels_(std::move(levels)),
      tiles_(verdicts_->tiles()),
      ready_(std::make_unique<std::atomic<bool>[]>(verdicts_->tiles())),
      once_(std::make_unique<std::once_flag[]>(verdicts_->tiles())) {
  RequireLevels(levels_);
}

const LevelChecker& ClearanceSpace::Test() const {
  std::call_once(prepare_, [&] {
    const ServedDatabase& database = *served_.database;
    const ObstacleImages& images = served_.scene->obstacle_images;
    const TestSupport support = SupportFor(served_, policy_);
    test_.emplace(database.robot_images(), images, policy_, support);
    meter_.emplace(*test_, images, policy_, support, DistancesFor(served_, policy_, support));
    std::span<const PixelTree> trees;
    if (database.index() != nullptr) trees = database.index()->trees();
    level_checker_.emplace(*meter_, levels_, trees);
  });
  return *level_checker_;
}

void ClearanceSpace::WorkOut(uint64_t tile) const {
  std::call_once(once_[tile], [&] {
    const PlaceSet free{verdicts_->tile(tile).free};
    if (free.Empty()) {
      tiles_[tile].resize(levels_.size());
    } else {
      const LevelChecker& test = Test();
      const CollisionIndex* index = served_.database->index();
      tiles_[tile] = test.Above(tile, index != nullptr ? index->Tile(tile) : nullptr, free);
    }
    ready_[tile].store(true, std::memory_order_release);
  });
}

}  // namespace silhouette
