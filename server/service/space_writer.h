// SPDX-License-Identifier: Apache-2.0
// Sending a configuration space, some tiles at a time.
#pragma once

#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/server_callback.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "db/mask/configuration_grid.h"
#include "server/scene/configuration_space.h"
#include "server/service/clients.h"
#include "server/service/watch_hub.h"
#include "silhouette/v1/collision_service.pb.h"

namespace silhouette {

// The first `bits` bits of the words as bytes: bit i % 8 of byte i / 8 is bit i % 64 of word i
// / 64.
std::string PackedBits(std::span<const uint64_t> words, size_t bits);

// The tiles asked for, each once; all of the grid if none is named. InvalidArgument for a tile that
// the grid does not have.
absl::StatusOr<std::vector<uint64_t>> TilesFrom(
    const google::protobuf::RepeatedField<uint64_t>& named, const ConfigurationGrid& grid);

void ToMessage(uint64_t tile, const TileVerdicts& verdicts, v1::ConfigurationSpaceTile* message);

// Whether free cells are returned if asked for (`asked`): they matter only off the grid.
inline bool TellsCells(bool asked, const Policy& policy) {
  return asked && policy.off_grid == OffGrid::kCell;
}
// Those of a tile, which are ready.
void AddCells(uint64_t tile, const ConfigurationSpace& space, v1::ConfigurationSpaceTile* message);

// When the time that the request gives is over, if it begins now; never, if it gives none.
// InvalidArgument if the time is negative.
using Deadline = std::chrono::steady_clock::time_point;
absl::StatusOr<Deadline> DeadlineOf(const v1::GetConfigurationSpaceRequest& request);

// The clearance levels asked for; none if none are. InvalidArgument if they cannot be, or there are
// more than kMaxClearanceLevels.
inline constexpr int kMaxClearanceLevels = 16;
absl::StatusOr<std::vector<double>> ClearanceLevelsFrom(
    const v1::GetConfigurationSpaceRequest& request);

// The answer to one call: either Send() or Finish() is called once. Who does not take a part for
// `longest_write` is cut off. Keeps itself alive until the call is over.
class SpaceWriter final : public grpc::ServerWriteReactor<grpc::ByteBuffer>, public Watcher {
 public:
  // Tiles in one message: about half a megabyte. Fewer with clearances or cells, so that it stays
  // at that.
  static constexpr int kTilesPerMessage = 512;

  // `place`: among the client's streams, kept until the end. `watches`: what looks whether parts
  // are taken.
  static std::shared_ptr<SpaceWriter> Start(grpc::CallbackServerContext* context,
                                            Clients::Place place, absl::Duration longest_write,
                                            WatchHub& watches);

  // Sends `tiles` of `space`, which are all ready, after a first message that is `first`; with them
  // those of `clearances`, ready as well, if it is not null, and with `cells` the free cells,
  // ready, too.
  void Send(v1::GetConfigurationSpaceResponse first,
            std::shared_ptr<const ConfigurationSpace> space,
            std::shared_ptr<const ClearanceSpace> clearances, bool cells,
            std::vector<uint64_t> tiles);

  void Tell(uint64_t) override;
  void End() override {}

 private:
  using Clock = std::chrono::steady_clock;

  SpaceWriter(grpc::CallbackServerContext* context, Clients::Place place,
              absl::Duration longest_write)
      : context_(context), place_(std::move(place)), longest_write_(longest_write) {}

  void OnWriteDone(bool ok) override;
  void OnDone() override;
  void SendNext();

  grpc::CallbackServerContext* const context_;
  Clients::Place place_;
  const absl::Duration longest_write_;
  std::shared_ptr<SpaceWriter> self_;
  std::mutex mutex_;
  std::optional<Clock::time_point> write_end_;  // of the part that is on its way
  v1::GetConfigurationSpaceResponse message_;
  grpc::ByteBuffer bytes_;  // of the message that is on its way
  std::shared_ptr<const ConfigurationSpace> space_;
  std::shared_ptr<const ClearanceSpace> clearances_;
  bool cells_ = false;
  std::vector<uint64_t> tiles_;
  size_t next_ = 0;
};

}  // namespace silhouette
