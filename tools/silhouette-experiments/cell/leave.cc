// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/cell/leave.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "capture/sim/ray_scene.h"
#include "common/numbers/numbers.h"
#include "common/parallel/parallel.h"
#include "db/status/status_macros.h"
#include "server/collision/collision_checker.h"

namespace silhouette::cell_experiment {
namespace {

constexpr uint64_t kLeaveStream = uint64_t{1} << 43;  // of chance: apart from other scenes'
constexpr int kLeavePlaces = 200;  // around the robot, before it stands elsewhere
constexpr int kLeaveRobots = 300;  // configurations that are tried
constexpr int kLeaveTests = 200;   // configurations, of which some must touch
constexpr size_t kLeaveAtOnce = 64;

// Distances from the robot: metres, ascending.
constexpr std::array kRanges = {0.05, 0.1, 0.2, 0.3};
constexpr double kPersonHeight = 1.75;  // metres

Obstacle RandomTrunk(Chance& chance) {
  Obstacle person;
  person.name = "person";
  person.brightness = chance.Between(0.02, 0.95);
  const double radius = chance.Between(0.15, 0.22);
  person.mesh = CapsuleMesh(radius, kPersonHeight - 2 * radius);
  return person;
}

class PersonSearch {
 public:
  PersonSearch(const SimulatedWorkplace& workplace, Chance& chance)
      : workplace_(workplace), chance_(chance), parts_(BodyPartsOf(workplace.robot())) {}

  // False if no place was found for it.
  bool Place(LeaveScene& near, double nearest, double farthest) {
    const double floor = workplace_.simulation().settings().room.lower.z();
    Obstacle& person = near.scene.obstacles[0];
    const ContactChecker contact(workplace_.robot(), near.scene.obstacles);
    const Poses links = workplace_.LinkPoses(near.scene.robot);
    for (int i = 0; i < kLeavePlaces; ++i) {
      const BodyPart& part = parts_[static_cast<size_t>(chance_.Below(int(parts_.size())))];
      const Eigen::Vector3d& vertex =
          part.mesh.vertices[static_cast<size_t>(chance_.Below(int(part.mesh.vertices.size())))];
      const Eigen::Vector3d away = chance_.Rotation() * Eigen::Vector3d::UnitZ();
      Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
      pose.translation() = links[part.frame] * vertex + chance_.Between(0, 2 * farthest) * away;
      pose.translation().z() = floor + kPersonHeight / 2;
      near.distance = contact.Check(links, {pose}).distance;
      if (!(near.distance >= nearest && near.distance < farthest)) continue;
      if (!InTheWay(contact, pose)) continue;
      person.world_from_obstacle = pose;
      return true;
    }
    return false;
  }

 private:
  bool InTheWay(const ContactChecker& contact, const Eigen::Isometry3d& pose) {
    for (int i = 0; i < kLeaveTests; ++i) {
      const Configuration q = RandomConfiguration(chance_, workplace_.cell().grid, true);
      if (contact.Touches(workplace_.LinkPoses(q), {pose})) return true;
    }
    return false;
  }

  const SimulatedWorkplace& workplace_;
  Chance& chance_;
  const std::vector<BodyPart> parts_;
};

// The neighbouring grid points, diagonal ones included; of a continuous joint by the shorter way.
std::vector<Configuration> NeighboursOf(const ConfigurationGrid& grid, const Configuration& q) {
  std::vector<GridIndex> indices = {*grid.IndexOf(*grid.Nearest(q))};
  for (int j = 0; j < grid.dimensions(); ++j) {
    const size_t before = indices.size();
    for (size_t i = 0; i < before; ++i) {
      for (const int delta : {-1, 1}) {
        if (const auto to = grid.Neighbour(indices[i], j, delta)) indices.push_back(*to);
      }
    }
  }
  std::vector<Configuration> neighbours;
  for (size_t i = 1; i < indices.size(); ++i) {
    Configuration to = grid.At(grid.NumberOf(indices[i]));
    for (size_t j = 0; j < to.size(); ++j) {
      if (!grid.joints()[j].continuous) continue;
      to[j] = q[j] + std::remainder(to[j] - q[j], 2 * std::numbers::pi);
    }
    neighbours.push_back(std::move(to));
  }
  return neighbours;
}

// What one scene adds to the rows of its distance, one per policy.
void JudgeLeave(const TrialSetting& setting, const ViewedScene& viewed, std::span<LeaveRow*> rows) {
  const SimulatedWorkplace& workplace = setting.workplace;
  const ContactChecker contact(workplace.robot(), viewed.truth.obstacles);
  const Poses obstacles = ObstaclePoses(viewed.truth.obstacles, 0);
  const auto checkers = CheckersOf(setting, viewed);
  const std::vector<Configuration> tests = PresentConfigurations(setting.database);
  struct InTruth {
    bool touches = false;
    std::vector<bool> free;  // by policy
  };
  std::vector<InTruth> answers(tests.size());
  ParallelFor((tests.size() + kLeaveAtOnce - 1) / kLeaveAtOnce, [&](size_t part) {
    for (size_t i = part * kLeaveAtOnce; i < std::min(tests.size(), (part + 1) * kLeaveAtOnce);
         ++i) {
      answers[i].touches = contact.Touches(workplace.LinkPoses(tests[i]), obstacles);
      for (const auto& checker : checkers)
        answers[i].free.push_back(checker->Check(tests[i]).free());
    }
  });
  std::vector<Configuration> ways;
  std::vector<Configuration> blocked;
  const MotionChecker motion(workplace.robot(), contact);
  for (const Configuration& to : NeighboursOf(setting.database.grid(), viewed.truth.robot)) {
    const MotionContact way =
        motion.Check(workplace.Positions(viewed.truth.robot), workplace.Positions(to), obstacles);
    (way.contact.touching ? blocked : ways).push_back(to);
  }
  for (size_t p = 0; p < rows.size(); ++p) {
    LeaveRow& row = *rows[p];
    ++row.scenes;
    for (const InTruth& answer : answers) {
      const bool free = answer.free[p];
      row.tally.Add({.tested = 1,
                     .occupied = answer.touches ? 1u : 0u,
                     .additional = !answer.touches && !free ? 1u : 0u,
                     .missing = answer.touches && free ? 1u : 0u});
    }
    if (checkers[p]->Check(viewed.truth.robot).free()) ++row.stays;
    const auto is_free = [&](const Configuration& to) {
      const std::vector<Configuration> path = {viewed.truth.robot, to};
      return checkers[p]->CheckPath(path).verdict.free();
    };
    const auto free_steps = std::ranges::count_if(ways, is_free);
    if (!ways.empty() && free_steps == 0) ++row.locked;
    row.steps += static_cast<int>(ways.size());
    row.free_steps += static_cast<int>(free_steps);
    row.touching_steps += static_cast<int>(blocked.size());
    row.wrong_steps += static_cast<int>(std::ranges::count_if(blocked, is_free));
  }
}

}  // namespace

std::optional<LeaveScene> MakeLeaveScene(const SimulatedWorkplace& workplace, uint64_t seed,
                                         int number) {
  Chance chance(seed, kLeaveStream + static_cast<uint64_t>(number));
  LeaveScene near;
  const size_t range = static_cast<size_t>(number) % (kRanges.size() - 1);
  PersonSearch search(workplace, chance);
  for (int i = 0; i < kLeaveRobots; ++i) {
    near.scene.obstacles = {RandomTrunk(chance)};
    near.scene.robot_on_grid = true;
    near.scene.robot = RandomConfiguration(chance, workplace.cell().grid, true);
    if (search.Place(near, kRanges[range], kRanges[range + 1])) return near;
  }
  return std::nullopt;
}

absl::StatusOr<LeaveResult> RunLeave(const TrialSetting& setting, int scenes,
                                     const LeaveProgress& progress) {
  LeaveResult result;
  std::vector<LeaveRow>& rows = result.rows;
  for (size_t i = 0; i + 1 < kRanges.size(); ++i) {
    for (const Policy& policy : setting.policies) {
      rows.push_back({.policy = policy, .nearest = kRanges[i], .farthest = kRanges[i + 1]});
    }
  }
  for (int number = 0; number < scenes; ++number) {
    if (!progress(number)) {
      return absl::CancelledError("stopped; run the same command again, the database is complete");
    }
    const auto near = MakeLeaveScene(setting.workplace, setting.seed, number);
    if (!near) continue;
    ++result.found;
    ASSIGN_OR_RETURN(const ViewedScene viewed, View(setting, near->scene, number));
    if (viewed.scene.Blocked() != Reason::kNone) {
      ++result.unusable;
      continue;
    }
    std::vector<LeaveRow*> its;
    for (LeaveRow& row : rows) {
      if (near->distance >= row.nearest && near->distance < row.farthest) its.push_back(&row);
    }
    JudgeLeave(setting, viewed, its);
  }
  return result;
}

std::string TextOf(std::span<const LeaveRow> rows) {
  std::string text =
      "preset            views distance     scenes  stays locked free steps wrong steps   occupied "
      "   additional   "
      "missing\n";
  for (const LeaveRow& row : rows) {
    absl::StrAppendFormat(
        &text, "%-17s %5d %2.0f..%2.0f cm %9d %6d %6d %4d of %3d %4d of %3d %10d %10.2f %% %9d\n",
        NameOf(row.policy.preset), row.policy.min_views.value_or(0), 100 * row.nearest,
        100 * row.farthest, row.scenes, row.stays, row.locked, row.free_steps, row.steps,
        row.wrong_steps, row.touching_steps, row.tally.occupied,
        Percent(row.tally.additional, row.tally.tested), row.tally.missing);
  }
  return text;
}

nlohmann::ordered_json JsonOf(std::span<const LeaveRow> rows) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const LeaveRow& row : rows) {
    json.push_back({{"preset", NameOf(row.policy.preset)},
                    {"min_views", row.policy.min_views.value_or(0)},
                    {"nearest_m", row.nearest},
                    {"farthest_m", row.farthest},
                    {"scenes", row.scenes},
                    {"stays", row.stays},
                    {"locked", row.locked},
                    {"steps", row.steps},
                    {"free_steps", row.free_steps},
                    {"touching_steps", row.touching_steps},
                    {"wrong_steps", row.wrong_steps},
                    {"tested", row.tally.tested},
                    {"occupied", row.tally.occupied},
                    {"additional", row.tally.additional},
                    {"missing", row.tally.missing}});
  }
  return json;
}

}  // namespace silhouette::cell_experiment
