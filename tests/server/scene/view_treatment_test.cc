// SPDX-License-Identifier: Apache-2.0
// Safety margins and ignored pixels: what they promise, and when nothing may be free.
#include "server/scene/view_treatment.h"

#include <gmock/gmock.h>

#include <limits>
#include <random>
#include <stdexcept>

#include "server/scene/checker.h"
#include "tests/random.h"
#include "tests/server/test_cell.h"

namespace silhouette {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const Moment kViewTreatmentNow{absl::FromUnixSeconds(1'000'000), absl::Seconds(50)};
const std::vector<std::string> kNames = {"left"};
const std::vector<MaskSize> kSizes = {{64, 48}};

// A camera at the origin that looks along z, with images of ten times the mask's size.
Calibration OneCamera() {
  const CameraIntrinsics intrinsics{
      .width = 640, .height = 480, .fx = 600, .fy = 600, .cx = 319.5, .cy = 239.5};
  return {.cameras = {CameraModel(intrinsics)}, .fundamental_matrices = {}};
}

TreatmentSettings OneView(const Margin& margin, double nearest) {
  return {.views = {{.margin = margin, .ignored = std::nullopt}},
          .workspace = Eigen::AlignedBox3d(Eigen::Vector3d(-0.4, -0.4, nearest),
                                           Eigen::Vector3d(0.4, 0.4, nearest + 2))};
}

TEST(TreatmentsOf, NothingThatIsNearerToTheRobotThanTheMarginLooksFartherAway) {
  Random random;
  std::uniform_real_distribution<double> number(-1, 1);
  const Calibration calibration = OneCamera();
  const double metres = 0.2;
  const TreatmentSettings settings = OneView({.metres = metres}, 1);
  const ViewTreatments treatments = TreatmentsOf(settings, &calibration, kNames, kSizes);
  ASSERT_TRUE(treatments.margins_known.ok()) << treatments.margins_known;
  const double margin = treatments.views[0].margin;
  const CameraModel camera = calibration.cameras[0].ScaledTo(64, 48);
  double farthest = 0;
  for (int i = 0; i < 20000; ++i) {
    const Eigen::Vector3d robot = settings.workspace->center() +
                                  0.5 * settings.workspace->sizes().cwiseProduct(Eigen::Vector3d(
                                            number(random), number(random), number(random)));
    const Eigen::Vector3d obstacle =
        robot +
        metres * Eigen::Vector3d(number(random), number(random), number(random)).normalized();
    const auto a = camera.Project(robot), b = camera.Project(obstacle);
    if (!a || !b || !camera.Contains(*a) || !camera.Contains(*b)) continue;
    farthest = std::max(farthest, (*a - *b).norm());
  }
  EXPECT_GT(farthest, 0);
  EXPECT_LE(farthest, margin);
  EXPECT_LE(margin, 2 * farthest) << "and it is not out of all proportion";
}

TEST(TreatmentsOf, PixelsNeedNoCalibration) {
  const ViewTreatments treatments =
      TreatmentsOf(OneView({.pixels = 1.5}, 1), nullptr, kNames, kSizes);
  EXPECT_TRUE(treatments.margins_known.ok());
  EXPECT_EQ(treatments.views[0].margin, 1.5);
  EXPECT_EQ(TreatmentsOf({}, nullptr, kNames, kSizes).views[0].margin, 0);
}

TEST(TreatmentsOf, MetresWithoutCameraModelsAreNotKnown) {
  const Calibration matrices;
  for (const Calibration* calibration : {static_cast<const Calibration*>(nullptr), &matrices}) {
    const absl::Status known =
        TreatmentsOf(OneView({.metres = 0.05}, 1), calibration, kNames, kSizes).margins_known;
    EXPECT_TRUE(absl::IsFailedPrecondition(known)) << known;
    EXPECT_THAT(known.message(), AllOf(HasSubstr("view 'left'"), HasSubstr("0.05 m"),
                                       HasSubstr("silhouette-db calibration import")));
  }
}

TEST(TreatmentsOf, MetresWithACameraInReachOfTheRobotAreNotKnown) {
  const Calibration calibration = OneCamera();
  for (const double nearest : {-1.0, 0.04}) {
    const absl::Status known =
        TreatmentsOf(OneView({.metres = 0.05}, nearest), &calibration, kNames, kSizes)
            .margins_known;
    EXPECT_TRUE(absl::IsFailedPrecondition(known)) << known;
    EXPECT_THAT(known.message(), HasSubstr("workspace"));
  }
}

TEST(TreatmentsOf, SettingsThatCannotBeThrow) {
  const auto refused = [](const TreatmentSettings& settings) {
    EXPECT_THROW(TreatmentsOf(settings, nullptr, kNames, kSizes), std::invalid_argument);
  };
  refused(OneView({.pixels = -1}, 1));
  refused(OneView({.metres = -1}, 1));
  refused(OneView({.pixels = std::numeric_limits<double>::infinity()}, 1));
  refused(WithMargins({.pixels = 1}));  // three views
  TreatmentSettings settings = OneView({.metres = 1}, 1);
  settings.workspace.reset();
  refused(settings);
  settings = OneView({}, 1);
  settings.views[0].ignored = Mask({3, 3});
  refused(settings);
}

Checker CheckerOf(const std::shared_ptr<const ServedDatabase>& database, const SceneInput& input,
                  const Policy& policy = {}) {
  absl::StatusOr<Scene> scene = MakeScene(*database, input, {}, {}, kViewTreatmentNow);
  EXPECT_TRUE(scene.ok()) << scene.status();
  SceneStore store(database);
  EXPECT_TRUE(store.Publish(*std::move(scene), database).ok());
  return Checker(store.Newest(kViewTreatmentNow), policy, {}, kViewTreatmentNow);
}

TEST(Margin, TurnsANearMissOccupied) {
  const SceneInput input = SceneWithHighBlock(3);
  EXPECT_TRUE(CheckerOf(NewDatabase(), input).Check(At(2, 7)).free());
  const auto careful = NewDatabase({}, {}, WithMargins({.pixels = 0.5}));
  const Checker checker = CheckerOf(careful, input);
  EXPECT_EQ(checker.Check(At(2, 7)).state(), State::kOccupied);
  EXPECT_EQ(checker.Check(At(3, 7)).state(), State::kOccupied);
  EXPECT_TRUE(checker.Check(At(1, 7)).free()) << "two pixels away";
  // Grown are the obstacle planes, not what the cameras saw.
  EXPECT_EQ(checker.served().scene->views[0]->foreground, RobotMask(0, 0, 0) | HighBlock(0, 3));
}

TEST(Margin, DoesNotMakeRobotsOwnRimAnAlarm) {
  const auto careful = NewDatabase({}, {}, WithMargins({.pixels = 2}));
  const Checker checker = CheckerOf(careful, SceneWithBlock(3));
  EXPECT_EQ(checker.blocked(), Reason::kNone);
}

TEST(Margin, ThatIsNotKnownKeepsEveryVerdictFromBeingFree) {
  const auto database = NewDatabase({}, {}, WithMargins({.metres = 0.05}));
  EXPECT_FALSE(database->margins_known().ok());
  const Checker checker = CheckerOf(database, EmptyCellScene());
  for (int a = 0; a < 5; ++a) {
    for (int b = 0; b < 8; ++b) {
      EXPECT_EQ(checker.Check(At(a, b)).reason(), Reason::kMarginUnknown);
    }
  }
  for (const TileVerdicts& tile : CheckAllTiles(checker.served(), {})) {
    for (const uint64_t word : tile.free) EXPECT_EQ(word, 0u);
  }
}

TEST(IgnoredPixels, AreUnknownWhateverTheyShow) {
  const Mask ignored = Mask::FromPredicate(kViewSizes[0], [](int x, int) { return x >= 6; });
  const auto database = NewDatabase({}, {}, Ignoring(0, ignored));
  const Checker checker = CheckerOf(database, SceneWithBlock(3));  // columns 6 and 7
  const ObstacleImage& image = *checker.served().scene->obstacle_images[0];
  EXPECT_EQ(image.unknown(), RobotMask(0, 0, 0) | ignored);
  EXPECT_TRUE(image.obstacle().Empty());
  EXPECT_EQ(checker.served().scene->obstacle_images[1]->obstacle(), Block(1, 3));
}

TEST(IgnoredPixels, ProveNothing) {
  // "left" and "right" show a block, and "top", which would have to see it, does not.
  const SceneInput input = SceneWithBlock(3, 2);
  const TestDatabase test{.calibration = TestCalibration()};
  const Policy calibrated{.preset = Preset::kCalibrated};
  EXPECT_TRUE(CheckerOf(NewDatabase(test), input, calibrated).Check(At(3, 3)).free());
  const auto ignoring = NewDatabase(test, {.margin = 0}, Ignoring(2, Block(2, 3)));
  EXPECT_EQ(CheckerOf(ignoring, input, calibrated).Check(At(3, 3)).state(), State::kOccupied);
}

TEST(IgnoredPixels, ThatShowBackgroundWhereTheRobotIsAreNoAlarm) {
  SceneInput input = EmptyCellScene(2, 7);
  input.views[0].image = SceneMask{RobotMask(0, 4, 0) & RobotMask(0, 2, 0)};  // the foot alone
  EXPECT_TRUE(CheckerOf(NewDatabase(), EmptyCellScene(2, 7)).Check(At(0, 0)).free());
  const SceneSettings strict{.max_core_error = 0};
  const Mask wide = RobotMask(0, 2, 7);
  const auto scene =
      MakeScene(*NewDatabase({}, {}, Ignoring(0, wide)), input, strict, {}, kViewTreatmentNow);
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_TRUE(scene->obstacle_images[0]->error().Empty());
  EXPECT_EQ(scene->views[0]->core_error_pixels, 0u);
}

TEST(IgnoredPixels, HoldForObstacleMasksToo) {
  SceneInput input = SceneWithBlock(3);
  for (int view = 0; view < 3; ++view) input.views[view].image = ObstacleMask{Block(view, 3)};
  const auto database = NewDatabase({}, {}, Ignoring(0, Block(0, 3)));
  const Checker checker = CheckerOf(database, input);
  EXPECT_TRUE(checker.served().scene->obstacle_images[0]->obstacle().Empty());
}

}  // namespace
}  // namespace silhouette
