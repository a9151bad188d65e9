// SPDX-License-Identifier: Apache-2.0
// What the simulated cameras see.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "capture/sim/contact.h"
#include "capture/sim/yaml_values.h"
#include "tests/capture/sim/small_cell.h"
#include "tests/random.h"

namespace silhouette {
namespace {

constexpr size_t kTop = 0;
constexpr size_t kFront = 1;

class SimulatedImage : public testing::Test {
 protected:
  static std::vector<CameraImage> Take(SimulatedCell& cell) {
    cell.SetFrame(0);
    return cell.TakeImages(std::vector<size_t>{kTop, kFront});
  }
  static int Differing(const CameraImage& a, const CameraImage& b) {
    int count = 0;
    for (size_t i = 0; i < a.pixels.size(); ++i) count += a.pixels[i] != b.pixels[i] ? 1 : 0;
    return count;
  }
};

TEST_F(SimulatedImage, RobotIsWhereTheCameraModelSaysIt) {
  Random random;
  SimulationSettings settings = SmallSimulation();
  settings.cameras[kTop] = {"top", CameraModel({.width = 160,
                                                .height = 120,
                                                .fx = 100,
                                                .fy = 110,
                                                .cx = 81,
                                                .cy = 58,
                                                .distortion = {-0.2, 0.05, 0.002, -0.001, 0.01}},
                                               settings.cameras[kTop].model.camera_from_world())};
  SimulatedCell cell(ThreeJointRobot(), settings);
  cell.SetRobotPresent(false);
  const auto empty = Take(cell);
  cell.SetRobotPresent(true);
  std::uniform_real_distribution<double> angle(-2, 2), slide(0, 0.3);
  for (int round = 0; round < 20; ++round) {
    const std::vector<double> positions{angle(random), angle(random), slide(random)};
    cell.SetPositions(positions);
    const auto images = Take(cell);
    const Poses poses = cell.robot().LinkPoses(positions);
    // The tool's ball is seen at its centre's pixel, in front of everything or behind the arm: the
    // pixel is the robot's in either case.
    for (const size_t view : {kTop, kFront}) {
      const auto pixel = settings.cameras[view].model.Project(poses[3].translation());
      ASSERT_TRUE(pixel.has_value());
      if (!settings.cameras[view].model.Contains(*pixel)) continue;
      EXPECT_GT(PixelAt(images[view], *pixel), PixelAt(empty[view], *pixel) + 20)
          << "view " << view << " at " << pixel->transpose();
    }
  }
}

TEST_F(SimulatedImage, WithoutTheRobotTheRoomIsEmpty) {
  SimulatedCell cell(ThreeJointRobot(), SmallSimulation());
  const auto with = Take(cell);
  cell.SetRobotPresent(false);
  const auto without = Take(cell);
  EXPECT_GT(Differing(with[kTop], without[kTop]), 80);
  EXPECT_GT(Differing(with[kFront], without[kFront]), 80);
  cell.SetRobotPresent(true);
  EXPECT_EQ(Take(cell)[kTop].pixels, with[kTop].pixels);
}

TEST_F(SimulatedImage, ObstacleHidesTheRobotBehindIt) {
  SimulatedCell cell(ThreeJointRobot(), SmallSimulation());
  cell.SetObstacles({BoxAt("screen", {0.1, 2.5, 2}, {1.5, 0, 1})});
  const auto before = Take(cell);
  cell.SetPositions(std::vector<double>{1, -1, 0.2});
  const auto after = Take(cell);
  EXPECT_EQ(before[kFront].pixels, after[kFront].pixels);
  EXPECT_NE(before[kTop].pixels, after[kTop].pixels);
}

TEST_F(SimulatedImage, RemovedObstacleLeavesNoTrace) {
  SimulatedCell cell(ThreeJointRobot(), SmallSimulation());
  const auto before = Take(cell);
  cell.SetObstacles({BoxAt("box", {0.3, 0.3, 0.3}, {0.5, 0.5, 0.5})});
  EXPECT_GT(Differing(Take(cell)[kTop], before[kTop]), 50);
  cell.SetObstacles({});
  EXPECT_EQ(Take(cell)[kTop].pixels, before[kTop].pixels);
}

TEST_F(SimulatedImage, ShadowFallsAwayFromTheLight) {
  const SimulationSettings settings = SmallSimulation();
  SimulatedCell cell(ThreeJointRobot(), settings);
  cell.SetRobotPresent(false);
  const auto empty = Take(cell);
  cell.SetObstacles({BoxAt("plate", {0.4, 0.4, 0.02}, {-1, 0, 1})});
  const auto shaded = Take(cell);
  // The light goes 0.2 m along x per metre down.
  const auto pixel = *settings.cameras[kTop].model.Project({-0.74, 0, 0});
  const auto outside = *settings.cameras[kTop].model.Project({-0.5, 0, 0});
  EXPECT_LT(PixelAt(shaded[kTop], pixel), PixelAt(empty[kTop], pixel) - 5);
  EXPECT_EQ(PixelAt(shaded[kTop], outside), PixelAt(empty[kTop], outside));
}

// Retracing only touched rectangles must not change a pixel: an obstacle far from the rest, whose
// rectangles cover the whole image, forces every pixel to be traced.
TEST_F(SimulatedImage, TracingEveryPixelGivesTheSameImage) {
  Random random;
  std::uniform_real_distribution<double> angle(-2, 2), slide(0, 0.3), place(-1, 1);
  const SimulationSettings settings = SmallSimulation();
  SimulatedCell cell(ThreeJointRobot(), settings);
  // Two specks joined into one body that reaches behind the cameras: it has no bounds in the image.
  Obstacle wide = BoxAt("specks", {1e-4, 1e-4, 1e-4}, {3.9, 3.9, 4.9});
  const TriangleMesh speck = wide.mesh;
  for (const Eigen::Vector3d& vertex : speck.vertices) {
    wide.mesh.vertices.push_back(vertex + Eigen::Vector3d(-7.8, -7.8, 0));
  }
  for (int round = 0; round < 10; ++round) {
    cell.SetPositions(std::vector<double>{angle(random), angle(random), slide(random)});
    const Obstacle box = BoxAt("box", {0.3, 0.2, 0.5}, {place(random), place(random), 0.5});
    cell.SetObstacles({box});
    const auto quick = Take(cell);
    cell.SetObstacles({box, wide});
    const auto full = Take(cell);
    EXPECT_EQ(quick[kTop].pixels, full[kTop].pixels);
    EXPECT_EQ(quick[kFront].pixels, full[kFront].pixels);
  }
}

TEST_F(SimulatedImage, NoiseIsThatOfSeedAndFrame) {
  SimulationSettings settings = SmallSimulation();
  settings.noise_sigma = 2;
  SimulatedCell cell(ThreeJointRobot(), settings);
  SimulatedCell twin(ThreeJointRobot(), settings);
  const std::vector<size_t> views{kTop, kFront};
  const auto first = cell.TakeImages(views);
  const auto second = cell.TakeImages(views);
  EXPECT_NE(first[kTop].pixels, second[kTop].pixels);
  EXPECT_EQ(twin.TakeImages(views)[kTop].pixels, first[kTop].pixels);
  EXPECT_EQ(twin.TakeImages(views)[kTop].pixels, second[kTop].pixels);
  settings.seed = 2;
  SimulatedCell other(ThreeJointRobot(), settings);
  EXPECT_NE(other.TakeImages(views)[kTop].pixels, first[kTop].pixels);
}

TEST_F(SimulatedImage, NoiseHasTheSigmaAskedFor) {
  SimulationSettings settings = SmallSimulation();
  settings.noise_sigma = 2;
  SimulatedCell cell(ThreeJointRobot(), settings);
  const std::vector<size_t> views{kFront};
  const auto a = cell.TakeImages(views)[0];
  const auto b = cell.TakeImages(views)[0];
  double sum = 0;
  double squares = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    const double difference = static_cast<double>(a.pixels[i]) - b.pixels[i];
    sum += difference;
    squares += difference * difference;
  }
  const auto count = static_cast<double>(a.pixels.size());
  EXPECT_NEAR(sum / count, 0, 0.1);
  // Two images, and each rounded to whole grey levels.
  EXPECT_NEAR(std::sqrt(squares / count), std::sqrt(2 * (4 + 1.0 / 12)), 0.1);
}

TEST_F(SimulatedImage, BrightnessDriftsWithTime) {
  SimulationSettings settings = SmallSimulation();
  settings.drift_amplitude = 0.2;
  settings.drift_period = 100;
  SimulatedCell cell(ThreeJointRobot(), settings);
  const auto mean = [&](double time) {
    cell.SetTime(time);
    double sum = 0;
    const auto images = Take(cell);
    for (uint8_t pixel : images[kTop].pixels) sum += pixel;
    return sum / static_cast<double>(images[kTop].pixels.size());
  };
  const double now = mean(0);
  EXPECT_NEAR(mean(25) / now, 1.2, 0.02);
  EXPECT_NEAR(mean(75) / now, 0.8, 0.02);
}

TEST_F(SimulatedImage, ColourHasTheGreyImagesLuminance) {
  SimulationSettings settings = SmallSimulation();
  settings.room.tint = TintOf({0.4, 0.5, 0.3});
  Obstacle box = BoxAt("box", {0.5, 0.5, 0.5}, {1, 0.6, 0.4});
  box.brightness = 0.3;
  box.tint = TintOf({0.5, 0.2, 0.1});
  for (const double blur : {0.0, 1.0}) {
    settings.blur = blur;
    settings.cameras[kTop].colour = false;
    SimulatedCell grey(ThreeJointRobot(), settings);
    settings.cameras[kTop].colour = true;
    SimulatedCell coloured(ThreeJointRobot(), settings);
    for (SimulatedCell* cell : {&grey, &coloured}) cell->SetObstacles({box});
    const CameraImage expected = Take(grey)[kTop];
    const CameraImage image = Take(coloured)[kTop];
    ASSERT_EQ(image.channels, 3);
    bool red = false;
    for (size_t i = 0; i < expected.pixels.size(); ++i) {
      const uint8_t* pixel = &image.pixels[3 * i];
      EXPECT_NEAR(0.114 * pixel[0] + 0.587 * pixel[1] + 0.299 * pixel[2], expected.pixels[i], 1.1);
      red |= pixel[2] > 2 * pixel[1];
    }
    EXPECT_TRUE(red) << "the box";
  }
}

TEST_F(SimulatedImage, TruthTellsWhatIsSeen) {
  SimulatedCell cell(ThreeJointRobot(), SmallSimulation());
  const std::vector<size_t> views{kTop, kFront};
  cell.SetRobotPresent(false);
  const auto empty = cell.TakeImages(views);
  for (const std::vector<Seen>& view : cell.TrueImages(views)) {
    EXPECT_EQ(static_cast<size_t>(std::count(view.begin(), view.end(), Seen::kRoom)), view.size());
  }
  cell.SetRobotPresent(true);
  cell.SetObstacles({BoxAt("box", {0.5, 0.5, 0.5}, {1, 0.6, 1})});
  const auto truth = cell.TrueImages(views);
  const auto images = cell.TakeImages(views);
  for (const size_t view : views) {
    for (const Seen seen : {Seen::kRobot, Seen::kObstacle}) {
      EXPECT_GT(std::count(truth[view].begin(), truth[view].end(), seen), 20) << "view " << view;
    }
    for (size_t i = 0; i < truth[view].size(); ++i) {
      const int change = images[view].pixels[i] - empty[view].pixels[i];
      if (truth[view][i] == Seen::kRoom) {
        EXPECT_EQ(change, 0);
      }
      if (truth[view][i] == Seen::kShadow) {
        EXPECT_LT(change, 0);
      }
    }
  }
  EXPECT_GT(std::count(truth[kTop].begin(), truth[kTop].end(), Seen::kShadow), 20);
}

TEST_F(SimulatedImage, ExposureSaturates) {
  SimulationSettings settings = SmallSimulation();
  settings.exposure = 20;
  SimulatedCell cell(ThreeJointRobot(), settings);
  const CameraImage image = Take(cell)[kTop];
  const auto white = std::count(image.pixels.begin(), image.pixels.end(), 255);
  EXPECT_GT(white, 0.8 * static_cast<double>(image.pixels.size()));
}

TEST_F(SimulatedImage, FlickerChangesImagesByChance) {
  SimulationSettings settings = SmallSimulation();
  settings.flicker_amplitude = 0.1;
  settings.flicker_slope = 0.1;
  SimulatedCell cell(ThreeJointRobot(), settings);
  SimulationSettings steady = SmallSimulation();
  SimulatedCell same(ThreeJointRobot(), steady);
  const std::vector<size_t> views{kTop, kFront};
  const CameraImage expected = same.TakeImages(views)[kTop];
  double least = 2;
  double most = 0;
  for (int i = 0; i < 20; ++i) {
    const CameraImage image = cell.TakeImages(views)[kTop];
    for (const size_t x : {size_t{0}, size_t{159}}) {
      const double ratio = static_cast<double>(image.pixels[x]) / expected.pixels[x];
      EXPECT_NEAR(ratio, 1, 0.2 + 0.02);
      least = std::min(least, ratio);
      most = std::max(most, ratio);
    }
  }
  EXPECT_LT(least, 0.95);
  EXPECT_GT(most, 1.05);
}

TEST_F(SimulatedImage, UnsteadyPixelsJumpAndTheOthersDoNot) {
  SimulationSettings settings = SmallSimulation();
  settings.unsteady_share = 0.02;
  SimulatedCell cell(ThreeJointRobot(), settings);
  SimulatedCell steady(ThreeJointRobot(), SmallSimulation());
  const std::vector<size_t> views{kTop};
  const CameraImage expected = steady.TakeImages(views)[0];
  std::vector<int> jumps(expected.pixels.size());
  for (int i = 0; i < 30; ++i) {
    const CameraImage image = cell.TakeImages(views)[0];
    for (size_t p = 0; p < jumps.size(); ++p) {
      jumps[p] += image.pixels[p] != expected.pixels[p] ? 1 : 0;
    }
  }
  const auto unsteady =
      jumps.size() - static_cast<size_t>(std::count(jumps.begin(), jumps.end(), 0));
  EXPECT_NEAR(static_cast<double>(unsteady) / static_cast<double>(jumps.size()), 0.02, 0.005);
  EXPECT_LT(*std::max_element(jumps.begin(), jumps.end()), 25);
}

}  // namespace
}  // namespace silhouette
