// WatchConfigurationSpace: one call.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "server/scene/configuration_space.h"
#include "server/service/watch_writer.h"
#include "silhouette/v1/collision_service.pb.h"

namespace silhouette {

class SpaceWatch final : public WatchWriter<v1::WatchConfigurationSpaceResponse> {
 public:
  // Tiles in one part: about half a megabyte, somewhat more with free cells.
  static constexpr size_t kTilesPerPart = 512;

  SpaceWatch(Serving& serving, grpc::CallbackServerContext* context,
             const v1::WatchConfigurationSpaceRequest& request)
      : WatchWriter(serving, context), request_(request) {}

 private:
  absl::StatusOr<bool> Prepare() override;
  bool NextPart(v1::WatchConfigurationSpaceResponse& part) override;

  const v1::WatchConfigurationSpaceRequest request_;
  // What the last update spoke of, and its map or an earlier one: the tiles that the caller has.
  WatchedState told_of_;
  uint64_t last_scene_ = 0;
  std::shared_ptr<const ConfigurationSpace> sent_;
  bool cells_ = false;  // with free cells
  // The update that is being sent.
  v1::WatchConfigurationSpaceResponse first_;
  std::vector<uint64_t> changed_;
  size_t next_ = 0;
};

}  // namespace silhouette
