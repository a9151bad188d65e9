#include "server/scene/checker.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace silhouette {

Reason BlockedReason(const Served& served, const SceneSettings& settings, const Moment& now) {
  if (served.scene == nullptr) {
    return served.without_scene == Reason::kNone ? Reason::kNoScene : served.without_scene;
  }
  const Scene& scene = *served.scene;
  if (scene.generation != served.database->generation()) return Reason::kGenerationMismatch;
  if (!(scene.AgeAt(now) <= settings.max_age)) return Reason::kSceneStale;
  return scene.Blocked();
}

Checker::Checker(Served served, const Policy& policy, const SceneSettings& settings,
                 const Moment& now)
    : served_(std::move(served)), blocked_(BlockedReason(served_, settings, now)) {
  MinViews(policy, served_.database->views());
  if (served_.scene == nullptr || blocked_ == Reason::kGenerationMismatch) return;
  test_.emplace(served_.database->robot_images(), served_.scene->obstacle_images, policy);
}

Verdict Checker::Check(std::span<const double> q, std::span<ViewEvidence> evidence) const {
  if (blocked_ != Reason::kNone || !test_) {
    std::fill(evidence.begin(), evidence.end(), ViewEvidence{});
    for (size_t view = 0; served_.scene != nullptr && view < evidence.size(); ++view) {
      evidence[view].missing = !served_.scene->views[view];
    }
    return Verdict::Unknown(blocked_ == Reason::kNone ? Reason::kInternal : blocked_);
  }
  return test_->Check(q, evidence);
}

PathVerdict Checker::CheckPath(std::span<const Configuration> waypoints,
                               std::span<ViewEvidence> evidence) const {
  if (waypoints.empty()) throw std::invalid_argument("a path has at least one waypoint");
  if (blocked_ != Reason::kNone || !test_) {
    PathVerdict result;
    result.verdict = Check(waypoints[0], evidence);
    result.configuration = waypoints[0];
    return result;
  }
  return test_->CheckPath(waypoints, evidence);
}

std::optional<Mask> Checker::TestRobotImage(int view, std::span<const double> q) const {
  return test_ ? test_->TestRobotImage(view, q) : std::nullopt;
}

std::vector<TileVerdicts> CheckAllTiles(const Served& served, const Policy& policy) {
  if (served.scene == nullptr) throw std::invalid_argument("there is no scene");
  std::vector<TileVerdicts> tiles(served.database->grid().tiles());
  const CollisionTest test(served.database->robot_images(), served.scene->obstacle_images, policy);
  if (served.scene->generation != served.database->generation()) return tiles;
  if (served.scene->Blocked() != Reason::kNone) return tiles;
  for (uint64_t tile = 0; tile < tiles.size(); ++tile) tiles[tile] = test.CheckTile(tile);
  return tiles;
}

}  // namespace silhouette
