// SPDX-License-Identifier: Apache-2.0
#include "server/scene/configuration_space.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "server/scene/checker.h"

namespace silhouette {

namespace {

std::vector<PixelTree> TreesOf(const ServedDatabase& database) {
  const RobotImageTable& table = database.robot_images();
  return {table.mask_sizes().begin(), table.mask_sizes().end()};
}

}  // namespace

ConfigurationSpace::ConfigurationSpace(Served served, const Policy& policy)
    : served_(std::move(served)), tiles_(served_.database->grid().tiles()) {
  if (served_.scene == nullptr) throw std::invalid_argument("there is no scene");
  RequireServable(served_, policy);
  const ServedDatabase& database = *served_.database;
  if (served_.scene->generation != database.generation() || database.damage().found()) return;
  if (served_.scene->Blocked() != Reason::kNone) return;
  test_.emplace(database.robot_images(), served_.scene->obstacle_images, policy,
                SupportFor(served_, policy));
  // An index of whole robots says nothing of nodes.
  const CollisionIndex* index = database.robot_images().has_nodes()
                                    ? database.node_index(DrawnKind::kReach)
                                    : database.index();
  if (index != nullptr) by_index_.emplace(*test_, index->trees());
}

std::optional<ConfigurationSpace::NodeTile> ConfigurationSpace::NodesOf(uint64_t tile) const {
  if (!by_index_ || !by_index_->planes_decide()) return std::nullopt;
  const TileIndex* own = served_.database->node_index(DrawnKind::kOwn)->Tile(tile);
  const TileIndex* reach = served_.database->node_index(DrawnKind::kReach)->Tile(tile);
  if (own == nullptr || reach == nullptr) return std::nullopt;
  return NodeTile{*own, *reach};
}

bool ConfigurationSpace::looked_up(uint64_t tile) const {
  if (!test_) return true;
  const RobotImageTable& images = served_.database->robot_images();
  if (images.has_nodes()) return NodesOf(tile).has_value();
  if (by_index_ && !by_index_->planes_decide()) return false;
  if (by_index_ && served_.database->index()->Tile(tile) != nullptr) return true;
  return images.drawn() == nullptr && images.present(tile).Empty();
}

bool ConfigurationSpace::WorkOut(std::span<const uint64_t> tiles, const Stop& stop) const {
  return tiles_.WorkOut(tiles, stop, [&](uint64_t tile) { return Make(tile, stop); });
}

std::optional<TileVerdicts> ConfigurationSpace::Make(uint64_t tile, const Stop& stop) const {
  // Its index may be gone from under the map.
  if (served_.database->damage().found()) return TileVerdicts();
  if (served_.database->robot_images().has_nodes()) {
    if (const auto nodes = NodesOf(tile)) return by_index_->CheckNodes(nodes->own, nodes->reach);
    return test_ ? test_->CheckTile(tile, stop) : TileVerdicts();
  }
  const TileIndex* index = by_index_ ? served_.database->index()->Tile(tile) : nullptr;
  if (index != nullptr) return by_index_->CheckTile(tile, *index, stop);
  return test_ ? test_->CheckTile(tile, stop) : TileVerdicts();
}

bool ConfigurationSpace::States(std::span<const uint32_t> numbers, std::span<uint64_t> free,
                                std::span<uint64_t> occupied, const Stop& stop) const {
  const size_t words = (numbers.size() + 63) / 64;
  if (free.size() != words || occupied.size() != words) {
    throw std::invalid_argument("there must be a bit per number");
  }
  for (size_t word = 0; word < words; ++word) {
    const auto part = numbers.subspan(64 * word, std::min<size_t>(64, numbers.size() - 64 * word));
    uint64_t is_free = 0;
    uint64_t is_occupied = 0;
    for (size_t i = 0; i < part.size(); ++i) {
      const uint64_t at = part[i] / kTileSize;
      if (at >= tiles()) continue;
      if (!ready(at) && !WorkOut({&at, 1}, stop)) return false;
      const TileVerdicts& verdicts = tile(at);
      const uint64_t place = part[i] % kTileSize;
      is_free |= (verdicts.free[place / 64] >> (place % 64) & 1) << i;
      is_occupied |= (verdicts.occupied[place / 64] >> (place % 64) & 1) << i;
    }
    free[word] = is_free;
    occupied[word] = is_occupied;
  }
  return true;
}

ConfigurationSpace::Cells::Cells(const CollisionChecker& checker, const ServedDatabase& database)
    : trees(TreesOf(database)), test(checker, trees), free(test, [&database](uint64_t tile) {
        return database.index() != nullptr ? database.index()->Tile(tile) : nullptr;
      }) {}

bool ConfigurationSpace::WorkOutCells(std::span<const uint64_t> tiles, const Stop& stop) const {
  if (!HasCells()) return true;
  std::call_once(cells_once_, [this] {
    cells_ = std::make_unique<Cells>(*test_, *served_.database);
    cells_made_.store(true, std::memory_order_release);
  });
  return cells_->free.WorkOut(tiles, stop);
}

bool ConfigurationSpace::HasCells() const {
  return test_ && served_.database->robot_images().drawn() == nullptr;
}

bool ConfigurationSpace::cells_ready(uint64_t tile) const {
  return !HasCells() || (cells_made_.load(std::memory_order_acquire) && cells_->free.ready(tile));
}

const PlaceSet& ConfigurationSpace::free_cells(uint64_t tile) const {
  static const PlaceSet none;
  return HasCells() && cells_ready(tile) ? cells_->free.tile(tile) : none;
}

bool ConfigurationSpace::cells_exact() const {
  return cells_made_.load(std::memory_order_acquire) && cells_->free.exact();
}

ClearanceSpace::ClearanceSpace(std::shared_ptr<const ConfigurationSpace> verdicts, Served served,
                               const Policy& policy, std::vector<double> levels)
    : verdicts_(std::move(verdicts)),
      served_(std::move(served)),
      policy_(policy),
      levels_(std::move(levels)),
      tiles_(verdicts_->tiles()) {
  RequireLevels(levels_);
}

const LevelChecker& ClearanceSpace::Test() const {
  std::call_once(prepare_, [&] {
    const ServedDatabase& database = *served_.database;
    const ObstacleImages& images = served_.scene->obstacle_images;
    const TestSupport support = SupportFor(served_, policy_);
    test_.emplace(database.robot_images(), images, policy_, support);
    meter_.emplace(*test_, images, policy_, support, DistancesFor(served_, support));
    std::span<const PixelTree> trees;
    if (database.index() != nullptr) trees = database.index()->trees();
    level_checker_.emplace(*meter_, levels_, trees);
  });
  return *level_checker_;
}

bool ClearanceSpace::WorkOut(std::span<const uint64_t> tiles, const Stop& stop) const {
  return tiles_.WorkOut(tiles, stop, [&](uint64_t tile) { return Make(tile, stop); });
}

std::optional<std::vector<PlaceSet>> ClearanceSpace::Make(uint64_t tile, const Stop& stop) const {
  if (!verdicts_->WorkOut({&tile, 1}, stop)) return std::nullopt;
  const PlaceSet free{verdicts_->tile(tile).free};
  // How far obstacles are from a node's robot depends on the wrist.
  if (free.Empty() || served_.database->robot_images().has_nodes())
    return std::vector<PlaceSet>(levels_.size());
  const CollisionIndex* index = served_.database->index();
  return Test().Above(tile, index != nullptr ? index->Tile(tile) : nullptr, free, stop);
}

}  // namespace silhouette
