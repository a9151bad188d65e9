#include "server/service/path_watch.h"

#include <algorithm>
#include <utility>

#include "server/service/answers.h"
#include "server/service/messages.h"

namespace silhouette {

absl::StatusOr<bool> PathWatch::Prepare() {
  const Moment now = serving().settings.clock();
  const Served served = serving().scenes.Newest(now);
  const WatchedState state(served, BlockedReason(served, serving().settings.scene, now),
                           CalibrationReason(served, now));
  if (state == told_of_) return false;
  v1::WatchPathResponse update;
  absl::Duration valid_for;
  const grpc::Status status = Answer(serving(), request_, update.mutable_check(), &valid_for);
  if (!status.ok()) return FromGrpc(status);
  ToMessage(valid_for, update.mutable_valid_for());
  const uint64_t scene = update.check().basis().scene_id();
  update.set_skipped_scenes(ScenesSkipped(last_scene_, scene));
  told_of_ = state;
  last_scene_ = std::max(last_scene_, scene);
  update_ = std::move(update);
  return true;
}

bool PathWatch::NextPart(v1::WatchPathResponse& part) {
  part = std::move(update_);
  return false;
}

}  // namespace silhouette
