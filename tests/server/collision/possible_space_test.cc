// SPDX-License-Identifier: Apache-2.0
// The space of possible obstacles against its definition, voxel by voxel, on random images.
#include "server/collision/possible_space.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>

#include "tests/random.h"
#include "tests/server/collision/certain_pixels.h"
#include "tests/server/collision/random_cell.h"
#include "tests/server/collision/sphere_world.h"

namespace silhouette {
namespace {

using testing::BallCamera;
using testing::LookingAt;
using testing::Vector2d;
using testing::Vector3d;

constexpr double kPossibleSpaceRho = 0.07;

VoxelSpace SomeSpace() {
  std::vector<VoxelView> views;
  for (const BallCamera& camera :
       {BallCamera(LookingAt({1.5, 0.3, 0.9}, {0.1, 0, 0}, {48, 40}, 0.6, -0.2)),
        BallCamera(LookingAt({-0.4, 1.9, 0.5}, {0, 0, 0.1}, {32, 70}, 0.5)),
        BallCamera(Vector3d(-1, 0.4, -0.7), 40)}) {
    views.push_back({camera.size(), camera.project(), Vector2d(0.1, 0.2), Mask()});
  }
  return VoxelSpace({Vector3d(-0.4, -0.4, -0.3), Vector3d(0.4, 0.4, 0.3)}, kPossibleSpaceRho,
                    views);
}

Mask RandomBlobs(MaskSize size, int blobs, std::mt19937_64& random) {
  Mask mask(size);
  for (int i = 0; i < blobs; ++i) {
    const int cx = std::uniform_int_distribution<int>(0, size.width - 1)(random);
    const int cy = std::uniform_int_distribution<int>(0, size.height - 1)(random);
    const int r = std::uniform_int_distribution<int>(0, 12)(random);
    mask = mask | Mask::FromPredicate(size, [=](int x, int y) {
             return (x - cx) * (x - cx) + (y - cy) * (y - cy) <= r * r;
           });
  }
  return mask;
}

// What a voxel touches of a mask.
bool Touches(const Mask& mask, const PixelRectangle& pixels) {
  for (int y = pixels.y; y < pixels.y + pixels.height; ++y) {
    for (int x = pixels.x; x < pixels.x + pixels.width; ++x) {
      if (mask.at(x, y)) return true;
    }
  }
  return false;
}

struct PossibleSpaceRandomScene {
  PossibleSpaceRandomScene(const VoxelSpace& space, std::mt19937_64& random, bool missing_view,
                           bool any_allowed) {
    for (int view = 0; view < space.views(); ++view) {
      const MaskSize size = space.mask_size(view);
      const Mask robot = RandomBlobs(size, 3, random);
      images.push_back(ObstacleImage::FromScene(RandomBlobs(size, 5, random), robot));
      if (any_allowed && view != 1) allowed.resize(images.size());
      if (any_allowed) allowed.push_back(RandomBlobs(size, 6, random));
      allowed.resize(any_allowed ? images.size() : 0);
    }
    if (missing_view) images[1] = std::nullopt;
    balls = {{Vector3d(0.1, 0.05, 0), std::uniform_real_distribution<double>(0, 0.2)(random)},
             {Vector3d(-0.1, 0.1, 0.1), std::uniform_real_distribution<double>(0, 0.1)(random)}};
  }
  BodyDistance body() const {
    return [this](const Vector3d& point) { return testing::DistanceTo(balls, point); };
  }
  ObstacleImages images;
  std::vector<std::optional<Mask>> allowed;
  testing::Balls balls;  // the robot
};

// The definition.
VoxelSet PossibleSpaceReference(const VoxelSpace& space, const PossibleSpaceRandomScene& scene,
                                int max_occluded_views) {
  const VoxelGrid& grid = space.grid();
  VoxelSet possible(grid), centres(grid), plain(grid), taken(grid);
  const BodyDistance body = scene.body();
  for (int z = 0; z < grid.size(2); ++z) {
    for (int y = 0; y < grid.size(1); ++y) {
      for (int x = 0; x < grid.size(0); ++x) {
        bool is_possible = !testing::WhollyBelow(body, grid.Box(x, y, z), 0);
        bool has_centre = !testing::WhollyBelow(body, grid.Box(x, y, z), kPossibleSpaceRho);
        bool is_taken = space.seen().at(x, y, z);
        int shown = 0, occluded = 0;
        for (int view = 0; view < space.views(); ++view) {
          const auto& image = scene.images[static_cast<size_t>(view)];
          const PixelRectangle pixels = space.Touched(view, x, y, z);
          if (!image) is_taken = false;
          if (!image || !pixels.whole) continue;
          const Mask something = ~image->Background();
          const Mask allowed = scene.allowed.empty() || !scene.allowed[static_cast<size_t>(view)]
                                   ? Mask(something.size())
                                   : *scene.allowed[static_cast<size_t>(view)];
          is_possible = is_possible && Touches(something, pixels);
          ++(Touches(image->obstacle(), pixels) ? shown : occluded);
          is_taken = is_taken && !Touches(something - allowed, pixels);
        }
        for (int view = 0; view < space.views(); ++view) {
          const auto& image = scene.images[static_cast<size_t>(view)];
          for (const auto& [px, py] : testing::CertainPixels(space, view, x, y, z)) {
            has_centre = has_centre && (!image || !image->Background().at(px, py));
          }
        }
        if (!is_possible) continue;
        possible.Insert(x, y, z);
        if (has_centre) centres.Insert(x, y, z);
        if (shown > 0 && occluded <= max_occluded_views) plain.Insert(x, y, z);
        if (is_taken && !scene.allowed.empty()) taken.Insert(x, y, z);
      }
    }
  }
  VoxelSet remaining = MetByBalls(centres, grid, kPossibleSpaceRho);
  for (size_t i = 0; i < remaining.words().size(); ++i) {
    remaining.words()[i] = ((remaining.words()[i] & possible.words()[i]) | plain.words()[i]) &
                           space.reached().words()[i] & ~taken.words()[i];
  }
  return remaining;
}

TEST(PossibleVoxels, HaveNoCentreWhoseBallsReachIntoTheBodyAndAllOthers) {
  Random random;
  const VoxelSpace space = SomeSpace();
  const VoxelGrid& grid = space.grid();
  std::uniform_real_distribution<double> place(-0.4, 0.4);
  std::uniform_real_distribution<double> radius(0.02, 0.25);
  const ObstacleImages nothing_seen(static_cast<size_t>(space.views()));
  int taken = 0;
  for (int i = 0; i < std::max(SampleCount(8), 4); ++i) {
    testing::Balls robot;
    for (int ball = 0; ball <= i % 3; ++ball) {
      robot.push_back({Vector3d(place(random), place(random), place(random)), radius(random)});
    }
    const auto body = [&](const Vector3d& point) { return testing::DistanceTo(robot, point); };
    const PossibleVoxels voxels(space, nothing_seen, body, {}, 1);
    for (int64_t v = 0; v < grid.voxels(); ++v) {
      const int x = static_cast<int>(v % grid.size(0));
      const int y = static_cast<int>(v / grid.size(0) % grid.size(1));
      const int z = static_cast<int>(v / grid.size(0) / grid.size(1));
      const bool looked_at = space.PlaceOf(x, y, z).has_value();
      const bool in_body = testing::WhollyBelow(body, grid.Box(x, y, z), kPossibleSpaceRho);
      ASSERT_EQ(voxels.centres.at(x, y, z), looked_at && !in_body);
      taken += looked_at && in_body ? 1 : 0;
    }
  }
  EXPECT_GT(taken, 0);
}

TEST(PossibleVoxels, LoseNothingToABodyWhoseDistanceIsNotKnown) {
  const VoxelSpace space = SomeSpace();
  const ObstacleImages nothing_seen(static_cast<size_t>(space.views()));
  const auto unknown = [](const Vector3d&) { return std::nan(""); };
  const PossibleVoxels voxels(space, nothing_seen, unknown, {}, 1);
  const PossibleVoxels without_body(space, nothing_seen, nullptr, {}, 1);
  EXPECT_GT(voxels.remaining.Count(), 0);
  EXPECT_TRUE(voxels.remaining == without_body.remaining);
  EXPECT_TRUE(voxels.centres == without_body.centres);
}

TEST(PossibleSpace, IsTheReferencesOnRandomImages) {
  Random random;
  const VoxelSpace space = SomeSpace();
  int64_t remaining = 0;
  for (int i = 0; i < std::max(SampleCount(8), 4); ++i) {
    const PossibleSpaceRandomScene scene(space, random, i % 4 == 3, i % 2 == 1);
    for (int may_occlude : {0, 1, 200}) {
      const PossibleSpace possible(space, scene.images, scene.body(), scene.allowed, may_occlude);
      EXPECT_TRUE(possible.remaining() == PossibleSpaceReference(space, scene, may_occlude))
          << "scene " << i;
      remaining += possible.remaining().Count();
    }
  }
  EXPECT_GT(remaining, 0);
}

// Whether a voxel meets a robot in all but `may_miss` views.
bool PossibleSpaceMeets(const PossibleSpace& possible, const ObstacleImages& images,
                        const std::vector<Mask>& robot, int x, int y, int z, int may_miss) {
  int missed = 0;
  for (size_t view = 0; view < robot.size(); ++view) {
    if (!images[view]) continue;
    const MaskSize size = robot[view].size();
    const PixelRectangle pixels = possible.space().Touched(static_cast<int>(view), x, y, z);
    const PixelRectangle top{0, 0, size.width, 1}, left{0, 0, 1, size.height};
    const PixelRectangle bottom{0, size.height - 1, size.width, 1};
    const PixelRectangle right{size.width - 1, 0, 1, size.height};
    const bool beyond = robot[view].Empty() || Touches(robot[view], top) ||
                        Touches(robot[view], left) || Touches(robot[view], bottom) ||
                        Touches(robot[view], right);
    const bool met =
        Touches(robot[view] - images[view]->Background(), pixels) || (!pixels.whole && beyond);
    if (!met) ++missed;
  }
  return missed <= may_miss;
}

TEST(PossibleSpace, AnswersForTestRobotsAsItsVoxelsDo) {
  Random random;
  const VoxelSpace space = SomeSpace();
  const VoxelGrid& grid = space.grid();
  int met = 0;
  int unmet = 0;
  for (int i = 0; i < 40; ++i) {
    const PossibleSpaceRandomScene scene(space, random, i % 8 == 7, false);
    const PossibleSpace possible(space, scene.images, scene.body());
    std::vector<Mask> robot;
    std::vector<MaskWords> words;
    for (int view = 0; view < space.views(); ++view) {
      robot.push_back(RandomBlobs(space.mask_size(view), i % 3, random));
    }
    for (const Mask& mask : robot) words.push_back(mask.words());
    for (int min_views : {3, 2}) {
      bool expected = false;
      for (int64_t v = 0; v < grid.voxels() && !expected; ++v) {
        const int x = static_cast<int>(v % grid.size(0));
        const int y = static_cast<int>(v / grid.size(0) % grid.size(1));
        const int z = static_cast<int>(v / grid.size(0) / grid.size(1));
        expected = possible.remaining().at(x, y, z) &&
                   PossibleSpaceMeets(possible, scene.images, robot, x, y, z, 3 - min_views);
      }
      EXPECT_EQ(possible.VoxelsMeet(words, min_views), expected) << "scene " << i;
      // Planes say at least what voxels say.
      if (expected) {
        EXPECT_TRUE(possible.PlanesMeet(words, min_views)) << "scene " << i;
      }
      ++(expected ? met : unmet);
    }
  }
  EXPECT_GT(met, 3);
  EXPECT_GT(unmet, 3);
}

// A camera that looks along an axis, and shows `pixels` per metre of the other two.
VoxelView LookingAlong(int axis, double pixels) {
  return {.mask_size = {32, 32}, .project = [=](const Vector3d& point) -> std::optional<Vector2d> {
            const Vector2d across(point[axis == 0 ? 1 : 0], point[axis == 2 ? 1 : 2]);
            return Vector2d(pixels * across.array() + 15.5);
          }};
}

// A bar along x pierces a ball that is beyond the first view's image and that the second one shows.
TEST(PossibleSpace, RobotThatLeavesAViewThroughIgnoredPixelsMeetsWhatIsBeyondIt) {
  const MaskSize size{32, 32};
  const Mask pillar = Mask::FromPredicate(size, [](int x, int) { return x >= 29; });
  // From x = 0 to 1.2; y and z between -0.1 and 0.1.
  const std::vector<Mask> bar = {
      Mask::FromPredicate(size, [](int x, int y) { return x >= 16 && y >= 12 && y < 20; }) - pillar,
      Mask::FromPredicate(size,
                          [](int x, int y) { return x >= 16 && x < 26 && y >= 15 && y < 17; })};
  std::vector<VoxelView> views = {LookingAlong(2, 32), LookingAlong(1, 8)};
  for (size_t view = 0; view < 2; ++view) views[view].swept = bar[view];
  views[0].ignored = pillar;
  const VoxelSpace space({Vector3d(-1.5, -0.4, -0.4), Vector3d(1.5, 0.4, 0.4)}, 0.12, views, 0.04);
  // Of a radius of 0.2 about (1, 0, 0).
  const Mask ball = Mask::FromPredicate(size, [](int x, int y) {
    return Vector2d(std::abs(x - 23.5) - 0.5, std::abs(y - 15.5) - 0.5).cwiseMax(0).norm() <= 1.6;
  });
  const ObstacleImages images = {ObstacleImage::FromScene(Mask(size), Mask(size)).Ignoring(pillar),
                                 ObstacleImage::FromScene(ball, Mask(size))};
  const PossibleSpace possible(space, images, nullptr);
  EXPECT_GT(possible.remaining().Count(), 0);
  const std::vector<MaskWords> robot = {bar[0].words(), bar[1].words()};
  EXPECT_TRUE(possible.PlanesMeet(robot, 2));
  EXPECT_TRUE(possible.VoxelsMeet(robot, 2));
}

TEST(PossibleSpace, RobotThatIsNeverSeenBesideIgnoredPixelsAtTheRimDoesNotLeaveTheImageThere) {
  const MaskSize size{32, 32};
  const auto leaves = [&](const Mask& ignored) {
    std::vector<VoxelView> views = {LookingAlong(2, 32), LookingAlong(1, 8)};
    const Mask middle = Mask::FromPredicate(
        size, [](int x, int y) { return std::abs(x - 16) < 3 && std::abs(y - 16) < 3; });
    for (VoxelView& view : views) view.swept = middle;
    views[0].ignored = ignored;
    const VoxelSpace space({Vector3d(-1.5, -0.4, -0.4), Vector3d(1.5, 0.4, 0.4)}, 0.12, views,
                           0.04);
    return space.look(0).leaves_unseen;
  };
  EXPECT_FALSE(leaves(Mask::FromPredicate(size, [](int x, int) { return x >= 20; })));
  EXPECT_TRUE(leaves(Mask::FromPredicate(size, [](int x, int) { return x >= 19; })));
  // A pillar before the robot, and a lamp at the rim.
  EXPECT_FALSE(leaves(Mask::FromPredicate(
      size, [](int x, int y) { return (x == 19 && y > 10 && y < 20) || (x > 28 && y < 3); })));
  EXPECT_FALSE(
      leaves(Mask::FromPredicate(size, [](int x, int y) { return x == 19 && y > 2 && y < 20; })));
}

TEST(PossibleSpace, RefusesWhatDoesNotFit) {
  const VoxelSpace space = SomeSpace();
  std::mt19937_64 random(1);
  const PossibleSpaceRandomScene scene(space, random, false, false);
  const std::vector<std::optional<Mask>> two(2);
  EXPECT_THROW(PossibleSpace(space, ObstacleImages(2), {}), std::invalid_argument);
  EXPECT_THROW(PossibleSpace(space, scene.images, {}, two), std::invalid_argument);
  EXPECT_THROW(PossibleSpace(space, scene.images, {}, {}, -1), std::invalid_argument);
  ObstacleImages other = scene.images;
  std::swap(other[0], other[1]);
  EXPECT_THROW(PossibleSpace(space, other, {}), std::invalid_argument);
}

}  // namespace
}  // namespace silhouette
