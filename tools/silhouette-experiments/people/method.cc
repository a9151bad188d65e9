// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/people/method.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "clients/planners/joint_search.h"
#include "clients/planners/wave_propagation.h"
#include "server/scene/configuration_space.h"

namespace silhouette::people_experiment {
namespace {

constexpr char kCurtain[] = "light_curtain";
constexpr char kScanner[] = "zone_scanner";
constexpr char kOracle[] = "oracle";
constexpr char kSilhouette[] = "silhouette";

// A way leads away if on its next metres the distance grows by the one, and falls nowhere by more
// than the other: that much it varies from voxel to voxel. Metres.
constexpr double kWayOut = 0.3;
constexpr double kGain = 0.03;
constexpr double kSameDistance = 0.02;
// How fast somebody comes nearer is judged by distances of the last while, from one to another that
// is at least so much later: steps of single voxels are no approach. Seconds.
constexpr double kApproachPast = 0.2;
constexpr double kApproachStep = 0.1;
constexpr double kSameTime = 1e-6;

// Between places on a path at which the truth is looked at, metres.
constexpr double kTrueStep = 0.05;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Without a grid: radians or metres of a joint, from a place to its neighbours; and how much is
// tried for a way.
constexpr double kJointStep = 0.15;
constexpr int kMostMotions = 400;
constexpr int kShortcuts = 30;

// A way of motions that are free; empty: none was found.
std::vector<Configuration> SearchWay(
    const JointSpace& space, const Configuration& from, const Configuration& to,
    const std::function<bool(const std::vector<Configuration>& motion)>& is_free) {
  const auto found = SearchJoints(
      space.grid.joints(), from, to, {.most_checks = kMostMotions, .shortcuts = kShortcuts},
      [&](const Configuration& a, const Configuration& b) -> absl::StatusOr<bool> {
        return is_free({a, b});
      },
      [] { return false; });
  return found.ok() ? found->waypoints : std::vector<Configuration>();
}

// A step of one joint away.
std::vector<Configuration> NeighboursOf(const JointSpace& space, const Configuration& q) {
  std::vector<Configuration> neighbours;
  for (int joint = 0; joint < space.grid.dimensions(); ++joint) {
    for (const int delta : {-1, 1}) {
      if (space.limits_only) {
        const GridJoint& range = space.grid.joints()[static_cast<size_t>(joint)];
        Configuration next = q;
        double& value = next[static_cast<size_t>(joint)];
        value = std::clamp(value + delta * kJointStep, range.lower, range.upper);
        neighbours.push_back(std::move(next));
      } else if (const auto here = space.grid.Nearest(q)) {
        const auto next = space.grid.Neighbour(*space.grid.IndexOf(*here), joint, delta);
        if (next) neighbours.push_back(space.grid.At(*next));
      }
    }
  }
  return neighbours;
}

class LightCurtain : public Method {
 public:
  using Method::Method;
  Decision Decide(const Situation& now) override { return {AllowedInTruth(now)}; }
  double AllowedInTruth(const Situation& now) const override {
    return now.inside_fence ? 0 : rule().fastest().speed;
  }
};

class ZoneScanner : public Method {
 public:
  using Method::Method;
  Decision Decide(const Situation& now) override { return {AllowedInTruth(now)}; }
  double AllowedInTruth(const Situation& now) const override {
    if (now.inside_inner_fence) return 0;
    return now.inside_fence ? rule().separation.levels.front().speed : rule().fastest().speed;
  }
};

// Moves at full speed where the next piece of its path is free, else not at all.
class PathWatch : public Method {
 public:
  PathWatch(const SpeedRule& rule, Preset preset) : Method(rule), preset_(preset) {}

  std::optional<Preset> preset() const override { return preset_; }
  Decision Decide(const Situation& now) override {
    if (now.checker == nullptr) return {};
    const SpeedLevel& level = rule().fastest();
    const double next = level.speed * rule().period + level.stopping_distance;
    const bool free = now.checker->CheckPath(now.robot.Ahead(next)).verdict.free();
    return {free ? level.speed : 0};
  }
  std::vector<Configuration> Plan(const Situation& now, const JointSpace& space,
                                  const Configuration& goal) override {
    if (now.checker == nullptr) return {};
    const Checker& checker = *now.checker;
    const std::vector<Configuration> direct = {now.robot.at(), goal};
    if (checker.CheckPath(direct).verdict.free()) return direct;
    if (space.limits_only) {
      return SearchWay(space, now.robot.at(), goal, [&](const std::vector<Configuration>& motion) {
        return checker.CheckPath(motion).verdict.free();
      });
    }
    const ConfigurationGrid& grid = space.grid;
    const ConfigurationSpace map(checker.served(), checker.policy());
    const FreeSpace free{
        .point = [&](ConfigurationNumber number) { return map.state(number) == State::kFree; },
        .configuration = [&](std::span<const double> q) { return checker.Check(q).free(); },
        .move =
            [&](ConfigurationNumber from, ConfigurationNumber to) {
              const std::vector<Configuration> way = {grid.At(from), grid.At(to)};
              return checker.CheckPath(way).verdict.free();
            }};
    return PlanByWavePropagation(grid, free, now.robot.at(), goal, {.moves = Moves::kDiagonals})
        .waypoints;
  }

 private:
  const Preset preset_;
};

// Moves as fast as the speed levels keep their protective distances.
class SpeedLevels : public Method {
 public:
  explicit SpeedLevels(const SpeedRule& rule)
      : Method(rule), protective_(rule.ProtectiveDistances()) {}

  Decision Decide(const Situation& now) override {
    const auto kept = LevelsKeptAhead(
        now, [&](const std::vector<Configuration>& way) { return Along(now, way); });
    if (!kept) return {};
    Note(now.time, kept->path.at_start);
    const std::vector<SpeedLevel>& levels = rule().separation.levels;
    if (kept->count > 0) return {levels[kept->count - 1].speed};
    if (LeadsAway(now, now.robot.Ahead(kWayOut))) return {levels.front().speed, true};
    return {};
  }

  std::vector<Configuration> Plan(const Situation& now, const JointSpace& space,
                                  const Configuration& goal) override {
    const std::vector<Configuration> direct = {now.robot.at(), goal};
    const auto along = Along(now, direct);
    if (!along) return {};
    if (along->distance >= protective_.front()) return direct;
    // Where it may not leave, it keeps its way until people are farther away.
    if (along->at_start <= rule().leave_from) return {};
    if (along->at_start < protective_.front()) return WayOut(now, space);
    std::vector<Configuration> way = WayAround(now, space, goal);
    // Or as far as people permit.
    return way.empty() ? direct : way;
  }

  double AllowedInTruth(const Situation& now) const override {
    const auto kept = LevelsKeptAhead(
        now, [&](const std::vector<Configuration>& way) { return InTruth(now, way); });
    return kept->count == 0 ? 0 : rule().separation.levels[kept->count - 1].speed;
  }
  bool LeadsAwayInTruth(const Situation& now) const override {
    const std::vector<Configuration> way = now.robot.Ahead(kWayOut);
    const PathDistance path = InTruth(now, way).value();
    return path.distance >= path.at_start - kSameDistance &&
           now.truth.Distance(way.back(), protective_.back()) > path.at_start;
  }

 protected:
  // Metres; nothing: not known.
  virtual std::optional<PathDistance> Along(const Situation& now,
                                            const std::vector<Configuration>& way) const = 0;
  // Exact as far as it is below `limit`; else at least that.
  virtual double At(const Situation& now, std::span<const double> q, double limit) const = 0;
  // Along, by the truth; always known.
  std::optional<PathDistance> InTruth(const Situation& now,
                                      const std::vector<Configuration>& way) const {
    const auto exact = [&](std::span<const double> q) {
      return now.truth.Distance(q, protective_.back());
    };
    PathDistance path;
    path.distance = path.at_start = exact(way.front());
    for (size_t i = 1; i < way.size(); ++i) {
      const double steps = std::ceil(now.robot.MovementOf(way[i - 1], way[i]) / kTrueStep);
      for (double step = 1; step <= steps; ++step) {
        Configuration q = way[i - 1];
        for (size_t j = 0; j < q.size(); ++j) q[j] += step / steps * (way[i][j] - q[j]);
        path.distance = std::min(path.distance, exact(q));
      }
    }
    return path;
  }

 private:
  // The levels that keep their distance from where the robot is until it stands, if it goes on at
  // them until the next decision. Nothing: not known.
  template <typename Distance>
  std::optional<KeptLevels> LevelsKeptAhead(const Situation& now, const Distance& along) const {
    return LevelsKept(protective_, [&](size_t number) {
      const SpeedLevel& level = rule().separation.levels[number];
      const double stops = std::max(level.stopping_distance, now.robot.StoppingDistance());
      return along(now.robot.Ahead(level.speed * rule().period + stops));
    });
  }
  void Note(double time, double distance) {
    if (!noted_.empty() && noted_.back().time == time) noted_.pop_back();
    noted_.push_back({time, distance});
    while (noted_.size() > 2 && noted_.front().time < time - kApproachPast - kSameTime) {
      noted_.erase(noted_.begin());
    }
  }
  // How far somebody comes until the robot stands, at the greatest speed of late; metres. Infinity:
  // it is not known yet.
  double Approach() const {
    if (noted_.empty() || noted_.back().time - noted_.front().time < kApproachStep - kSameTime) {
      return kInfinity;
    }
    double fastest = 0;
    for (size_t i = 0; i < noted_.size(); ++i) {
      for (size_t j = 0; j < i; ++j) {
        const double past = noted_[i].time - noted_[j].time;
        if (past < kApproachStep - kSameTime) continue;
        fastest = std::max(fastest, (noted_[j].distance - noted_[i].distance) / past);
      }
    }
    return fastest * (2 * rule().period + rule().separation.levels.front().stopping_time);
  }
  bool LeadsAway(const Situation& now, const std::vector<Configuration>& way) const {
    if (way.size() < 2) return false;
    const auto along = Along(now, way);
    return along && along->at_start > rule().leave_from + Approach() &&
           along->distance >= along->at_start - kSameDistance &&
           At(now, way.back(), protective_.back()) >= along->at_start + kGain;
  }
  // Keeps the distance of the slowest level; empty: none was found.
  std::vector<Configuration> WayAround(const Situation& now, const JointSpace& space,
                                       const Configuration& goal) const {
    const double least = protective_.front();
    if (space.limits_only) {
      return SearchWay(space, now.robot.at(), goal, [&](const std::vector<Configuration>& motion) {
        const auto along = Along(now, motion);
        return along && along->distance >= least;
      });
    }
    const auto keeps = [&](std::span<const double> q) { return At(now, q, least) >= least; };
    const FreeSpace free{
        .point = [&](ConfigurationNumber number) { return keeps(space.grid.At(number)); },
        .configuration = keeps};
    const auto plan_from = [&](const Configuration& start) {
      return PlanByWavePropagation(space.grid, free, start, goal, {.moves = Moves::kDiagonals});
    };
    const auto plan = plan_from(now.robot.at());
    if (plan.outcome != PlanOutcome::kStartBlocked) return plan.waypoints;
    // A corner of the start's grid cell is too near: from a grid point that it can go to.
    for (const Configuration& next : NeighboursOf(space, now.robot.at())) {
      const auto along = Along(now, {now.robot.at(), next});
      if (!along || along->distance < least) continue;
      std::vector<Configuration> way = plan_from(next).waypoints;
      if (!way.empty()) way.insert(way.begin(), now.robot.at());
      return way;
    }
    return {};
  }
  // From one place to the neighbour that is farthest from everybody, and on.
  std::vector<Configuration> WayOut(const Situation& now, const JointSpace& space) const {
    constexpr int kMostSteps = 6;
    std::vector<Configuration> way = {now.robot.at()};
    double farthest = At(now, way.back(), protective_.back());
    for (int step = 0; step < kMostSteps; ++step) {
      std::optional<Configuration> best;
      for (Configuration& next : NeighboursOf(space, way.back())) {
        const double distance = At(now, next, protective_.back());
        if (distance <= farthest) continue;
        farthest = distance;
        best = std::move(next);
      }
      if (!best) break;
      way.push_back(*std::move(best));
    }
    return way.size() > 1 ? way : std::vector<Configuration>();
  }

  const std::vector<double> protective_;
  struct Noted {
    double time = 0;
    double distance = 0;
  };
  std::vector<Noted> noted_;  // at the last decisions, the newest last
};

class Oracle : public SpeedLevels {
 public:
  using SpeedLevels::SpeedLevels;

 protected:
  std::optional<PathDistance> Along(const Situation& now,
                                    const std::vector<Configuration>& way) const override {
    return InTruth(now, way);
  }
  double At(const Situation& now, std::span<const double> q, double limit) const override {
    return now.truth.Distance(q, limit);
  }
};

// Distances from the possible space of the newest scene.
class Silhouette : public SpeedLevels {
 public:
  using SpeedLevels::SpeedLevels;
  std::optional<Preset> preset() const override { return Policy{}.preset; }

 protected:
  std::optional<PathDistance> Along(const Situation& now,
                                    const std::vector<Configuration>& way) const override {
    if (now.checker == nullptr) return std::nullopt;
    return now.checker->Distance(way, std::nullopt);
  }
  double At(const Situation& now, std::span<const double> q, double) const override {
    const auto distance = Along(now, {Configuration(q.begin(), q.end())});
    return distance ? distance->at_start : 0;
  }
};

}  // namespace

std::vector<double> SpeedRule::ProtectiveDistances() const {
  std::vector<double> distances;
  for (const SpeedLevel& level : separation.levels) {
    distances.push_back(ProtectiveDistance(separation, level, 2 * period));
  }
  return distances;
}

SpeedRule DefaultRule(double reach, double rate) {
  SpeedRule rule;
  rule.period = 1 / rate;
  rule.reach = reach;
  rule.separation.reaction_time = 0;
  for (const auto& [name, speed] :
       {std::pair{"slow", 0.25}, {"reduced", 0.5}, {"medium", 0.8}, {"full", 1.2}}) {
    rule.separation.levels.push_back({.name = name,
                                      .speed = speed,
                                      .stopping_time = speed / rule.acceleration,
                                      .stopping_distance = speed * speed / 2 / rule.acceleration});
  }
  return rule;
}

std::vector<Configuration> Method::Plan(const Situation& situation, const JointSpace&,
                                        const Configuration& goal) {
  return {situation.robot.at(), goal};
}

double Method::AllowedInTruth(const Situation&) const { return kInfinity; }

bool Method::LeadsAwayInTruth(const Situation&) const { return false; }

const std::vector<std::string>& MethodNames() {
  static const std::vector<std::string> names = {kCurtain,
                                                 kScanner,
                                                 kOracle,
                                                 NameOf(Preset::kPaper),
                                                 NameOf(Preset::kUncalibrated),
                                                 NameOf(Preset::kSound),
                                                 kSilhouette};
  return names;
}

absl::Status CanRun(const std::string& name, const ServedDatabase& database) {
  if (std::ranges::count(MethodNames(), name) == 0) {
    return absl::InvalidArgumentError(absl::StrCat("there is no method '", name, "'; there are ",
                                                   absl::StrJoin(MethodNames(), ", ")));
  }
  if (const auto preset = PresetFromName(name)) return database.CanServe({.preset = *preset});
  if (name == kSilhouette && database.separation() == nullptr) {
    return absl::FailedPreconditionError(
        "the method 'silhouette' needs camera models in the database");
  }
  return absl::OkStatus();
}

std::unique_ptr<Method> MakeMethod(const std::string& name, const SpeedRule& rule) {
  if (name == kCurtain) return std::make_unique<LightCurtain>(rule);
  if (name == kScanner) return std::make_unique<ZoneScanner>(rule);
  if (name == kOracle) return std::make_unique<Oracle>(rule);
  if (name == kSilhouette) return std::make_unique<Silhouette>(rule);
  return std::make_unique<PathWatch>(rule, PresetFromName(name).value());
}

}  // namespace silhouette::people_experiment
