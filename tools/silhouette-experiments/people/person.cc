// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/people/person.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

namespace silhouette::people_experiment {
namespace {

constexpr double kHeight = 1.75;
constexpr double kTrunkRadius = 0.2;
constexpr double kArmRadius = 0.05;
constexpr double kArmLength = 0.6;  // between the middles of its ends
constexpr double kShoulder = 1.35;
const Eigen::Vector3d kBoxSize(0.30, 0.40, 0.30);
constexpr double kBoxHeight = 1.1;
constexpr double kBoxAhead = 0.4;
constexpr double kFarBelow = -1000;

// Scripts: metres, seconds, metres per second.
constexpr double kNearestStand = 0.85;
constexpr double kFarthestStand = 1.35;
constexpr double kReachTime = 0.6;
constexpr double kLeastWalk = 0.8;
constexpr double kMostWalk = 1.6;

Eigen::Vector2d OnCircle(double radius, double angle) {
  return {radius * std::cos(angle), radius * std::sin(angle)};
}

// Writes the keys of one person, one after the other.
class Script {
 public:
  Script(Chance& chance, const ScriptSettings& settings, double inside_share)
      : chance_(chance), settings_(settings), inside_share_(inside_share) {}

  std::vector<PersonKey> Write() {
    angle_ = chance_.Uniform(0, 2 * std::numbers::pi);
    keys_ = {{.position = OnCircle(Outside(), angle_), .direction = Inwards()}};
    Stand(chance_.Uniform(0, 10) * (1 - inside_share_));
    while (keys_.back().time < settings_.seconds) {
      const double entered = keys_.back().time;
      Visit();
      const double inside = keys_.back().time - entered;
      Stand(inside * (1 / inside_share_ - 1) * chance_.Uniform(0.5, 1.5));
    }
    return std::move(keys_);
  }

 private:
  double Outside() { return settings_.fence + chance_.Uniform(0.3, 0.8); }
  double Inwards() const { return angle_ + std::numbers::pi; }

  void Visit() {
    speed_ = chance_.Uniform(kLeastWalk, kMostWalk);
    keys_.back().carries = chance_.Uniform() < 0.3;
    angle_ += chance_.Uniform(-0.6, 0.6);
    WalkTo(chance_.Uniform(kNearestStand, kFarthestStand));
    do {
      Stand(chance_.Uniform(0.5, 3));
      if (!keys_.back().carries && chance_.Uniform() < 0.6) Reach();
      if (chance_.Uniform() < 0.4) {
        angle_ += chance_.Uniform(-0.8, 0.8);
        WalkTo(chance_.Uniform(kNearestStand, kFarthestStand));
      }
    } while (chance_.Uniform() < 0.5);
    angle_ += chance_.Uniform(-0.6, 0.6);
    WalkTo(Outside());
    keys_.back().carries = false;
  }

  void Stand(double seconds) {
    PersonKey key = keys_.back();
    key.time += seconds;
    keys_.push_back(key);
  }
  // To `radius` at angle_, looking inwards.
  void WalkTo(double radius) {
    PersonKey key = keys_.back();
    key.position = OnCircle(radius, angle_);
    key.direction = Inwards();
    key.time += (key.position - keys_.back().position).norm() / speed_;
    keys_.push_back(key);
  }
  void Reach() {
    PersonKey key = keys_.back();
    key.time += kReachTime;
    key.reach = chance_.Uniform(0.6, 1);
    keys_.push_back(key);
    Stand(chance_.Uniform(0.5, 2));
    key = keys_.back();
    key.time += kReachTime;
    key.reach = 0;
    keys_.push_back(key);
  }

  Chance& chance_;
  const ScriptSettings& settings_;
  const double inside_share_;
  double angle_ = 0;
  double speed_ = 1;
  std::vector<PersonKey> keys_;
};

}  // namespace

Shape ShapeOf(PersonPart part) {
  switch (part) {
    case kTrunk:
      return {{0, 0, kHeight / 2 - kTrunkRadius}, kTrunkRadius};
    case kArm:
      return {{0, 0, kArmLength / 2}, kArmRadius};
    case kBox:
      return {kBoxSize / 2, 0};
  }
  return {};
}

std::vector<Obstacle> PeopleObstacles(int count) {
  std::vector<Obstacle> obstacles;
  for (int person = 0; person < count; ++person) {
    for (const auto& [part, name] :
         {std::pair{kTrunk, "trunk"}, {kArm, "arm"}, {kBox, "carried box"}}) {
      const Shape shape = ShapeOf(part);
      Obstacle obstacle;
      obstacle.name = name;
      obstacle.mesh = shape.radius > 0 ? CapsuleMesh(shape.radius, 2 * shape.half.z())
                                       : BoxMesh(2 * shape.half);
      obstacles.push_back(std::move(obstacle));
    }
  }
  return obstacles;
}

Person::Person(std::vector<PersonKey> keys, double floor) : keys_(std::move(keys)), floor_(floor) {
  if (keys_.empty()) throw std::invalid_argument("a person needs a key");
}

PersonKey Person::At(double time) const {
  const auto after = std::upper_bound(keys_.begin(), keys_.end(), time,
                                      [](double t, const PersonKey& key) { return t < key.time; });
  if (after == keys_.begin()) return keys_.front();
  if (after == keys_.end()) return keys_.back();
  const PersonKey& from = *(after - 1);
  const PersonKey& to = *after;
  const double share = (time - from.time) / (to.time - from.time);
  return {.time = time,
          .position = from.position + share * (to.position - from.position),
          .direction = from.direction + share * (to.direction - from.direction),
          .reach = from.reach + share * (to.reach - from.reach),
          .carries = from.carries};
}

Eigen::Isometry3d Person::PoseOf(PersonPart part, const PersonKey& key) const {
  Eigen::Isometry3d feet = Eigen::Isometry3d::Identity();
  feet.translation() << key.position, floor_;
  feet.rotate(Eigen::AngleAxisd(key.direction, Eigen::Vector3d::UnitZ()));
  switch (part) {
    case kTrunk:
      return feet * Eigen::Translation3d(0, 0, kHeight / 2);
    case kArm:
      return feet * Eigen::Translation3d(0, 0, kShoulder) *
             Eigen::AngleAxisd(-key.reach * std::numbers::pi / 2, Eigen::Vector3d::UnitY()) *
             Eigen::Translation3d(0, 0, -kArmLength / 2);
    case kBox:
      return feet * Eigen::Translation3d(kBoxAhead, 0, key.carries ? kBoxHeight : kFarBelow);
  }
  return feet;
}

std::vector<PlacedShape> Person::PartsAt(double time) const {
  const PersonKey key = At(time);
  std::vector<PlacedShape> parts;
  for (const PersonPart part : {kTrunk, kArm, kBox}) {
    if (part == kBox && !key.carries) continue;
    parts.push_back({ShapeOf(part), PoseOf(part, key)});
  }
  return parts;
}

void Person::AppendPoses(double time, Poses& poses) const {
  const PersonKey key = At(time);
  for (const PersonPart part : {kTrunk, kArm, kBox}) poses.push_back(PoseOf(part, key));
}

std::vector<Person> RandomPeople(Chance& chance, const ScriptSettings& settings) {
  const size_t count = 1 + chance.Index(3);
  // The share of time with somebody inside, and that of each of them.
  const double busy = chance.Uniform(0.1, 0.9);
  const double each = 1 - std::pow(1 - busy, 1.0 / static_cast<double>(count));
  std::vector<Person> people;
  for (size_t i = 0; i < count; ++i) {
    people.emplace_back(Script(chance, settings, each).Write(), settings.floor);
  }
  return people;
}

bool AnyInside(std::span<const Person> people, std::span<const double> times, double fence) {
  for (size_t i = 0; i < people.size(); ++i) {
    for (const PlacedShape& part : people[i].PartsAt(times[i])) {
      const double at = part.world_from_shape.translation().head<2>().norm();
      const double farthest =
          (part.world_from_shape.linear().cwiseAbs() * part.shape.half).head<2>().norm() +
          part.shape.radius;
      if (at - farthest < fence) return true;
    }
  }
  return false;
}

}  // namespace silhouette::people_experiment
