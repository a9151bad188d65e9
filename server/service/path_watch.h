// WatchPath: one call.
#pragma once

#include <cstdint>

#include "absl/status/statusor.h"
#include "server/service/watch_writer.h"
#include "silhouette/v1/collision_service.pb.h"

namespace silhouette {

class PathWatch final : public WatchWriter<v1::WatchPathResponse> {
 public:
  PathWatch(Serving& serving, grpc::CallbackServerContext* context,
            const v1::CheckPathRequest& request)
      : WatchWriter(serving, context), request_(request) {}

 private:
  absl::StatusOr<bool> Prepare() override;
  bool NextPart(v1::WatchPathResponse& part) override;

  const v1::CheckPathRequest request_;
  WatchedState told_of_;
  uint64_t last_scene_ = 0;
  v1::WatchPathResponse update_;
};

}  // namespace silhouette
