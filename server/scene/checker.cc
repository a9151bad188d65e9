// SPDX-License-Identifier: Apache-2.0
#include "server/scene/checker.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/times/times.h"

namespace silhouette {

Reason BlockedReason(const Served& served, const SceneSettings& settings, const Moment& now) {
  if (served.database->damage().found()) return Reason::kDatabaseDamaged;
  if (served.scene == nullptr) {
    return served.without_scene == Reason::kNone ? Reason::kNoScene : served.without_scene;
  }
  const Scene& scene = *served.scene;
  if (scene.generation != served.database->generation()) return Reason::kGenerationMismatch;
  if (!(scene.AgeAt(now) <= settings.max_age)) return Reason::kSceneStale;
  for (const AllowedRegion& region : served.regions->regions) {
    if (region.end <= now.running) return Reason::kRegionEnded;
  }
  return scene.Blocked();
}

bool RestsOnCalibration(const ServedDatabase& database, const Policy& policy) {
  return database.robot_images().drawn() != nullptr || IsCalibrated(policy.preset) ||
         IsSound(policy.preset);
}

namespace {

constexpr char kCheckAgain[] = "; run 'silhouette-calibrate check' again";

// Where a check does not have each view of the database once; empty: it does.
std::string WrongViews(const CalibrationTrust& trust, const ServedDatabase& database) {
  for (int view = 0; view < database.views(); ++view) {
    const std::string& name = database.view_name(view);
    const auto count = std::ranges::count(trust.views, name);
    if (count == 0) return absl::StrCat("the check lacks view '", name, "'");
    if (count > 1) return absl::StrCat("the check has view '", name, "' more than once");
  }
  for (const std::string& name : trust.views) {
    if (database.ViewOf(name)) continue;
    return absl::StrCat("the check has view '", name, "', which the database does not have");
  }
  return "";
}

}  // namespace

std::optional<std::string> CalibrationDoubt(const Served& served, const Moment& now) {
  const ServedDatabase& database = *served.database;
  if (!database.calibration_doubt().empty()) return database.calibration_doubt();
  if (served.trust == nullptr) return std::nullopt;
  const CalibrationTrust& trust = *served.trust;
  if (!trust.holds) return trust.message;
  if (!(now.running < trust.until)) {
    const absl::Duration age =
        absl::Trunc(now.running - trust.until + trust.max_age, absl::Milliseconds(1));
    return absl::StrCat("the check is ", SpokenTime(age), " old; calibration_check: max_age is ",
                        SpokenTime(trust.max_age), kCheckAgain);
  }
  if (trust.fingerprint != database.calibration_fingerprint()) {
    const std::string& ours = database.calibration_fingerprint();
    return absl::StrCat("the check is of another calibration, ", trust.fingerprint,
                        ", than the database has, ", ours.empty() ? "none" : ours, kCheckAgain,
                        " with this database");
  }
  const std::string wrong = WrongViews(trust, database);
  if (!wrong.empty()) return wrong + kCheckAgain;
  if (!(trust.limit <= database.calibration_margin())) {
    return absl::StrFormat(
        "the check let views move by %.2f mask px, more than calibration: margin, %.2f%s with a "
        "smaller --limit",
        trust.limit, database.calibration_margin(), kCheckAgain);
  }
  return std::nullopt;
}

Reason CalibrationReason(const Served& served, const Moment& now) {
  return CalibrationDoubt(served, now) ? Reason::kCalibrationDoubtful : Reason::kNone;
}

Reason BlockedReason(const Served& served, const Policy& policy, const SceneSettings& settings,
                     const Moment& now) {
  const Reason blocked = BlockedReason(served, settings, now);
  if (blocked != Reason::kNone || !RestsOnCalibration(*served.database, policy)) return blocked;
  return CalibrationReason(served, now);
}

absl::Duration ValidFor(const Served& served, const Policy& policy, const SceneSettings& settings,
                        const Moment& now) {
  if (BlockedReason(served, policy, settings, now) != Reason::kNone) return absl::ZeroDuration();
  absl::Duration valid = settings.max_age - served.scene->AgeAt(now);
  for (const AllowedRegion& region : served.regions->regions) {
    valid = std::min(valid, region.end - now.running);
  }
  if (served.trust != nullptr && RestsOnCalibration(*served.database, policy)) {
    valid = std::min(valid, served.trust->until - now.running);
  }
  return valid;
}

void RequireServable(const Served& served, const Policy& policy) {
  MinViews(policy, served.database->views());
  const absl::Status status = served.database->CanServe(policy);
  if (!status.ok()) throw std::invalid_argument(std::string(status.message()));
}

namespace {

// Per view, where obstacles are allowed; empty if nowhere.
std::vector<std::optional<Mask>> AllowedPixels(const Served& served) {
  std::vector<std::optional<Mask>> allowed;
  for (const AllowedRegion& region : served.regions->regions) {
    allowed.resize(region.pixels.size());
    for (size_t view = 0; view < allowed.size(); ++view) {
      const std::optional<Mask>& pixels = region.pixels[view];
      if (pixels) allowed[view] = allowed[view] ? *allowed[view] | *pixels : *pixels;
    }
  }
  return allowed;
}

}  // namespace

TestSupport SupportFor(const Served& served, const Policy& policy) {
  TestSupport support{.bands = served.database->bands()};
  const std::shared_ptr<const DrawnRobot>& drawn = served.database->robot_images().drawn();
  if (drawn != nullptr && !IsCalibrated(policy.preset) && !IsSound(policy.preset)) {
    support.drawn = &served.scene->drawn.Get(
        [&] { return DrawnChecker(drawn, ObstaclePlanes(served.scene->obstacle_images)); });
  }
  if (policy.preset == Preset::kPaperCalibrated) {
    support.resolved = &served.scene->resolved.Get(
        [&] { return ResolvedObstacleImages(served.scene->obstacle_images, *support.bands); });
  }
  if (IsSound(policy.preset)) {
    support.possible_space = &served.scene->possible_space.Get(
        served.database->sound(), served.scene->obstacle_images, served.scene->joints,
        AllowedPixels(served), MaxOccludedViews(policy, served.database->views()));
    support.workspace = served.database->sound()->workspace();
    // It takes links that stand as in the scene for what touches nothing. With another tool or part
    // than in the scene that is not known.
    if (served.database->variant() == served.scene->variant) {
      const SoundBasis& basis = *served.database->sound();
      support.robot_may_touch = basis.RobotMayTouch(served.scene->joints);
      support.robot_may_meet = basis.RobotMayMeet(served.scene->joints, *support.possible_space);
    }
  }
  return support;
}

const DistanceImages& DistancesFor(const Served& served, const TestSupport& support) {
  const Scene& scene = *served.scene;
  if (support.resolved != nullptr) {
    return scene.to_resolved.Get([&] { return DistancesTo(*support.resolved); });
  }
  return scene.to_obstacles.Get([&] { return DistancesTo(ObstaclePlanes(scene.obstacle_images)); });
}

Checker::Checker(Served served, const Policy& policy, const SceneSettings& settings,
                 const Moment& now, std::shared_ptr<const ConfigurationSpace> map)
    : served_(std::move(served)),
      policy_(policy),
      blocked_(BlockedReason(served_, policy, settings, now)) {
  RequireServable(served_, policy);
  if (served_.scene == nullptr || blocked_ == Reason::kGenerationMismatch) return;
  TestSupport support = SupportFor(served_, policy);
  if (map != nullptr) {
    support.node_is_free = [map = std::move(map)](ConfigurationNumber number) {
      return map->KnownFree(number);
    };
  }
  test_.emplace(served_.database->robot_images(), served_.scene->obstacle_images, policy, support);
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
                               std::span<ViewEvidence> evidence, std::set<std::string>* regions,
                               std::optional<PathClearance>* clearance,
                               const PathSettings& settings) const {
  if (waypoints.empty()) throw std::invalid_argument("a path has at least one waypoint");
  if (blocked_ != Reason::kNone || !test_) {
    PathVerdict result;
    result.verdict = Check(waypoints[0], evidence);
    result.configuration = waypoints[0];
    return result;
  }
  if (served_.regions->regions.empty()) regions = nullptr;
  if (regions == nullptr && clearance == nullptr) {
    return test_->CheckPath(waypoints, evidence, settings);
  }
  const std::optional<ClearanceMeter> meter = clearance != nullptr ? Clearances() : std::nullopt;
  PathSettings looking = settings;
  looking.tested = [&](const TestedPlace& place) {
    if (settings.tested) settings.tested(place);
    if (meter) meter->Narrow(place, *clearance);
    if (regions == nullptr) return;
    const std::vector<std::string> names = RegionsAt(place.configuration, place.growth);
    regions->insert(names.begin(), names.end());
  };
  const PathVerdict path = test_->CheckPath(waypoints, evidence, looking);
  if (meter && !path.verdict.free()) meter->Measure(path.configuration, path.verdict, evidence);
  return path;
}

std::optional<ClearanceMeter> Checker::Clearances() const {
  if (blocked_ != Reason::kNone || !test_) return std::nullopt;
  const TestSupport support = SupportFor(served_, policy_);
  return ClearanceMeter(*test_, served_.scene->obstacle_images, policy_, support,
                        DistancesFor(served_, support));
}

std::optional<PathDistance> Checker::Distance(std::span<const Configuration> waypoints,
                                              std::optional<double> horizon,
                                              const Stop& stop) const {
  if (blocked_ != Reason::kNone || !test_) return std::nullopt;
  const auto is_outside = [&](const Configuration& q) {
    const RobotImageTable& images = served_.database->robot_images();
    return images.drawn() != nullptr ? images.StateBetween(q, q) == RobotImageState::kMissing
                                     : images.grid().CornersAround(q).count() == 0;
  };
  if (std::ranges::any_of(waypoints, is_outside)) return std::nullopt;
  const std::shared_ptr<const SeparationBasis>& basis = served_.database->separation();
  const Scene& scene = *served_.scene;
  const int occluded = MaxOccludedViews(policy_, served_.database->views());
  const SpaceDistances& space = scene.separation.Get({basis, occluded}, [&] {
    const std::vector<std::optional<Mask>> allowed = AllowedPixels(served_);
    const PossibleSpace& near = scene.possible_space.Get(
        served_.database->sound(), scene.obstacle_images, scene.joints, allowed, occluded);
    return basis->DistancesIn(near, scene.obstacle_images, scene.joints, allowed, occluded);
  });
  return SeparationMeter(basis->robot(), space).Along(waypoints, horizon, stop);
}

std::optional<std::vector<Mask>> Checker::TestRobotImages(std::span<const double> q) const {
  return test_ ? test_->TestRobotImages(q) : std::nullopt;
}

CollisionImages Checker::PossibleImagesAt(std::span<const double> q) const {
  CollisionImages images(static_cast<size_t>(served_.database->views()));
  const std::optional<std::vector<Mask>> robot = TestRobotImages(q);
  if (!robot) return images;
  const PossibleSpace& possible = *SupportFor(served_, policy_).possible_space;
  for (size_t view = 0; view < images.size(); ++view) {
    if (!possible.sees(static_cast<int>(view))) continue;
    images[view] = Mask((*robot)[view].size());
    for (const PossibleSpace::Part& part : possible.parts()) {
      if (part.planes[view]) images[view] = *images[view] | (*part.planes[view] & (*robot)[view]);
    }
  }
  return images;
}

CollisionImages Checker::CollisionImagesAt(std::span<const double> q) const {
  const auto views = static_cast<size_t>(served_.database->views());
  CollisionImages images(views);
  if (!test_) return images;
  if (IsSound(policy_.preset)) return PossibleImagesAt(q);
  const std::optional<std::vector<Mask>> robot = TestRobotImages(q);
  if (!robot) return images;
  const CollisionImages* resolved = SupportFor(served_, policy_).resolved;
  IntersectionImages intersections(views);
  for (size_t view = 0; view < views; ++view) {
    const std::optional<ObstacleImage>& obstacle = served_.scene->obstacle_images[view];
    if (!obstacle) continue;
    intersections[view].emplace(*obstacle, (*robot)[view]);
    if (resolved != nullptr) images[view] = *(*resolved)[view] & (*robot)[view];
  }
  if (policy_.preset == Preset::kPaperCalibrated) return images;
  if (!IsCalibrated(policy_.preset)) return UncalibratedCollisionImages(intersections);
  return CalibratedCollisionImages(intersections, *served_.database->bands());
}

std::vector<std::string> Checker::RegionsAt(std::span<const double> q, Growth growth) const {
  // These look beyond the test robot image.
  if (policy_.preset == Preset::kPaperCalibrated || IsSound(policy_.preset)) {
    return RegionsIn(served_, policy_);
  }
  std::vector<std::string> names;
  if (served_.scene == nullptr || served_.scene->region_effects.empty()) return names;
  const auto images = test_ ? test_->TestRobotImages(q, growth) : std::nullopt;
  if (!images) return names;
  const std::vector<std::optional<Mask>> robot(images->begin(), images->end());
  for (const RegionEffect& effect : served_.scene->region_effects) {
    if (effect.Touches(robot)) names.push_back(effect.name);
  }
  return names;
}

std::vector<std::string> RegionsIn(const Served& served, const Policy& policy) {
  std::vector<std::string> names;
  if (served.scene == nullptr) return names;
  if (IsSound(policy.preset)) {
    for (const AllowedRegion& region : served.regions->regions) names.push_back(region.name);
  } else {
    for (const RegionEffect& effect : served.scene->region_effects) names.push_back(effect.name);
  }
  return names;
}

}  // namespace silhouette
