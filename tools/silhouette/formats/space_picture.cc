#include "tools/silhouette/formats/space_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "common/picture/palette.h"

namespace silhouette {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

double Degrees(double radians) { return radians * 180 / std::numbers::pi; }

ChartAxis AxisOf(const GridJoint& joint) {
  return {.label = joint.name,
          .unit = "deg",
          .first = Degrees(joint.lower),
          .last = Degrees(joint.continuous ? joint.upper - joint.step() : joint.upper),
          .cells = joint.steps};
}

// Where the chart of a continuous joint begins: the rim of its first cell.
double RimOf(const GridJoint& joint) { return joint.lower - joint.step() / 2; }

// In which turn of the chart `value` lies.
double TurnOf(const GridJoint& joint, double value) {
  return joint.continuous ? std::floor((value - RimOf(joint)) / kTurn) : 0;
}

// The places on the way from `a` to `b`, as shares of it, where a continuous joint goes over the
// rim, in order.
std::vector<double> RimCrossings(const ConfigurationGrid& grid, const Configuration& a,
                                 const Configuration& b) {
  std::vector<double> crossings;
  for (size_t j = 0; j < a.size(); ++j) {
    const GridJoint& joint = grid.joints()[j];
    const double first = std::min(TurnOf(joint, a[j]), TurnOf(joint, b[j]));
    const double last = std::max(TurnOf(joint, a[j]), TurnOf(joint, b[j]));
    for (double turn = first + 1; turn <= last; ++turn) {
      crossings.push_back((RimOf(joint) + turn * kTurn - a[j]) / (b[j] - a[j]));
    }
  }
  std::sort(crossings.begin(), crossings.end());
  return crossings;
}

Configuration Between(const Configuration& a, const Configuration& b, double share) {
  Configuration q = a;
  for (size_t j = 0; j < q.size(); ++j) q[j] += (b[j] - a[j]) * share;
  return q;
}

// `q` in the chart, as seen from `inside`, a place of the same piece of the path.
ChartPoint PointFrom(const ConfigurationGrid& grid, const Configuration& q,
                     const Configuration& inside) {
  std::array<double, 2> values{};
  for (size_t j = 0; j < values.size(); ++j) {
    values[j] = Degrees(q[j] - TurnOf(grid.joints()[j], inside[j]) * kTurn);
  }
  return {values[0], values[1]};
}

// From kTight (share 0) to kFree (share 1).
Colour ShadeOf(double share) {
  const auto between = [&](uint8_t tight, uint8_t free) {
    return static_cast<uint8_t>(std::lround(tight + share * (free - tight)));
  };
  return {between(palette::kTight.red, palette::kFree.red),
          between(palette::kTight.green, palette::kFree.green),
          between(palette::kTight.blue, palette::kFree.blue)};
}

// Free cells that exceed no level come after unknown and occupied ones, then those that exceed the
// first, and so on.
constexpr uint8_t kUnknownClass = 0;
constexpr uint8_t kOccupiedClass = 1;
constexpr uint8_t kFirstFreeClass = 2;

std::vector<LegendEntry> ClearanceClasses(const client::ConfigurationSpace& space) {
  const std::vector<double>& levels = space.clearance_levels();
  // The shades are for those levels that are exceeded.
  const std::vector<uint64_t> above = space.CountAbove();
  const auto exceeded = std::ranges::count_if(above, [](uint64_t count) { return count > 0; });
  std::vector<LegendEntry> classes = {
      {palette::kUnknown, "unknown"},
      {palette::kOccupied, "occupied"},
      {palette::kTight, absl::StrCat("free, clearance up to ", levels.front(), " px")}};
  for (size_t i = 0; i < levels.size(); ++i) {
    classes.push_back(
        {ShadeOf(std::min(1.0, static_cast<double>(i + 1) / static_cast<double>(exceeded))),
         absl::StrCat("above ", levels[i], " px")});
  }
  return classes;
}

uint8_t ClearanceClassOf(const client::ClearanceBound& bound, const std::vector<double>& levels) {
  if (bound.state == client::State::kUnknown) return kUnknownClass;
  if (bound.state == client::State::kOccupied) return kOccupiedClass;
  if (!bound.exceeds) return kFirstFreeClass;
  const auto level = std::ranges::find(levels, *bound.exceeds);
  return static_cast<uint8_t>(kFirstFreeClass + 1 + (level - levels.begin()));
}

uint8_t ClassOf(client::State state) {
  if (state == client::State::kUnknown) return kUnknownCell;
  return state == client::State::kFree ? kFreeCell : kOccupiedCell;
}

}  // namespace

absl::StatusOr<ConfigurationChart> ChartOf(const client::ConfigurationSpace& space,
                                           const std::string& title) {
  const ConfigurationGrid& grid = space.grid();
  if (grid.dimensions() != 2) {
    return absl::InvalidArgumentError(
        absl::StrCat("a picture of the configuration space needs a grid of 2 joints, this one has ",
                     grid.dimensions(), "; leave --picture out"));
  }
  ConfigurationChart chart;
  chart.title = title;
  chart.x = AxisOf(grid.joints()[0]);
  chart.y = AxisOf(grid.joints()[1]);
  const std::vector<double>& levels = space.clearance_levels();
  chart.classes = levels.empty() ? ConfigurationClasses() : ClearanceClasses(space);
  for (int y = 0; y < chart.y.cells; ++y) {
    for (int x = 0; x < chart.x.cells; ++x) {
      const ConfigurationNumber number = grid.NumberOf({x, y});
      chart.cells.push_back(levels.empty() ? ClassOf(space.StateAt(number))
                                           : ClearanceClassOf(space.ClearanceAt(number), levels));
    }
  }
  return chart;
}

ChartPoint ChartPointOf(const ConfigurationGrid& grid, const Configuration& configuration) {
  return PointFrom(grid, configuration, configuration);
}

std::vector<std::vector<ChartPoint>> ChartLines(const ConfigurationGrid& grid,
                                                const std::vector<Configuration>& waypoints) {
  std::vector<std::vector<ChartPoint>> lines(1);
  for (size_t i = 0; i + 1 < waypoints.size(); ++i) {
    const Configuration& a = waypoints[i];
    const Configuration& b = waypoints[i + 1];
    std::vector<double> shares = RimCrossings(grid, a, b);
    shares.insert(shares.begin(), 0);
    shares.push_back(1);
    for (size_t k = 0; k + 1 < shares.size(); ++k) {
      if (k > 0) lines.emplace_back();
      const Configuration middle = Between(a, b, (shares[k] + shares[k + 1]) / 2);
      lines.back().push_back(PointFrom(grid, Between(a, b, shares[k]), middle));
      lines.back().push_back(PointFrom(grid, Between(a, b, shares[k + 1]), middle));
    }
  }
  return lines;
}

}  // namespace silhouette
