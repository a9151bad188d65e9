// SPDX-License-Identifier: Apache-2.0
#include "clients/planners/joint_search.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <utility>

#include "absl/status/status.h"

namespace silhouette {
namespace {

double FarthestJoint(const Configuration& a, const Configuration& b) {
  double farthest = 0;
  for (size_t j = 0; j < a.size(); ++j) farthest = std::max(farthest, std::abs(a[j] - b[j]));
  return farthest;
}

Configuration Between(const Configuration& a, const Configuration& b, double share) {
  Configuration between = a;
  for (size_t j = 0; j < a.size(); ++j) between[j] += share * (b[j] - a[j]);
  return between;
}

// Configurations from which a free way leads back to the first.
struct SearchTree {
  std::vector<Configuration> places;
  std::vector<size_t> from;  // the place before, by place

  explicit SearchTree(const Configuration& root) : places{root}, from{0} {}

  size_t Nearest(const Configuration& q) const {
    const auto nearer = [&](const Configuration& a, const Configuration& b) {
      return FarthestJoint(a, q) < FarthestJoint(b, q);
    };
    return static_cast<size_t>(std::ranges::min_element(places, nearer) - places.begin());
  }
  size_t Add(Configuration q, size_t before) {
    places.push_back(std::move(q));
    from.push_back(before);
    return places.size() - 1;
  }
  // From `last` to the root.
  std::vector<Configuration> WayBack(size_t last) const {
    std::vector<Configuration> way = {places[last]};
    while (last != 0) {
      last = from[last];
      way.push_back(places[last]);
    }
    return way;
  }
};

// One search. Goes once.
class TwoTrees {
 public:
  using CheckMotionFree =
      std::function<absl::StatusOr<bool>(const Configuration&, const Configuration&)>;

  TwoTrees(std::span<const GridJoint> joints, const JointSearchSettings& settings,
           const CheckMotionFree& is_free, const std::function<bool()>& stopped)
      : joints_(joints),
        settings_(settings),
        is_free_(is_free),
        stopped_(stopped),
        random_(settings.seed) {}

  absl::StatusOr<JointSearch> Go(const Configuration& start, const Configuration& goal);

 private:
  Configuration Any();
  absl::StatusOr<bool> IsFree(const Configuration& from, const Configuration& to);
  // Grows by a step towards `q`; nothing if that is not free.
  absl::StatusOr<std::optional<size_t>> Extend(SearchTree& tree, const Configuration& q);
  // The same until it is there; whether it came there, and the last place.
  absl::StatusOr<std::pair<bool, size_t>> Connect(SearchTree& tree, const Configuration& q);
  absl::Status Shorten();

  const std::span<const GridJoint> joints_;
  const JointSearchSettings& settings_;
  const CheckMotionFree& is_free_;
  const std::function<bool()>& stopped_;
  std::mt19937_64 random_;
  JointSearch found_;
};

Configuration TwoTrees::Any() {
  Configuration q;
  for (const GridJoint& joint : joints_) {
    q.push_back(std::uniform_real_distribution<double>(joint.lower, joint.upper)(random_));
  }
  return q;
}

absl::StatusOr<bool> TwoTrees::IsFree(const Configuration& from, const Configuration& to) {
  if (stopped_()) return absl::AbortedError("the search was stopped");
  ++found_.checks;
  return is_free_(from, to);
}

absl::StatusOr<std::optional<size_t>> TwoTrees::Extend(SearchTree& tree, const Configuration& q) {
  const size_t nearest = tree.Nearest(q);
  const double way = FarthestJoint(tree.places[nearest], q);
  Configuration next =
      way <= settings_.step ? q : Between(tree.places[nearest], q, settings_.step / way);
  const absl::StatusOr<bool> free = IsFree(tree.places[nearest], next);
  if (!free.ok()) return free.status();
  if (!*free) return std::optional<size_t>();
  return std::optional(tree.Add(std::move(next), nearest));
}

absl::StatusOr<std::pair<bool, size_t>> TwoTrees::Connect(SearchTree& tree,
                                                          const Configuration& q) {
  std::pair<bool, size_t> reached(false, 0);
  while (true) {
    const auto next = Extend(tree, q);
    if (!next.ok()) return next.status();
    if (!*next) return reached;
    reached = {tree.places[**next] == q, **next};
    if (reached.first) return reached;
  }
}

absl::Status TwoTrees::Shorten() {
  std::vector<Configuration>& way = found_.waypoints;
  for (int i = 0; i < settings_.shortcuts && way.size() > 2; ++i) {
    const size_t first = random_() % (way.size() - 2);
    const size_t last = first + 2 + random_() % (way.size() - first - 2);
    const absl::StatusOr<bool> free = IsFree(way[first], way[last]);
    if (!free.ok()) return free.status();
    if (!*free) continue;
    way.erase(way.begin() + static_cast<std::ptrdiff_t>(first) + 1,
              way.begin() + static_cast<std::ptrdiff_t>(last));
  }
  return absl::OkStatus();
}

absl::StatusOr<JointSearch> TwoTrees::Go(const Configuration& start, const Configuration& goal) {
  SearchTree from_start(start);
  SearchTree from_goal(goal);
  SearchTree* grows = &from_start;
  SearchTree* follows = &from_goal;
  Configuration towards = goal;  // the straight way first
  while (found_.checks < settings_.most_checks) {
    const auto next = Extend(*grows, towards);
    if (!next.ok()) return next.status();
    if (*next) {
      const auto reached = Connect(*follows, grows->places[**next]);
      if (!reached.ok()) return reached.status();
      if (reached->first) {
        std::vector<Configuration> way = grows->WayBack(**next);
        std::ranges::reverse(way);
        const std::vector<Configuration> rest = follows->WayBack(reached->second);
        way.insert(way.end(), rest.begin() + 1, rest.end());
        if (grows == &from_goal) std::ranges::reverse(way);
        found_.waypoints = std::move(way);
        const absl::Status shortened = Shorten();
        if (!shortened.ok()) return shortened;
        return std::move(found_);
      }
    }
    std::swap(grows, follows);
    towards = Any();
  }
  return std::move(found_);
}

}  // namespace

absl::StatusOr<JointSearch> SearchJoints(
    std::span<const GridJoint> joints, const Configuration& start, const Configuration& goal,
    const JointSearchSettings& settings,
    const std::function<absl::StatusOr<bool>(const Configuration& from, const Configuration& to)>&
        is_free,
    const std::function<bool()>& stopped) {
  if (start.size() != joints.size() || goal.size() != joints.size()) {
    return absl::InvalidArgumentError("start and goal have one value for each joint");
  }
  return TwoTrees(joints, settings, is_free, stopped).Go(start, goal);
}

}  // namespace silhouette
