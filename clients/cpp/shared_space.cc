#include "silhouette/shared_space.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "absl/strings/str_cat.h"
#include "clients/cpp/shared_space_map.h"

namespace silhouette::client {

absl::StatusOr<SharedSpace> SharedSpace::Open(const std::string& path, absl::Duration max_age,
                                              std::optional<uint32_t> owner) {
  if (max_age < absl::ZeroDuration()) {
    return absl::InvalidArgumentError("max_age must not be negative");
  }
  absl::StatusOr<std::unique_ptr<SharedMapFile>> file = SharedMapFile::Open(path, owner);
  if (!file.ok()) return file.status();
  try {
    const auto map = std::make_shared<Map>(path, *std::move(file), max_age);
    if (absl::Status described = map->Describe(); !described.ok()) return described;
    return SharedSpace(map);
  } catch (const std::invalid_argument& error) {
    return absl::InvalidArgumentError(absl::StrCat("'", path, "' ", error.what()));
  }
}

absl::StatusOr<SharedSpace> SharedSpace::Reopen() const {
  return Open(map_->path(), map_->max_age(), map_->owner());
}

const Database& SharedSpace::database() const { return map_->database(); }

State SharedSpace::StateAt(ConfigurationNumber number) const {
  State state = State::kUnknown;
  const Map::Look look =
      map_->Newest([&](const Map::Update& update) { state = map_->StateIn(update, number); });
  return look.usable() ? state : State::kUnknown;
}

Verdict SharedSpace::Check(std::span<const double> q, Basis* basis) const {
  Verdict verdict;
  std::string names;
  const Map::Look look = map_->Newest([&](const Map::Update& update) {
    verdict = map_->VerdictIn(update, q);
    names = update.names();
  });
  if (basis != nullptr) *basis = map_->BasisOf(look, names);
  if (!look.usable()) return {.reason = look.unknown};
  verdict.regions = Map::RegionsIn(names);
  return verdict;
}

ConfigurationChecks SharedSpace::CheckConfigurations(
    std::span<const Configuration> configurations) const {
  ConfigurationChecks checks;
  const Map::Look look = map_->Evaluated(checks.basis, [&](const auto& states) {
    checks.verdicts.clear();
    for (const Configuration& q : configurations) {
      checks.verdicts.push_back(map_->VerdictIn(states, q));
    }
  });
  if (!look.usable()) {
    checks.verdicts.assign(configurations.size(), Verdict{.reason = look.unknown});
    return checks;
  }
  for (Verdict& verdict : checks.verdicts) verdict.regions = checks.basis.regions;
  return checks;
}

NumberChecks SharedSpace::CheckNumbers(std::span<const uint32_t> numbers) const {
  const size_t words = (numbers.size() + 63) / 64;
  NumberChecks checks{.basis = {},
                      .unknown_reason = Reason::kInternal,
                      .size = numbers.size(),
                      .free = std::vector<uint64_t>(words),
                      .occupied = std::vector<uint64_t>(words)};
  const Map::Look look = map_->Evaluated(checks.basis, [&](const auto& states) {
    for (size_t word = 0; word < words; ++word) {
      const size_t count = std::min<size_t>(64, numbers.size() - 64 * word);
      uint64_t free = 0;
      uint64_t occupied = 0;
      for (size_t i = 0; i < count; ++i) {
        const State state = map_->StateIn(states, numbers[64 * word + i]);
        free |= uint64_t{state == State::kFree} << i;
        occupied |= uint64_t{state == State::kOccupied} << i;
      }
      checks.free[word] = free;
      checks.occupied[word] = occupied;
    }
  });
  checks.unknown_reason = look.unknown;
  if (!look.usable()) {
    std::ranges::fill(checks.free, 0);
    std::ranges::fill(checks.occupied, 0);
  }
  return checks;
}

Basis SharedSpace::basis() const {
  std::string names;
  const Map::Look look = map_->Newest([&](const Map::Update& update) { names = update.names(); });
  return map_->BasisOf(look, names);
}

Reason SharedSpace::unknown_reason() const {
  return map_->Newest([](const Map::Update&) {}).unknown;
}

ConfigurationSpace SharedSpace::Copy() const {
  KeptStates states;
  std::string names;
  const Map::Look look = map_->Newest([&](const Map::Update& update) {
    states = map_->Copied(update);
    names = update.names();
  });
  constexpr uint64_t kPairs = kTileSize / 64;
  std::vector<ConfigurationSpaceTile> tiles(look.usable() ? grid().tiles() : 0);
  for (uint64_t tile = 0; tile < tiles.size(); ++tile) {
    tiles[tile].tile = tile;
    for (uint64_t i = 0; i < kPairs; ++i) {
      tiles[tile].free[i] = states.free(tile * kPairs + i);
      tiles[tile].occupied[i] = states.occupied(tile * kPairs + i);
    }
  }
  return ConfigurationSpace(grid(), map_->BasisOf(look, names), std::move(tiles));
}

}  // namespace silhouette::client
