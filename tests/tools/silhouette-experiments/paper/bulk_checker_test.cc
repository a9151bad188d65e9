// SPDX-License-Identifier: Apache-2.0
// The check of all configurations at once against the collision checker.
#include <gtest/gtest.h>

#include <bit>
#include <random>

#include "server/collision/collision_checker.h"
#include "tests/random.h"
#include "tests/tools/silhouette-experiments/paper/small_settings.h"
#include "tools/silhouette-experiments/paper/bulk_sound_checker.h"
#include "tools/silhouette-experiments/paper/sphere_cell.h"
#include "tools/silhouette-experiments/paper/study.h"

namespace silhouette::paper {
namespace {

const std::vector<Preset> kPresets = {Preset::kUncalibrated, Preset::kPaper, Preset::kCalibrated,
                                      Preset::kPaperCalibrated};

// What the collision checker needs to check with some of a cell's views.
class Views {
 public:
  Views(const SphereCell& cell, ViewSet views) : grid_(ArmGrid(cell.arms().steps())) {
    std::vector<ParallelCamera> cameras;
    for (int view = 0; view < cell.views(); ++view) {
      if ((views >> view & 1) == 0) continue;
      views_.push_back(view);
      cameras.push_back(cell.cameras()[static_cast<size_t>(view)]);
      sizes_.push_back(cameras.back().mask_size());
    }
    bands_.emplace(CalibrationOf(cameras), sizes_);
    RobotImageTable::Builder builder(grid_, sizes_);
    for (size_t i = 0; i < cell.arms().size(); ++i) {
      std::vector<Mask> masks;
      for (int view : views_) masks.push_back(cell.RobotImages(view)[i]);
      builder.Add(NumberOf(i), masks);
    }
    table_.emplace(std::move(builder).Build());
  }

  ConfigurationNumber NumberOf(size_t index) const {
    const int steps = grid_.joints()[0].steps;
    return grid_.NumberOf({static_cast<int>(index) / steps, static_cast<int>(index) % steps});
  }
  size_t IndexOf(ConfigurationNumber number) const {
    for (size_t index = 0;; ++index) {
      if (NumberOf(index) == number) return index;
    }
  }
  ObstacleImages Of(std::span<const ObstacleImage> images) const {
    ObstacleImages own;
    for (int view : views_) own.emplace_back(images[static_cast<size_t>(view)]);
    return own;
  }
  const RobotImageTable& table() const { return *table_; }
  const EpipolarBands& bands() const { return *bands_; }

 private:
  ConfigurationGrid grid_;
  std::vector<int> views_;
  std::vector<MaskSize> sizes_;
  std::optional<EpipolarBands> bands_;
  std::optional<RobotImageTable> table_;
};

class BulkCheckerTest : public testing::Test {
 protected:
  // Every verdict with every set of views, preset and threshold.
  void ExpectAgreement(const SphereCell& cell, std::span<const ObstacleImage> images,
                       const std::vector<std::array<double, 2>>* offsets) {
    BulkChecker bulk(cell.lines());
    bulk.Look(images, offsets == nullptr ? cell.OnGrid() : cell.InCells());
    for (ViewSet views = 1; views < ViewSet{1} << cell.views(); ++views) {
      const Views own(cell, views);
      const ObstacleImages own_images = own.Of(images);
      for (Preset preset : kPresets) {
        for (Threshold threshold : {Threshold::kAll, Threshold::kAllButOne}) {
          const int min_views = MinViewsOf(threshold, std::popcount(views));
          const CollisionChecker test(own.table(), own_images,
                                      {.preset = preset, .min_views = min_views},
                                      {.bands = &own.bands()});
          const ConfigurationSet occupied = bulk.Occupied(preset, views, min_views);
          for (size_t i = 0; i < cell.arms().size(); ++i) {
            const Verdict verdict = offsets == nullptr
                                        ? test.Check(own.NumberOf(i))
                                        : test.Check(cell.arms().JointsIn(i, (*offsets)[i]));
            ASSERT_NE(verdict.state(), State::kUnknown);
            ASSERT_EQ(Contains(occupied, i), verdict.state() == State::kOccupied)
                << NameOf(preset) << ", views " << views << ", min_views " << min_views
                << ", configuration " << i;
          }
        }
      }
    }
  }

  // The same of the sound presets, with cameras out of the set as missing views.
  void ExpectSoundAgreement(const SoundSpace& sound, std::span<const ObstacleImage> images,
                            const Spheres& robot,
                            const std::vector<std::array<double, 2>>* offsets) {
    const SphereCell& cell = sound.cell();
    const Views all(cell, (ViewSet{1} << cell.views()) - 1);
    const BodyDistance body = BodyOf(robot);
    for (ViewSet views = 1; views < ViewSet{1} << cell.views(); ++views) {
      ObstacleImages chosen(images.size());
      for (size_t view = 0; view < images.size(); ++view) {
        if ((views >> view & 1) != 0) chosen[view] = images[view];
      }
      const PossibleSpace possible(sound.space(), chosen, body);
      TestSupport support{.possible_space = &possible};
      if (offsets == nullptr) {
        support.robot_may_touch = [&](std::span<const double> from, std::span<const double>,
                                      const Eigen::AlignedBox3d& box) {
          const ConfigurationNumber number = all.table().grid().Nearest(from).value();
          const Spheres& there = cell.arms().At(all.IndexOf(number));
          for (size_t i = 0; i < there.size(); ++i) {
            if (there[i].centre == robot[i].centre) continue;
            const double distance = box.squaredExteriorDistance(there[i].centre);
            if (distance <= there[i].radius * there[i].radius) return true;
          }
          return false;
        };
      }
      const SoundVerdicts verdicts =
          CheckSound(sound, images, views, body, offsets == nullptr ? &robot : nullptr);
      for (Preset preset : {Preset::kSoundPlanes, Preset::kSound}) {
        const CollisionChecker test(all.table(), chosen, {.preset = preset}, support);
        const auto& occupied = preset == Preset::kSound ? verdicts.voxels : verdicts.planes;
        for (size_t i = 0; i < cell.arms().size(); ++i) {
          const Verdict verdict = offsets == nullptr
                                      ? test.Check(all.NumberOf(i))
                                      : test.Check(cell.arms().JointsIn(i, (*offsets)[i]));
          ASSERT_EQ(Contains(occupied, i), verdict.state() == State::kOccupied)
              << NameOf(preset) << ", views " << views << ", configuration " << i;
        }
      }
    }
  }

  Random random_;
};

TEST_F(BulkCheckerTest, IsTheSoundTestOnEveryConfigurationWithEverySetOfViews) {
  Settings settings = SmallSettings();
  settings.sound.edge = 0.025;
  for (const Variant variant : {Variant::kPlanar, Variant::kSpatial}) {
    const ArmTable arms(settings, variant);
    const SphereScene scene = RandomScene(settings, arms, static_cast<int>(random_() % 1000));
    const std::string rig = variant == Variant::kPlanar ? "A" : "B";
    const SphereCell cell(arms, settings.rigs.at(rig), Raster::kTouch);
    const SoundSpace sound(cell, settings.sound);
    const std::vector<ObstacleImage> images = cell.Look(scene.obstacles, scene.current);
    ExpectSoundAgreement(sound, images, arms.At(scene.current), nullptr);
    ExpectSoundAgreement(sound, images, arms.At(scene.current), &scene.offsets);
    ExpectSoundAgreement(sound, cell.LookOffGrid(scene.obstacles, scene.current_off_grid),
                         arms.AtJoints(scene.current_off_grid), nullptr);
  }
}

TEST_F(BulkCheckerTest, IsTheCollisionTestOnEveryConfigurationWithEverySetOfViews) {
  const Settings settings = SmallSettings();
  for (const Variant variant : {Variant::kPlanar, Variant::kSpatial}) {
    const ArmTable arms(settings, variant);
    const SphereScene scene = RandomScene(settings, arms, static_cast<int>(random_() % 1000));
    for (const auto& [name, rig] : settings.rigs) {
      const SphereCell cell(arms, rig, name == "A" ? Raster::kTouch : Raster::kCentre);
      const std::vector<ObstacleImage> images = cell.Look(scene.obstacles, scene.current);
      ExpectAgreement(cell, images, nullptr);
      ExpectAgreement(cell, images, &scene.offsets);
      ExpectAgreement(cell, cell.LookOffGrid(scene.obstacles, scene.current_off_grid), nullptr);
    }
  }
}

TEST_F(BulkCheckerTest, IsTheCollisionTestOnNoiseWithErrorPixels) {
  const Settings settings = SmallSettings(16, 8);
  const ArmTable arms(settings, Variant::kPlanar);
  const SphereCell cell(arms, settings.rigs.at("B"), Raster::kTouch);
  for (int repeat = 0; repeat < 5; ++repeat) {
    std::vector<ObstacleImage> images;
    for (int view = 0; view < cell.views(); ++view) {
      const unsigned obstacles = random_() % 30;
      const auto scene =
          Mask::FromPredicate({16, 16}, [&](int, int) { return random_() % 100 < obstacles; });
      images.push_back(ObstacleImage::FromScene(scene, cell.RobotImages(view)[random_() % 64]));
    }
    ExpectAgreement(cell, images, nullptr);
  }
}

TEST_F(BulkCheckerTest, ACollisionThatOneViewSeesIsNeverMissedWithTouchedPixels) {
  const Settings settings = SmallSettings(24, 24);
  std::uniform_real_distribution<double> uniform(-1, 1);
  int seen = 0;
  for (const Variant variant : {Variant::kPlanar, Variant::kSpatial}) {
    const ArmTable arms(settings, variant);
    const SphereCell cell(arms, settings.rigs.at("A"), Raster::kTouch);
    BulkChecker bulk(cell.lines());
    for (int repeat = 0; repeat < 5; ++repeat) {
      const SphereScene scene = RandomScene(settings, arms, static_cast<int>(random_() % 1000));
      const std::vector<ObstacleImage> images = cell.Look(scene.obstacles, scene.current);
      bulk.Look(images, cell.OnGrid());
      const ConfigurationSet occupied = bulk.Occupied(Preset::kCalibrated, 0b1111, 4);
      for (size_t i = 0; i < arms.size(); ++i) {
        for (const Sphere& part : arms.At(i)) {
          const Eigen::Vector3d p =
              part.centre +
              part.radius * Eigen::Vector3d(uniform(random_), uniform(random_), uniform(random_));
          if (!Touch(Spheres{{p, 0}}, Spheres{part}) || !Touch(Spheres{{p, 0}}, scene.obstacles))
            continue;
          // A point where the robot would touch an obstacle: is it seen as one?
          for (size_t view = 0; view < images.size(); ++view) {
            const Eigen::Vector2d at = cell.cameras()[view].Project(p);
            if (!images[view].obstacle().at(static_cast<int>(std::lround(at.x())),
                                            static_cast<int>(std::lround(at.y())))) {
              continue;
            }
            ++seen;
            EXPECT_TRUE(Contains(occupied, i));
          }
        }
      }
    }
  }
  EXPECT_GT(seen, 100);
}

TEST_F(BulkCheckerTest, CountsSetsThatHoldAConfiguration) {
  const ConfigurationSet a = {0b0111};
  const ConfigurationSet b = {0b0011};
  const ConfigurationSet c = {0b1001};
  const std::vector<ConfigurationWords> sets = {a, b, c};
  EXPECT_EQ(AtLeast(1, sets), ConfigurationSet{0b1111});
  EXPECT_EQ(AtLeast(2, sets), ConfigurationSet{0b0011});
  EXPECT_EQ(AtLeast(3, sets), ConfigurationSet{0b0001});
  EXPECT_EQ(SetsOf(2, 4).size(), 6u);
}

}  // namespace
}  // namespace silhouette::paper
