// SPDX-License-Identifier: Apache-2.0
// What a server that is watched sends, well-formed: tests break it.
#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <string>

#include "absl/time/time.h"
#include "silhouette/configuration_grid.h"
#include "tests/clients/cpp/fake_server.h"

namespace silhouette {

using SpacePart = v1::WatchConfigurationSpaceResponse;

inline void Set(absl::Duration duration, google::protobuf::Duration* message) {
  absl::Duration rest;
  message->set_seconds(absl::IDivDuration(duration, absl::Seconds(1), &rest));
  message->set_nanos(static_cast<int32_t>(absl::ToInt64Nanoseconds(rest)));
}

// 100 x 100 configurations in tiles of 64 x 64: 4 tiles, three of them with absent places.
inline const ConfigurationGrid& WatchedGrid() {
  static const ConfigurationGrid grid({{.name = "a", .lower = 0, .upper = 99, .steps = 100},
                                       {.name = "b", .lower = 0, .upper = 99, .steps = 100}},
                                      {64, 64});
  return grid;
}

inline void Set(const ConfigurationGrid& grid, v1::Grid* message) {
  for (const GridJoint& joint : grid.joints()) {
    v1::GridJoint& added = *message->add_joints();
    added.set_name(joint.name);
    added.set_lower(joint.lower);
    added.set_upper(joint.upper);
    added.set_steps(joint.steps);
  }
  for (int edge : grid.tile_edges()) message->add_tile_edges(edge);
}

// The clock of a server that started a thousand hours ago.
inline absl::Duration ServerClockNow() {
  return absl::Hours(1000) + absl::FromChrono(std::chrono::steady_clock::now().time_since_epoch());
}

// Of `scene`, `age` old when the answer was made, which is `ago`; valid for a minute from then.
inline v1::Basis BasisOf(uint64_t scene, absl::Duration age = absl::ZeroDuration(),
                         absl::Duration ago = absl::ZeroDuration()) {
  v1::Basis basis;
  basis.set_database_generation(7);
  basis.set_scene_id(scene);
  Set(age, basis.mutable_scene_age());
  Set(ServerClockNow() - ago, basis.mutable_server_clock());
  Set(absl::Minutes(1), basis.mutable_valid_for());
  return basis;
}

// An update without tiles, in one part.
inline SpacePart Update(const v1::Basis& basis, bool whole = false) {
  SpacePart part;
  *part.mutable_basis() = basis;
  part.set_whole(whole);
  if (whole) Set(WatchedGrid(), part.mutable_grid());
  part.set_last_part(true);
  return part;
}

// Adds a tile to a part of any kind. Every place free, or with `free` false occupied, absent ones
// too.
template <typename Part>
void AddTile(Part& part, uint64_t number, bool free) {
  v1::ConfigurationSpaceTile& tile = *part.add_tiles();
  tile.set_tile(number);
  tile.set_free(std::string(512, free ? '\xff' : '\0'));
  tile.set_occupied(std::string(512, free ? '\0' : '\xff'));
}

// The first update: tiles 0 and 2 free, 1 occupied, 3 not sent.
inline SpacePart FirstUpdate(const v1::Basis& basis) {
  SpacePart part = Update(basis, /*whole=*/true);
  AddTile(part, 0, true);
  AddTile(part, 1, false);
  AddTile(part, 2, true);
  return part;
}

// A fake server that tells its clock, and sends what it is given to whoever watches.
class WatchedServer {
 public:
  explicit WatchedServer(const std::string& at = "127.0.0.1:0") : fake(at) {
    fake.check_configurations = [](auto&, auto&, v1::CheckConfigurationsResponse& response) {
      *response.mutable_basis() = BasisOf(1);
      return grpc::Status::OK;
    };
    fake.watch_space = [this](grpc::ServerContext& context,
                              const v1::WatchConfigurationSpaceRequest& request,
                              grpc::ServerWriter<SpacePart>& writer) {
      {
        const std::lock_guard lock(mutex_);
        ++streams_;
        asked_ = request;
      }
      changed_.notify_all();
      while (!context.IsCancelled()) {
        const std::optional<Step> step = Next();
        if (!step) continue;
        if (step->end) return *step->end;
        writer.Write(*step->part);
      }
      return grpc::Status::CANCELLED;
    };
  }

  void Send(const SpacePart& part) { Add({.part = part, .end = std::nullopt}); }
  // Ends the stream.
  void End(const grpc::Status& status) { Add({.part = std::nullopt, .end = status}); }

  // Whether that many streams were begun within ten seconds.
  bool WaitForStreams(int count) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds(10), [&] { return streams_ >= count; });
  }
  v1::WatchConfigurationSpaceRequest asked() {
    const std::lock_guard lock(mutex_);
    return asked_;
  }

 private:
  struct Step {
    std::optional<SpacePart> part;
    std::optional<grpc::Status> end;
  };

  void Add(const Step& step) {
    {
      const std::lock_guard lock(mutex_);
      steps_.push_back(step);
    }
    changed_.notify_all();
  }
  std::optional<Step> Next() {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, std::chrono::milliseconds(5), [&] { return !steps_.empty(); });
    if (steps_.empty()) return std::nullopt;
    Step step = std::move(steps_.front());
    steps_.pop_front();
    return step;
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Step> steps_;
  int streams_ = 0;
  v1::WatchConfigurationSpaceRequest asked_;

 public:
  FakeServer fake;  // last: it goes first
};

}  // namespace silhouette
