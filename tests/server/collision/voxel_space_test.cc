// SPDX-License-Identifier: Apache-2.0
// What views can say of voxels: never less than is seen, never more than is certain.
#include "server/collision/voxel_space.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

#include "server/collision/voxel_grid.h"
#include "server/collision/voxel_look.h"
#include "tests/random.h"
#include "tests/server/collision/certain_pixels.h"
#include "tests/server/collision/sphere_world.h"

namespace silhouette {
namespace {

using testing::BallCamera;
using testing::LookingAt;
using testing::Vector2d;
using testing::Vector3d;

const Eigen::AlignedBox3d kBox(Vector3d(-0.5, -0.4, -0.3), Vector3d(0.5, 0.4, 0.3));

std::vector<BallCamera> SomeCameras() {
  return {BallCamera(LookingAt({1.5, 0.3, 0.9}, {0.1, 0, 0}, {48, 40}, 0.7, -0.2)),
          BallCamera(LookingAt({-0.4, 1.9, 0.5}, {0, 0, 0.1}, {32, 48}, 0.5)),
          BallCamera(Vector3d(-1, 0.4, -0.7), 40)};
}

std::vector<VoxelView> ViewsOf(const std::vector<BallCamera>& cameras, double margin = 0) {
  std::vector<VoxelView> views;
  for (const BallCamera& camera : cameras) {
    views.push_back({camera.size(), camera.project(), Vector2d::Constant(margin), Mask()});
  }
  return views;
}

Vector3d RandomIn(const Eigen::AlignedBox3d& box, std::mt19937_64& random) {
  std::uniform_real_distribution<double> share(0, 1);
  Vector3d point;
  for (int axis = 0; axis < 3; ++axis) {
    point[axis] = box.min()[axis] + share(random) * box.sizes()[axis];
  }
  return point;
}

Eigen::Vector3i RandomVoxel(const VoxelGrid& grid, std::mt19937_64& random) {
  Eigen::Vector3i voxel;
  for (int axis = 0; axis < 3; ++axis) {
    voxel[axis] = std::uniform_int_distribution<int>(0, grid.size(axis) - 1)(random);
  }
  return voxel;
}

TEST(VoxelSpace, EveryPointOfAVoxelIsSeenInItsPixels) {
  Random random;
  const std::vector<BallCamera> cameras = SomeCameras();
  for (double margin : {0.0, 0.4}) {
    const VoxelSpace space(kBox, 0.06, ViewsOf(cameras, margin));
    for (int i = 0; i < 20000; ++i) {
      const Eigen::Vector3i at = RandomVoxel(space.grid(), random);
      const Vector3d point = RandomIn(space.grid().Box(at.x(), at.y(), at.z()), random);
      for (int view = 0; view < space.views(); ++view) {
        const PixelRectangle pixels = space.Touched(view, at.x(), at.y(), at.z());
        const std::optional<Vector2d> image = cameras[static_cast<size_t>(view)].project()(point);
        ASSERT_TRUE(image.has_value());
        std::uniform_real_distribution<double> error(-margin, margin);
        const Vector2d appears = *image + Vector2d(error(random), error(random));
        const int x = static_cast<int>(std::floor(appears.x() + 0.5));
        const int y = static_cast<int>(std::floor(appears.y() + 0.5));
        const MaskSize size = space.mask_size(view);
        if (x < 0 || y < 0 || x >= size.width || y >= size.height) {
          EXPECT_FALSE(pixels.whole);
        } else {
          EXPECT_TRUE(x >= pixels.x && x < pixels.x + pixels.width && y >= pixels.y &&
                      y < pixels.y + pixels.height)
              << at.transpose() << " in view " << view;
        }
      }
    }
  }
}

TEST(VoxelSpace, EveryBallWithItsCentreInAVoxelTouchesTheCertainPixels) {
  Random random;
  const std::vector<BallCamera> cameras = SomeCameras();
  constexpr double kRho = 0.07;
  const VoxelSpace space(kBox, kRho, ViewsOf(cameras));
  int64_t certain = 0;
  for (int i = 0; i < 400; ++i) {
    const Eigen::Vector3i at = RandomVoxel(space.grid(), random);
    const Vector3d centre = RandomIn(space.grid().Box(at.x(), at.y(), at.z()), random);
    for (int view = 0; view < space.views(); ++view) {
      const Mask ball = cameras[static_cast<size_t>(view)].See(testing::Balls{{centre, kRho}});
      for (const auto& [x, y] : testing::CertainPixels(space, view, at.x(), at.y(), at.z())) {
        EXPECT_TRUE(ball.at(x, y)) << at.transpose() << " in view " << view;
        ++certain;
      }
    }
  }
  // Most of what a ball covers: its image has about 10 pixels.
  EXPECT_GT(certain, 400 * 3 * 3);
}

TEST(VoxelSpace, AMarginMakesMorePixelsTouchedAndFewerCertain) {
  const std::vector<BallCamera> cameras = SomeCameras();
  const VoxelSpace exact(kBox, 0.07, ViewsOf(cameras));
  const VoxelSpace careful(kBox, 0.07, ViewsOf(cameras, 0.5));
  const auto at = [](const VoxelSpace& space) {
    return std::pair(space.Touched(0, 30, 20, 16),
                     testing::CertainPixels(space, 0, 30, 20, 16).size());
  };
  const auto [touched, certain] = at(exact);
  const auto [touched_with_margin, certain_with_margin] = at(careful);
  EXPECT_GT(touched_with_margin.width * touched_with_margin.height, touched.width * touched.height);
  EXPECT_LT(certain_with_margin, certain);
  EXPECT_GT(certain, 0u);
}

TEST(VoxelLooker, RefusesMoreKindsOrShapesThanItsIndicesCanNumber) {
  const VoxelGrid grid(kBox, 0.05);
  const std::vector<VoxelView> views = ViewsOf({BallCamera(Vector3d(0, 0, -1), 1024)});
  const auto append_to = [&](size_t kinds, size_t shapes) {
    VoxelSpace::Look look;
    look.mask_size = views[0].mask_size;
    VoxelLooker looker(views[0], grid, 0.06, look);
    look.kinds.resize(kinds);
    look.shapes.resize(shapes);
    looker.Append({0, 0, 0});
  };
  EXPECT_NO_THROW(append_to(0, 1));
  EXPECT_THROW(append_to(4095, 1), std::invalid_argument);
  EXPECT_THROW(append_to(0, 4096), std::invalid_argument);
}

TEST(VoxelSpace, OnlyWhatTheRobotSweepsIsReached) {
  const std::vector<BallCamera> cameras = SomeCameras();
  std::vector<VoxelView> views = ViewsOf(cameras);
  const testing::Balls swept{{Vector3d(0.2, 0, 0), 0.1}};
  for (size_t view = 0; view < views.size(); ++view) views[view].swept = cameras[view].See(swept);
  const VoxelSpace space(kBox, 0.06, views);
  const VoxelGrid& grid = space.grid();
  int64_t far = 0;
  for (int z = 0; z < grid.size(2); ++z) {
    for (int y = 0; y < grid.size(1); ++y) {
      for (int x = 0; x < grid.size(0); ++x) {
        const double distance = testing::DistanceTo(swept, grid.Box(x, y, z).center());
        if (distance <= 0) {
          EXPECT_TRUE(space.reached().at(x, y, z));
        } else if (distance > 0.25 && space.reached().at(x, y, z)) {
          ++far;
        }
      }
    }
  }
  EXPECT_EQ(far, 0);
}

TEST(VoxelSpace, RefusesWhatCannotBe) {
  const std::vector<VoxelView> views = ViewsOf(SomeCameras());
  EXPECT_THROW(VoxelSpace(kBox, 0.06, {}), std::invalid_argument);
  EXPECT_THROW(VoxelSpace(kBox, 0, views), std::invalid_argument);
  EXPECT_THROW(VoxelSpace(kBox, 0.06, views, -0.01), std::invalid_argument);
  EXPECT_THROW(VoxelSpace(kBox, 0.06, views, 1e-6), std::invalid_argument);
  EXPECT_THROW(VoxelSpace(Eigen::AlignedBox3d(), 0.06, views), std::invalid_argument);
  std::vector<VoxelView> other = views;
  other[1].swept = Mask({8, 8});
  EXPECT_THROW(VoxelSpace(kBox, 0.06, other), std::invalid_argument);
}

VoxelSet RandomSet(const VoxelGrid& grid, int voxels, std::mt19937_64& random) {
  VoxelSet set(grid);
  for (int i = 0; i < voxels; ++i) {
    const Eigen::Vector3i at = RandomVoxel(grid, random);
    set.Insert(at.x(), at.y(), at.z());
  }
  return set;
}

TEST(MetByBalls, HoldsExactlyTheVoxelsThatSomeBallMeets) {
  Random random;
  const VoxelGrid grid({Vector3d(0, 0, 0), Vector3d(72, 16, 24)}, 1);
  for (double radius : {0.5, 2.0, 3.3}) {
    VoxelSet centres(grid);
    std::vector<Eigen::AlignedBox3d> boxes;
    for (int i = 0; i < 6; ++i) {
      const Eigen::Vector3i at = RandomVoxel(grid, random);
      centres.Insert(at.x(), at.y(), at.z());
      boxes.push_back(grid.Box(at.x(), at.y(), at.z()));
    }
    VoxelSet expected(grid);
    for (int i = 0; i < grid.voxels(); ++i) {
      const int x = i % 72, y = i / 72 % 16, z = i / 72 / 16;
      for (const Eigen::AlignedBox3d& box : boxes) {
        const double squared = grid.Box(x, y, z).squaredExteriorDistance(box);
        if (squared <= radius * radius) expected.Insert(x, y, z);
      }
    }
    EXPECT_TRUE(MetByBalls(centres, grid, radius) == expected) << radius;
  }
}

TEST(VoxelSets, OfAnotherGridTouchAllAndBlocksHoldAllOfThem) {
  std::mt19937 random(3);
  const VoxelGrid from({Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(8, 4, 3)}, 0.1);
  const VoxelGrid to({Eigen::Vector3d(-0.5, -0.3, 0.2), Eigen::Vector3d(8, 4, 3)}, 0.17);
  VoxelSet set(from);
  for (int i = 0; i < 60; ++i) {
    const int first = static_cast<int>(random() % 60);
    set.InsertRun(first, first + static_cast<int>(random() % 20), static_cast<int>(random() % 40),
                  static_cast<int>(random() % 24));
  }
  VoxelSet touched(to);
  AddTouched(set, from, to, touched);
  const std::vector<bool> blocks = BlocksWithVoxels(set);
  VoxelSet expected(to);
  std::vector<bool> with(static_cast<size_t>(from.blocks()));
  const OtherGrid other(from, to);
  for (int z = 0; z < from.size(2); ++z) {
    for (int y = 0; y < from.size(1); ++y) {
      for (int x = 0; x < from.size(0); ++x) {
        if (!set.at(x, y, z)) continue;
        with[static_cast<size_t>(from.BlockAt(x / 8, y / 8, z / 8))] = true;
        const auto [left, right] = other.Touched(0, x);
        const auto [front, back] = other.Touched(1, y);
        const auto [bottom, top] = other.Touched(2, z);
        for (int to_z = bottom; to_z <= top; ++to_z) {
          for (int to_y = front; to_y <= back; ++to_y) {
            for (int to_x = left; to_x <= right; ++to_x) expected.Insert(to_x, to_y, to_z);
          }
        }
      }
    }
  }
  EXPECT_EQ(touched, expected);
  EXPECT_EQ(blocks, with);
}

TEST(VoxelParts, HalvesAreAllOfAPart) {
  std::mt19937_64 random(11);
  const VoxelGrid grid({Vector3d(0, 0, 0), Vector3d(72, 16, 40)}, 1);
  const VoxelSet set = RandomSet(grid, 1500, random);
  std::vector<VoxelPart> parts = PartsOf(ConnectedParts(set, 5));
  EXPECT_EQ(parts.size(), 5u);
  for (size_t i = 0; i < 40; ++i) {
    const VoxelPart part = parts[i];
    if (part.Length() < 2) {
      parts.push_back(part);
      parts[i] = VoxelPart();
      continue;
    }
    const auto [lower, upper] = Halves(part);
    EXPECT_FALSE(lower.runs.empty());
    EXPECT_FALSE(upper.runs.empty());
    EXPECT_TRUE(lower.high[0] < upper.low[0] || lower.high[1] < upper.low[1] ||
                lower.high[2] < upper.low[2]);
    parts[i] = lower;
    parts.push_back(upper);
  }
  VoxelSet all(grid);
  int64_t voxels = 0;
  for (const VoxelPart& part : parts) {
    for (const VoxelRun& run : part.runs) {
      all.InsertRun(run.first, run.last, run.y, run.z);
      voxels += run.last - run.first + 1;
    }
  }
  EXPECT_TRUE(all == set);
  EXPECT_EQ(voxels, set.Count());
}

TEST(ConnectedParts, AreThoseOfAFloodFill) {
  Random random;
  const VoxelGrid grid({Vector3d(0, 0, 0), Vector3d(72, 16, 16)}, 1);
  const VoxelSet set = RandomSet(grid, 1500, random);
  std::vector<int> part(static_cast<size_t>(grid.voxels()), -1);
  const auto index = [](int x, int y, int z) { return static_cast<size_t>((z * 16 + y) * 72 + x); };
  int64_t voxels = 0;
  for (const VoxelRun& run : ConnectedParts(set, 1 << 30)) {
    for (int x = run.first; x <= run.last; ++x) {
      EXPECT_TRUE(set.at(x, run.y, run.z));
      part[index(x, run.y, run.z)] = run.part;
      ++voxels;
    }
  }
  EXPECT_EQ(voxels, set.Count());
  // By flood fill from every voxel that none has reached yet.
  std::vector<int> flooded(part.size(), -1);
  int parts = 0;
  std::vector<int> number_of;
  for (int i = 0; i < grid.voxels(); ++i) {
    const int x0 = i % 72, y0 = i / 72 % 16, z0 = i / 72 / 16;
    if (!set.at(x0, y0, z0) || flooded[index(x0, y0, z0)] >= 0) continue;
    std::vector<Eigen::Vector3i> left{{x0, y0, z0}};
    flooded[index(x0, y0, z0)] = parts;
    while (!left.empty()) {
      const Eigen::Vector3i at = left.back();
      left.pop_back();
      for (int n = 0; n < 27; ++n) {
        const Eigen::Vector3i next = at + Eigen::Vector3i(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
        if ((next.array() < 0).any() || next.x() >= 72 || next.y() >= 16 || next.z() >= 16)
          continue;
        int& seen = flooded[index(next.x(), next.y(), next.z())];
        if (!set.at(next.x(), next.y(), next.z()) || seen >= 0) continue;
        seen = parts;
        left.push_back(next);
      }
    }
    number_of.push_back(part[index(x0, y0, z0)]);
    ++parts;
  }
  for (size_t i = 0; i < part.size(); ++i) {
    if (part[i] >= 0) {
      EXPECT_EQ(part[i], number_of[static_cast<size_t>(flooded[i])]);
    }
  }
  std::sort(number_of.begin(), number_of.end());
  EXPECT_EQ(std::unique(number_of.begin(), number_of.end()), number_of.end());
  for (const VoxelRun& run : ConnectedParts(set, 3)) EXPECT_LT(run.part, 3);
}

}  // namespace
}  // namespace silhouette
