// SPDX-License-Identifier: Apache-2.0
#include "clients/planners/path_search.h"

#include <algorithm>
#include <map>
#include <span>
#include <utility>
#include <vector>

namespace silhouette {
namespace {

// The most configurations that the server checks at once.
constexpr size_t kMostAtOnce = 10'000;

// The two ends of a move, the lower number first.
using Edge = std::pair<ConfigurationNumber, ConfigurationNumber>;
// Whether it is free.
using KnownEdges = std::map<Edge, bool>;

Edge EdgeBetween(ConfigurationNumber a, ConfigurationNumber b) { return std::minmax(a, b); }

// Asks the server about the moves of the path that are not known yet: for the middle of each, whose
// grid cell is the one that the whole move lies in. Edges between an end off the grid and its
// corner lie in the end's own grid cell and need not be asked for. Returns the verdicts that are
// not free.
absl::StatusOr<std::vector<client::Verdict>> CheckMoves(const Client& client,
                                                        const client::Policy& policy,
                                                        const ConfigurationGrid& grid,
                                                        const std::vector<Configuration>& waypoints,
                                                        KnownEdges& known) {
  std::vector<Edge> edges;
  std::vector<Configuration> middles;
  for (size_t i = 0; i + 1 < waypoints.size(); ++i) {
    const CellCorners a = grid.CornersAround(waypoints[i]);
    const CellCorners b = grid.CornersAround(waypoints[i + 1]);
    if (a.count() != 1 || b.count() != 1) continue;
    const Edge edge = EdgeBetween(a.numbers()[0], b.numbers()[0]);
    if (known.contains(edge)) continue;
    Configuration middle = waypoints[i];
    for (size_t j = 0; j < middle.size(); ++j) {
      middle[j] += (waypoints[i + 1][j] - middle[j]) / 2;
    }
    edges.push_back(edge);
    middles.push_back(std::move(middle));
  }
  std::vector<client::Verdict> not_free;
  for (size_t begin = 0; begin < middles.size(); begin += kMostAtOnce) {
    const size_t count = std::min(kMostAtOnce, middles.size() - begin);
    const auto checks = client.CheckConfigurations(std::span(middles).subspan(begin, count), policy,
                                                   client::Evidence::kOmit);
    if (!checks.ok()) return checks.status();
    for (size_t i = 0; i < count; ++i) {
      const client::Verdict& verdict = checks->verdicts[i];
      known[edges[begin + i]] = verdict.free();
      if (!verdict.free()) not_free.push_back(verdict);
    }
  }
  return not_free;
}

}  // namespace

absl::StatusOr<PathSearch> SearchPath(const Client& client, const client::Policy& policy,
                                      const client::ConfigurationSpace& space,
                                      const Configuration& start, bool start_free,
                                      const Configuration& goal, bool goal_free, Moves moves,
                                      const std::function<bool()>& stopped) {
  KnownEdges known;
  FreeSpace free_space{.point = [&](ConfigurationNumber n) { return space.IsFree(n); }};
  free_space.configuration = [&](std::span<const double> q) {
    if (std::equal(q.begin(), q.end(), start.begin(), start.end())) return start_free;
    return std::equal(q.begin(), q.end(), goal.begin(), goal.end()) && goal_free;
  };
  free_space.move = [&](ConfigurationNumber a, ConfigurationNumber b) {
    const auto found = known.find(EdgeBetween(a, b));
    return found == known.end() || found->second;
  };
  const auto find = [&](bool simplify) {
    return PlanByWavePropagation(space.grid(), free_space, start, goal,
                                 {.moves = moves, .simplify = simplify});
  };
  PathSearch search;
  for (bool all_free = false; !all_free;) {
    if (stopped()) {
      return absl::AbortedError("stopped; run the command again to find the path");
    }
    ++search.rounds;
    search.plan = find(false);
    const auto not_free = CheckMoves(client, policy, space.grid(), search.plan.waypoints, known);
    if (!not_free.ok()) return not_free.status();
    all_free = not_free->empty();
    const auto unknown =
        std::ranges::find(*not_free, client::State::kUnknown, &client::Verdict::state);
    if (unknown == not_free->end()) continue;
    search.plan = Plan();
    search.unknown = *unknown;
    return search;
  }
  if (search.plan.found()) search.plan = find(true);
  for (const auto& [edge, is_free] : known) search.blocked_moves += is_free ? 0 : 1;
  return search;
}

}  // namespace silhouette
