// What a SharedSpace holds: the mapped file, and what it is of.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "clients/cpp/off_grid.h"
#include "clients/cpp/shared_map_file.h"
#include "clients/shared_map/reader.h"
#include "silhouette/shared_space.h"

namespace silhouette::client {

static_assert(kTileSize == shared_map::kPlacesPerTile);

// All states of one update, kept.
struct KeptStates {
  std::vector<uint64_t> words;
  shared_map::Cells told = shared_map::Cells::kNothing;
  uint64_t free(uint64_t i) const { return words[shared_map::kWordsPerPlaces * i]; }
  uint64_t occupied(uint64_t i) const { return words[shared_map::kWordsPerPlaces * i + 1]; }
  uint64_t free_cells(uint64_t i) const { return words[shared_map::kWordsPerPlaces * i + 2]; }
  shared_map::Cells cells() const { return told; }
};

class SharedSpace::Map {
 public:
  using Update = shared_map::Reader::Update;

  // Throws std::invalid_argument if the file has no shared map.
  Map(std::string path, std::unique_ptr<SharedMapFile> file, absl::Duration max_age);

  // Reads what the map is of; must come first.
  absl::Status Describe();

  const std::string& path() const { return path_; }
  uint32_t owner() const { return file_->owner(); }
  absl::Duration max_age() const { return given_max_age_; }
  const Database& database() const { return *database_; }

  // What was found in one update, and when.
  struct Look {
    Reason unknown = Reason::kInternal;  // kUnspecified: what was read counts
    shared_map::Stamp stamp;
    int64_t now = 0;  // CLOCK_MONOTONIC, nanoseconds

    bool usable() const { return unknown == Reason::kUnspecified; }
  };

  // Calls `read`, perhaps several times, with the newest update.
  template <typename ReadUpdate>
  Look Newest(const ReadUpdate& read) const {
    Look look;
    const auto outcome = reader_.Read([&](const Update& update) {
      look.stamp = update.stamp();
      read(update);
    });
    Conclude(outcome, look);
    return look;
  }

  // The same for what takes long: where the server is faster, `evaluate` gets a copy of the states
  // instead. Fills in `basis`.
  template <typename Evaluate>
  Look Evaluated(Basis& basis, const Evaluate& evaluate) const {
    Look look;
    std::string names;
    const auto take = [&](const Update& update) {
      look.stamp = update.stamp();
      names = update.names();
    };
    auto outcome = reader_.Read(
        [&](const Update& update) {
          take(update);
          evaluate(update);
        },
        /*tries=*/2);
    if (outcome == shared_map::Reader::Outcome::kOvertaken) {
      KeptStates states;
      outcome = reader_.Read([&](const Update& update) {
        take(update);
        states = Copied(update);
      });
      if (outcome == shared_map::Reader::Outcome::kRead) evaluate(states);
    }
    Conclude(outcome, look);
    basis = BasisOf(look, names);
    return look;
  }

  KeptStates Copied(const Update& update) const;

  Basis BasisOf(const Look& look, const std::string& names) const;
  // `names`: of an Update.
  static std::vector<std::string> RegionsIn(const std::string& names);

  // The state of a configuration; `states`: an Update, or KeptStates.
  template <typename States>
  State StateIn(const States& states, ConfigurationNumber number) const {
    if (number / kTileSize >= reader_.tiles()) return State::kUnknown;
    const bool free = (states.free(number / 64) >> (number % 64) & 1) != 0;
    const bool occupied = (states.occupied(number / 64) >> (number % 64) & 1) != 0;
    if (free == occupied) return State::kUnknown;
    return free ? State::kFree : State::kOccupied;
  }

  // What is told of the grid cell that begins at one, likewise.
  template <typename States>
  CellState CellIn(const States& states, ConfigurationNumber number) const {
    const shared_map::Cells cells = states.cells();
    const bool exact = cells == shared_map::Cells::kExact;
    if (number / kTileSize >= reader_.tiles()) return CellState::kNotTold;
    if (!exact && cells != shared_map::Cells::kSomeFree) return CellState::kNotTold;
    if ((states.free_cells(number / 64) >> (number % 64) & 1) != 0) return CellState::kFree;
    return exact ? CellState::kOccupied : CellState::kNotTold;
  }

  // The verdict on a configuration, likewise.
  template <typename States>
  Verdict VerdictIn(const States& states, std::span<const double> q) const {
    return CheckInMap(
        database_->grid, rule_, q,
        [&](ConfigurationNumber number) { return StateIn(states, number); },
        [&](ConfigurationNumber number) { return CellIn(states, number); });
  }

 private:
  // Looks at the clock, and finds out whether what was read counts.
  void Conclude(shared_map::Reader::Outcome outcome, Look& look) const {
    look.now =
        std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
    look.unknown = WhyUnknown(outcome, look);
  }
  Reason WhyUnknown(shared_map::Reader::Outcome outcome, const Look& look) const;

  std::string path_;
  std::unique_ptr<SharedMapFile> file_;
  shared_map::Reader reader_;
  absl::Duration given_max_age_;
  int64_t max_age_;  // nanoseconds
  std::optional<Database> database_;
  OffGridRule rule_;
};

}  // namespace silhouette::client
