// SPDX-License-Identifier: Apache-2.0
// Distances from voxels, and the protective separation distance.
#include "server/collision/separation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "server/collision/space_distances.h"
#include "tests/random.h"

namespace silhouette {
namespace {

TEST(SpaceDistances, AreThoseBetweenTheBoxesOfVoxels) {
  Random random;
  for (int round = 0; round < 30; ++round) {
    const int width = std::uniform_int_distribution<int>(3, 90)(random);
    const VoxelGrid grid({Eigen::Vector3d::Zero(), Eigen::Vector3d(width, 11, 20) * 0.05}, 0.05);
    VoxelSet set(grid);
    const auto somewhere = [&](int axis) {
      return std::uniform_int_distribution<int>(0, grid.size(axis) - 1)(random);
    };
    std::vector<Eigen::Vector3i> voxels;
    const int many = round % 3 == 0 ? 200 : 1;
    for (int i = 0; i < many * (round % 5); ++i) {
      voxels.emplace_back(somewhere(0), somewhere(1), somewhere(2));
      set.Insert(voxels.back().x(), voxels.back().y(), voxels.back().z());
    }
    const double range = std::uniform_real_distribution<double>(0.04, 2)(random);
    const SpaceDistances distances({{set, grid}}, range);
    for (int i = 0; i < 300; ++i) {
      const Eigen::Vector3i at(somewhere(0), somewhere(1), somewhere(2));
      const Eigen::AlignedBox3d box = grid.Box(at.x(), at.y(), at.z());
      double expected = range;
      for (const Eigen::Vector3i& voxel : voxels) {
        const Eigen::Vector3i apart =
            ((voxel - at).cwiseAbs() - Eigen::Vector3i::Ones()).cwiseMax(0);
        expected = std::min(expected, 0.05 * std::sqrt(static_cast<double>(apart.squaredNorm())));
      }
      EXPECT_NEAR(distances.AtLeast(box.center()), expected, 1e-9);
    }
  }
}

TEST(SpaceDistances, DistanceIsThatToTheNearestBoxOfAllSets) {
  Random random;
  const VoxelGrid wide({Eigen::Vector3d::Zero(), Eigen::Vector3d(3, 2, 2)}, 0.1);
  const VoxelGrid fine({Eigen::Vector3d(0.53, 0.21, 0.4), Eigen::Vector3d(1.5, 1.4, 1.6)}, 0.03);
  const auto below = [&](int end) {
    return std::uniform_int_distribution<int>(0, end - 1)(random);
  };
  for (int round = 0; round < 40; ++round) {
    VoxelSet far(wide);
    VoxelSet near(fine);
    std::vector<Eigen::AlignedBox3d> boxes;
    const auto add = [&](const VoxelGrid& grid, VoxelSet& set) {
      const Eigen::Vector3i at(below(grid.size(0)), below(grid.size(1)), below(grid.size(2)));
      set.Insert(at.x(), at.y(), at.z());
      boxes.push_back(grid.Box(at.x(), at.y(), at.z()));
    };
    for (int i = 0; i < round % 4; ++i) add(wide, far);
    for (int i = 0; i < 7 * (round % 3); ++i) add(fine, near);
    const double range = std::uniform_real_distribution<double>(0.1, 2)(random);
    const SpaceDistances distances({{far, wide}, {near, fine}}, range);
    for (int i = 0; i < 300; ++i) {
      const Eigen::Vector3d at = Eigen::Array3d(3, 2, 2) * (Eigen::Array3d::Random() + 1) / 2.0001;
      double expected = range;
      for (const auto& box : boxes) expected = std::min(expected, box.exteriorDistance(at));
      EXPECT_NEAR(distances.Distance(at, 100), expected, 1e-9);
      EXPECT_NEAR(distances.Distance(at, range / 3), std::min(range / 3, expected), 1e-9);
      EXPECT_LE(distances.AtLeast(at), expected + 1e-9);
    }
  }
}

TEST(SpaceDistances, AMapOfAPartOfTheGridIsThatOfAllThereAndBoundsWhatIsBeyond) {
  Random random;
  const VoxelGrid grid({Eigen::Vector3d::Zero(), Eigen::Vector3d(3, 2, 2)}, 0.05);
  int within = 0;
  for (int round = 0; round < 20; ++round) {
    const auto somewhere = [&]() -> Eigen::Vector3d {
      return Eigen::Array3d(3, 2, 2) * (Eigen::Array3d::Random() + 1) / 2.0001;
    };
    VoxelSet set(grid);
    for (int i = 0; i < round % 5; ++i) {
      const Eigen::Vector3i at = (somewhere() / grid.edge()).cast<int>();
      set.Insert(at.x(), at.y(), at.z());
    }
    Eigen::AlignedBox3d asked(somewhere());
    asked.extend(somewhere());
    const double range = std::uniform_real_distribution<double>(0.1, 2)(random);
    const SpaceDistances of_all({{set, grid}}, range);
    const SpaceDistances of_part({{set, grid}}, range, {}, asked);
    for (int i = 0; i < 300; ++i) {
      const Eigen::Vector3d at = somewhere();
      EXPECT_EQ(of_part.Distance(at, range), of_all.Distance(at, range));
      EXPECT_LE(of_part.AtLeast(at), of_all.Distance(at, range) + 1e-9);
      EXPECT_GE(of_part.AtLeast(at),
                of_all.Distance(at, range) - 2 * asked.exteriorDistance(at) - 2 * grid.edge());
      if (!asked.contains(at)) continue;
      EXPECT_EQ(of_part.AtLeast(at), of_all.AtLeast(at));
      ++within;
    }
  }
  EXPECT_GT(within, 100);
}

TEST(SpaceDistances, NothingIsKnownBeyondTheGrid) {
  const VoxelGrid grid({Eigen::Vector3d::Zero(), Eigen::Vector3d::Ones()}, 0.1);
  const VoxelSet none(grid);
  const SpaceDistances distances({{none, grid}}, 1);
  EXPECT_EQ(distances.AtLeast({0.5, 0.5, 0.5}), 1);
  EXPECT_EQ(distances.AtLeast({0.5, 0.5, -0.01}), 0);
  EXPECT_EQ(distances.Distance({0.5, 0.5, 0.5}, 2), 1);
  EXPECT_EQ(distances.Distance({0.5, 0.5, -0.01}, 2), 0);
  EXPECT_EQ(distances.Distance({0.5, std::nan(""), 0.5}, 2), 0);
  EXPECT_EQ(distances.AtLeast({std::nan(""), 0.5, 0.5}), 0);
}

TEST(SpaceDistances, SomebodyMayBeAnywhereBeyondWhatIsKnown) {
  const VoxelGrid grid({Eigen::Vector3d::Zero(), Eigen::Vector3d::Ones()}, 0.1);
  const VoxelSet none(grid);
  const SpaceDistances distances(
      {{none, grid}}, 1, Eigen::AlignedBox3d(Eigen::Vector3d::Zero(), Eigen::Vector3d(1, 1, 0.9)));
  for (const Eigen::Vector3d& at :
       {Eigen::Vector3d(0.5, 0.5, 0.5), Eigen::Vector3d(0.5, 0.2, 0.6)}) {
    EXPECT_NEAR(distances.Distance(at, 2), at.y() < 0.4 ? 0.2 : 0.4, 1e-12);
    EXPECT_NEAR(distances.AtLeast(at), at.y() < 0.4 ? 0.2 : 0.4, 1e-12);
  }
  EXPECT_EQ(distances.Distance({0.5, 0.5, 0.95}, 2), 0);
  EXPECT_EQ(distances.AtLeast({0.5, 0.5, 0.95}), 0);
}

TEST(SpaceDistances, RefusesARangeThatCannotBe) {
  const VoxelGrid grid({Eigen::Vector3d::Zero(), Eigen::Vector3d::Ones()}, 0.1);
  const VoxelSet none(grid);
  for (double range : {0.0, -1.0, 13.0, std::nan("")}) {
    EXPECT_THROW(SpaceDistances({{none, grid}}, range), std::invalid_argument);
  }
  const VoxelSet other;
  EXPECT_THROW(SpaceDistances({{other, grid}}, 1), std::invalid_argument);
  EXPECT_THROW(SpaceDistances({}, 1), std::invalid_argument);
  const Eigen::AlignedBox3d beyond(Eigen::Vector3d(2, 2, 2), Eigen::Vector3d(3, 3, 3));
  EXPECT_THROW(SpaceDistances({{none, grid}}, 1, {}, beyond), std::invalid_argument);
}

SeparationSettings Levels() {
  SeparationSettings settings;
  settings.levels = {{"slow", 0.25, 0.1, 0.02}, {"fast", 1.5, 0.5, 0.4}};
  return settings;
}

TEST(ProtectiveDistance, AndTheWayToStopAreTheSumOfTheStandard) {
  SeparationSettings settings = Levels();
  settings.intrusion = 0.1;
  settings.uncertainty = 0.05;
  // 1.6 (0.3 + 0.5) + 0.15, and 1.5 * 0.3 + 0.4
  EXPECT_NEAR(ProtectiveDistance(settings, settings.levels[1], 0.2), 1.43, 1e-12);
  EXPECT_NEAR(WayToStop(settings, settings.levels[1], 0.2), 0.85, 1e-12);
}

TEST(ProtectiveDistance, PeopleReachFasterThanTheyWalkWhereTheyAreNear) {
  SeparationSettings settings = Levels();
  settings.reaction_time = 0.05;
  // 2.0 (0.1 + 0.1)
  EXPECT_NEAR(ProtectiveDistance(settings, settings.levels[0], 0.05), 0.4, 1e-12);
  // 2.0 * 0.26 is above 0.5; 1.6 * 0.26 is below.
  EXPECT_EQ(ProtectiveDistance(settings, settings.levels[0], 0.11), kNear);
}

TEST(ProtectiveDistance, NeverFallsAsAnImageGrowsOld) {
  const SeparationSettings settings = Levels();
  for (const SpeedLevel& level : settings.levels) {
    double before = 0;
    for (int i = 0; i < 1000; ++i) {
      const double distance = ProtectiveDistance(settings, level, i * 0.001);
      EXPECT_GE(distance, before);
      before = distance;
    }
  }
}

TEST(SeparationSettings, RefusesWhatCannotBe) {
  EXPECT_NO_THROW(RequireValid(Levels()));
  const auto refused = [](const auto& change) {
    SeparationSettings settings = Levels();
    change(settings);
    EXPECT_THROW(RequireValid(settings), std::invalid_argument);
  };
  refused([](SeparationSettings& s) { s.near_human_speed = 0.9 * s.human_speed; });
  refused([](SeparationSettings& s) { s.levels.clear(); });
  refused([](SeparationSettings& s) { s.levels[1].name = "slow"; });
  refused([](SeparationSettings& s) { s.levels[0].name.clear(); });
  refused([](SeparationSettings& s) { std::swap(s.levels[0], s.levels[1]); });
  refused([](SeparationSettings& s) { s.levels[0].speed = 0; });
  refused([](SeparationSettings& s) { s.levels[0].stopping_time = -1; });
  refused([](SeparationSettings& s) { s.human_speed = std::nan(""); });
  refused([](SeparationSettings& s) { s.uncertainty = -0.1; });
}

}  // namespace
}  // namespace silhouette
