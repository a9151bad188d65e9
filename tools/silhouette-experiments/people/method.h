// SPDX-License-Identifier: Apache-2.0
// What decides how fast the robot may go while people are about, and where: a light curtain, a
// scanner of two zones, an oracle, the presets, and distances from the possible space.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/collision/separation.h"
#include "server/scene/checker.h"
#include "server/scene/served_database.h"
#include "tools/silhouette-experiments/people/motion.h"
#include "tools/silhouette-experiments/people/truth.h"

namespace silhouette::people_experiment {

// What all methods share. Metres, seconds.
struct SpeedRule {
  SeparationSettings separation;
  double acceleration = 4;  // of the fastest point; all stopping is done with it
  // From images to images. A decision is due with each, and rests on those before.
  double period = 0.05;
  double reach = 0;  // of the robot: radius about its base
  // A robot does not leave people who are no farther away (SeparationBasis::leave_from).
  double leave_from = 0.32;

  const SpeedLevel& fastest() const { return separation.levels.back(); }
  // By level, slow ones first. Until the next decision, images become two periods old.
  std::vector<double> ProtectiveDistances() const;
  // Radius that a curtain guards: who walks in reaches the robot after it stands.
  double Fence() const {
    return reach + separation.human_speed * (period + fastest().stopping_time);
  }
  // The same for the slowest level.
  double InnerFence() const {
    return reach + separation.human_speed * (period + separation.levels.front().stopping_time);
  }
};

// Four levels up to 1.2 m/s. `rate`: images, and decisions, a second.
SpeedRule DefaultRule(double reach, double rate);

// The cell at the moment of a decision.
struct Situation {
  double time = 0;  // seconds since the episode began
  const PathFollower& robot;
  Truth& truth;
  // Of the newest images that are ready; null: there are none, or the method does not look.
  const Checker* checker = nullptr;
  bool inside_fence = false;
  bool inside_inner_fence = false;
};

// What a robot is planned in.
struct JointSpace {
  const ConfigurationGrid& grid;
  // The cell states no grid of all joints: of this one the limits count alone.
  bool limits_only = false;
};

struct Decision {
  double speed = 0;  // allowed until the next one, m/s
  // Below the protective distance, on a way that leads away from everybody.
  bool leaves = false;
};

// For one thread. Refers to its rule.
class Method {
 public:
  explicit Method(const SpeedRule& rule) : rule_(rule) {}
  virtual ~Method() = default;

  // The preset of the checker that it asks; nothing: it does not look.
  virtual std::optional<Preset> preset() const { return std::nullopt; }
  virtual Decision Decide(const Situation& situation) = 0;
  // From where the robot is, to the goal, or at least to a better place; empty: there is no way.
  virtual std::vector<Configuration> Plan(const Situation& situation, const JointSpace& space,
                                          const Configuration& goal);
  // The fastest speed by its rule, by the truth; infinity: it has none.
  virtual double AllowedInTruth(const Situation& situation) const;
  // Whether the robot's way leads away from everybody, by the truth.
  virtual bool LeadsAwayInTruth(const Situation& situation) const;

 protected:
  const SpeedRule& rule() const { return rule_; }

 private:
  const SpeedRule& rule_;
};

// light_curtain, zone_scanner, oracle, silhouette, and the presets: all but "calibrated" ones,
// which freeze next to a person (docs/verdict-quality.md).
const std::vector<std::string>& MethodNames();
// FailedPrecondition: the database has not what it needs. InvalidArgument: there is no such method.
absl::Status CanRun(const std::string& name, const ServedDatabase& database);
std::unique_ptr<Method> MakeMethod(const std::string& name, const SpeedRule& rule);

}  // namespace silhouette::people_experiment
