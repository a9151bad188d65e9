// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/people/rendered_cell.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "capture/sim/chance.h"
#include "tools/cell/live_config.h"
#include "tools/silhouette-experiments/people/person.h"

namespace silhouette::people_experiment {
namespace {

constexpr double kDarkest = 0.02;  // of what people wear and carry
constexpr double kBrightest = 0.95;

// One thread: other episodes run beside this one.
LiveConfig ConfigOf(const Cell& cell) {
  LiveConfig config = LiveConfigOf(cell);
  config.live.threads = 1;
  return config;
}

std::vector<std::string> ViewsOf(const Cell& cell) {
  std::vector<std::string> names;
  for (const ViewSettings& view : cell.views) names.push_back(view.name);
  return names;
}

}  // namespace

RenderedCell::RenderedCell(const SimulatedWorkplace& workplace,
                           std::shared_ptr<const ServedDatabase> database, size_t people,
                           uint64_t seed)
    : workplace_(workplace),
      database_(std::move(database)),
      cell_(workplace.robot(), workplace.simulation().settings()),
      people_(PeopleObstacles(static_cast<int>(people))),
      record_(std::make_shared<LiveRecord>(ViewsOf(workplace.cell()),
                                           workplace.cell().server.scene.max_age, SystemClock)),
      acquisition_(
          ConfigOf(workplace.cell()),
          {.database = [this] { return database_; },
           .publish =
               [this](Scene scene, const auto&) {
                 return newest_ = std::make_shared<const Scene>(std::move(scene));
               }},
          [this](absl::Duration, absl::Duration) { return joints_; }, record_, database_->cell()) {
  Chance chance(seed);
  begins_ = chance.Uniform(0, cell_.settings().drift_period);
  // Not the noise of the reference images, which has the first numbers.
  cell_.SetFrame(static_cast<uint64_t>(chance.Uniform(1e9, 1e15)));
  for (Obstacle& part : people_) part.brightness = chance.Uniform(kDarkest, kBrightest);
}

absl::StatusOr<Sight> RenderedCell::Look(std::span<const double> q,
                                         std::span<const Eigen::Isometry3d> parts,
                                         const Moment& now) {
  for (size_t i = 0; i < people_.size(); ++i) people_[i].world_from_obstacle = parts[i];
  cell_.SetObstacles(people_);
  cell_.SetPositions(workplace_.Positions(q));
  cell_.SetTime(begins_ + absl::ToDoubleSeconds(now.running));
  Sight sight{.images = cell_.TakeImages(workplace_.cameras()), .scene = nullptr};
  GrabbedImages set{.images = {}, .asked = now, .arrived = now};
  for (CameraImage& image : sight.images) {
    image.captured = now.time;
    set.images.emplace_back(image);
  }
  joints_.clear();
  const Cell& cell = workplace_.cell();
  for (size_t j = 0; j < q.size(); ++j) joints_.push_back({cell.grid.joints()[j].name, q[j]});
  for (const FixedJoint& joint : cell.fixed_joints) joints_.push_back({joint.name, joint.position});
  newest_ = nullptr;
  // An error: images that cannot be used. Then there is no scene, or one that says so.
  acquisition_.Take(std::move(set)).IgnoreError();
  if (const LiveStatus status = record_->Status(); status.lost_sets > 0) {
    return absl::InternalError(absl::StrCat("no scene could be made: ", status.fault));
  }
  sight.scene = std::move(newest_);
  return sight;
}

}  // namespace silhouette::people_experiment
