// SPDX-License-Identifier: Apache-2.0
#include "server/scene/make_scene.h"

#include <gmock/gmock.h>

#include <cmath>

#include "tests/server/test_cell.h"

namespace silhouette {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const Moment kMakeSceneNow{absl::FromUnixSeconds(1'000'000), absl::Seconds(50)};

absl::StatusOr<Scene> Make(const ServedDatabase& database, const SceneInput& input,
                           const SceneSettings& settings = {}) {
  return MakeScene(database, input, settings, {}, kMakeSceneNow);
}

std::vector<Reason> ReasonsOf(const Scene& scene) {
  std::vector<Reason> reasons;
  for (const SceneDefect& defect : scene.defects) reasons.push_back(defect.reason);
  return reasons;
}

struct MakeSceneTest : ::testing::Test {
  std::shared_ptr<const ServedDatabase> database = NewDatabase(
      {.missing = {{0, 7}}, .excluded = {{4, 7}}, .corrupt = {{2, 7}}, .references = true});
  SceneInput input = EmptyCellScene();

  // The one reason that the scene of `input` is defect for.
  Reason TheDefect(const SceneSettings& settings = {}) {
    const absl::StatusOr<Scene> scene = Make(*database, input, settings);
    EXPECT_TRUE(scene.ok()) << scene.status();
    EXPECT_EQ(scene->defects.size(), 1u);
    return scene->defects.empty() ? Reason::kNone : scene->defects[0].reason;
  }
  std::string Refusal() {
    const absl::StatusOr<Scene> scene = Make(*database, input);
    EXPECT_TRUE(absl::IsInvalidArgument(scene.status())) << scene.status();
    return std::string(scene.status().message());
  }
};

TEST_F(MakeSceneTest, OfAnEmptyCellHasOnlyUnknownPixelsAndNoDefects) {
  const absl::StatusOr<Scene> scene = Make(*database, input);
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_THAT(scene->defects, IsEmpty());
  EXPECT_EQ(scene->Blocked(), Reason::kNone);
  for (int view = 0; view < 3; ++view) {
    EXPECT_TRUE(scene->obstacle_images[view]->obstacle().Empty());
    EXPECT_TRUE(scene->obstacle_images[view]->error().Empty());
    EXPECT_EQ(scene->obstacle_images[view]->unknown(), RobotMask(view, 0, 0));
  }
  EXPECT_EQ(scene->generation, database->generation());
  EXPECT_EQ(scene->oldest.time, kMakeSceneNow.time);
}

TEST_F(MakeSceneTest, KeepsObstaclesApartFromTheRobot) {
  const absl::StatusOr<Scene> scene = Make(*database, SceneWithBlock(3));
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_EQ(scene->obstacle_images[1]->obstacle(), Block(1, 3));
  EXPECT_EQ(scene->views[1]->foreground, Block(1, 3) | RobotMask(1, 0, 0));
}

TEST_F(MakeSceneTest, FaintRimOfTheRobotIsUnknownIfItIsKnownToBeFaint) {
  const Mask robot = RobotMask(0, 0, 0);
  const Mask around = Grown(robot, 1) - robot;
  ASSERT_FALSE(around.Empty());
  bool found = false;
  const Mask rim = Mask::FromPredicate(robot.size(), [&](int x, int y) {
    const bool first = !found && around.at(x, y);
    found = found || first;
    return first;
  });
  const auto obstacle = [&](const std::optional<Mask>& strong, WeakRim weak_rim) {
    input.views[0].image = SceneMask{robot | rim, strong};
    const absl::StatusOr<Scene> scene = Make(*database, input, {.weak_rim = weak_rim});
    EXPECT_TRUE(scene.ok()) << scene.status();
    const ObstacleImage& image = *scene->obstacle_images[0];
    EXPECT_EQ(image.obstacle() | image.unknown(), robot | rim);
    return image.obstacle();
  };
  EXPECT_TRUE(obstacle(robot, WeakRim::kUnknown).Empty());
  EXPECT_EQ(obstacle(robot | rim, WeakRim::kUnknown), rim) << "plain";
  EXPECT_EQ(obstacle(std::nullopt, WeakRim::kUnknown), rim) << "a mask without evidence";
  EXPECT_EQ(obstacle(robot, WeakRim::kObstacle), rim) << "not wanted";
  input.views[0].image = SceneMask{robot, Mask({3, 3})};
  EXPECT_THAT(Refusal(), HasSubstr("the mask is 3x3"));
}

TEST_F(MakeSceneTest, StrongEvidenceBesideTheRobotCountsOnceItWasInTheImagesBefore) {
  const Mask robot = RobotMask(0, 0, 0);
  const auto pixel = [&](int x, int y) {
    return Mask::FromPredicate(robot.size(),
                               [=](int at_x, int at_y) { return at_x == x && at_y == y; });
  };
  // Two neighbours outside the robot that touch it.
  const Mask around = Grown(robot, 0.5) - robot;
  Mask rim;
  Mask beside;
  Mask two_away;
  for (int y = 0; y < robot.height(); ++y) {
    for (int x = 1; x + 2 < robot.width(); ++x) {
      if (!rim.Empty() || !around.at(x - 1, y) || !around.at(x, y) || robot.at(x + 2, y)) continue;
      rim = pixel(x, y);
      beside = pixel(x - 1, y);
      two_away = pixel(x + 2, y);
    }
  }
  ASSERT_FALSE(rim.Empty());
  const auto obstacle = [&](const std::vector<Mask>& before, const Mask& other = {}) {
    const Mask shown = other.Empty() ? robot | rim : robot | rim | other;
    input.views[0].image = SceneMask{.mask = shown, .strong = shown, .strong_before = before};
    const absl::StatusOr<Scene> scene = Make(*database, input);
    EXPECT_TRUE(scene.ok()) << scene.status();
    EXPECT_EQ(*scene->views[0]->strong & robot, robot);
    return scene->obstacle_images[0]->obstacle();
  };
  EXPECT_TRUE(obstacle({Mask(robot.size())}).Empty()) << "nothing was there";
  EXPECT_TRUE(obstacle({robot}).Empty()) << "the robot alone is no evidence of something beside it";
  EXPECT_EQ(obstacle({robot | rim}), rim);
  EXPECT_EQ(obstacle({beside}), rim) << "it moved by a pixel";
  EXPECT_EQ(obstacle({two_away}), rim) << "it moved by two";
  EXPECT_EQ(obstacle({two_away}, two_away), two_away)
      << "what stands there still is something else";
  EXPECT_EQ(obstacle({rim | two_away}, two_away), rim | two_away);
  EXPECT_TRUE(obstacle({pixel(robot.width() - 1, 0)}).Empty()) << "something else";
  EXPECT_EQ(obstacle({}), rim) << "a single image";

  const Mask nothing(robot.size());
  EXPECT_EQ(obstacle({robot | rim, robot | rim}), rim);
  EXPECT_TRUE(obstacle({robot | rim, robot}).Empty()) << "it came in the image before";
  EXPECT_TRUE(obstacle({robot, robot | rim}).Empty()) << "it was gone in the image before";
  EXPECT_EQ(obstacle({rim, two_away}), rim) << "it came from there";
  EXPECT_TRUE(obstacle({rim, rim, nothing}).Empty()) << "two of three";
  EXPECT_EQ(obstacle({rim, rim, rim}), rim);
  input.views[0].image =
      SceneMask{.mask = robot, .strong = robot, .strong_before = {robot, Mask({3, 3})}};
  EXPECT_THAT(Refusal(), HasSubstr("the mask is 3x3"));
}

TEST_F(MakeSceneTest, ThinPartsAreForegroundWhereTheRobotIsAndNowhereElse) {
  const Mask robot = RobotMask(0, 0, 0);
  input.views[0].image = SceneMask{.mask = Mask(robot.size()), .thin = ~Mask(robot.size())};
  const absl::StatusOr<Scene> scene = Make(*database, input);
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_THAT(scene->defects, IsEmpty());
  EXPECT_EQ(scene->views[0]->foreground, robot);
  EXPECT_EQ(scene->obstacle_images[0]->unknown(), robot);
  EXPECT_TRUE(scene->obstacle_images[0]->obstacle().Empty());
  input.views[0].image = SceneMask{.mask = robot, .thin = Mask({3, 3})};
  EXPECT_THAT(Refusal(), HasSubstr("the mask is 3x3"));
}

TEST_F(MakeSceneTest, TakesViewsInAnyOrder) {
  std::swap(input.views[0], input.views[2]);
  const absl::StatusOr<Scene> scene = Make(*database, input);
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_EQ(scene->views[2]->foreground, RobotMask(2, 0, 0));
}

TEST_F(MakeSceneTest, OfARobotBetweenGridPointsTakesTheUnionForUnknownTheIntersectionForError) {
  input.joints = JointsAt({0.5, At(0, 0)[1]});
  for (int view = 0; view < 3; ++view) input.views[view].image = SceneMask{Mask(kViewSizes[view])};
  const absl::StatusOr<Scene> scene = Make(*database, input);
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_EQ(scene->obstacle_images[0]->error(), RobotMask(0, 0, 0) & RobotMask(0, 1, 0));
  for (int view = 0; view < 3; ++view) input.views[view].image = SceneMask{~Mask(kViewSizes[view])};
  const absl::StatusOr<Scene> full = Make(*database, input);
  EXPECT_EQ(full->obstacle_images[0]->unknown(), RobotMask(0, 0, 0) | RobotMask(0, 1, 0));
}

TEST_F(MakeSceneTest, OfAReadyObstacleMaskLeavesTheRobotUnknown) {
  input.views[0].image = ObstacleMask{Block(0, 0) | Block(0, 2)};
  const absl::StatusOr<Scene> scene = Make(*database, input);
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_EQ(scene->obstacle_images[0]->obstacle(), Block(0, 0) | Block(0, 2));
  EXPECT_EQ(scene->obstacle_images[0]->unknown(), RobotMask(0, 0, 0) - Block(0, 0));
  EXPECT_TRUE(scene->obstacle_images[0]->error().Empty());
}

TEST_F(MakeSceneTest, DifferencesCameraImagesWithTheReference) {
  const Mask seen = RobotMask(0, 0, 0) | Block(0, 3);
  input.views[0].image = EncodedImage{PngOf(CameraPicture(0, seen))};
  // Without the clean-up, which rounds corners, the mask is what was painted.
  const absl::StatusOr<Scene> scene =
      MakeScene(*database, input, {}, {.clean_up_radius = 0}, kMakeSceneNow);
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_EQ(scene->views[0]->foreground, seen);
  EXPECT_EQ(scene->obstacle_images[0]->obstacle(), Block(0, 3));
}

TEST_F(MakeSceneTest, NeverTurnsACameraImageByItsOrientationTag) {
  // A JPEG whose EXIF data asks for a quarter turn: the sensor's pixels count.
  std::vector<uint8_t> jpeg;
  cv::imencode(".jpg", CameraPicture(0, RobotMask(0, 0, 0)), jpeg);
  const std::string exif(
      "\xff\xe1\x00\x22"
      "Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0",
      36);
  std::string bytes(jpeg.begin(), jpeg.end());
  bytes.insert(2, exif);
  input.views[0].image = EncodedImage{bytes};
  EXPECT_TRUE(Make(*database, input).ok());
}

// Every state of the cell that makes verdicts unsafe is a defect with its reason.

TEST_F(MakeSceneTest, WithoutAViewIsDefectButDoesNotBlock) {
  input.views.erase(input.views.begin());
  EXPECT_EQ(TheDefect(), Reason::kViewMissing);
  const absl::StatusOr<Scene> scene = Make(*database, input);
  EXPECT_EQ(scene->Blocked(), Reason::kNone);
  EXPECT_FALSE(scene->obstacle_images[0]);
  EXPECT_THAT(scene->defects[0].message, HasSubstr("'left'"));
}

TEST_F(MakeSceneTest, WithImagesFurtherApartThanMaxSkewIsDefect) {
  input.views[1].captured = MomentOf(kMakeSceneNow.time - absl::Milliseconds(51), kMakeSceneNow);
  EXPECT_EQ(TheDefect(), Reason::kSceneSkewed);
  input.views[1].captured = MomentOf(kMakeSceneNow.time - absl::Milliseconds(50), kMakeSceneNow);
  EXPECT_THAT(Make(*database, input)->defects, IsEmpty());
}

TEST_F(MakeSceneTest, WithoutTheRobotPositionIsDefect) {
  input.joints = {{"a", 0}, {"lift", 0.5}};
  EXPECT_EQ(TheDefect(), Reason::kRobotPositionUnknown);
  EXPECT_THAT(Make(*database, input)->defects[0].message, HasSubstr("'b'"));
  EXPECT_FALSE(Make(*database, input)->obstacle_images[0]);
}

TEST_F(MakeSceneTest, WithTheRobotOutsideTheGridIsDefect) {
  input.joints = JointsAt({4.2, 0});
  EXPECT_EQ(TheDefect(), Reason::kRobotPositionUnknown);
  EXPECT_THAT(Make(*database, input)->defects[0].message, ::testing::Not(HasSubstr("degrees")));
}

TEST_F(MakeSceneTest, RobotPositionThatSeemsToBeInDegreesIsAskedAbout) {
  input.joints = JointsAt({20, -1e-17});
  EXPECT_EQ(TheDefect(), Reason::kRobotPositionUnknown);
  EXPECT_EQ(
      Make(*database, input)->defects[0].message,
      "the robot is at (20, 0), outside the grid; move it back (joint values are radians; did "
      "you mean degrees? Write 90deg, or publish radians)");
}

TEST_F(MakeSceneTest, WithAFixedJointThatMovedIsDefect) {
  input.joints[2].position = 0.506;
  EXPECT_EQ(TheDefect(), Reason::kFixedJointMoved);
  input.joints[2].position = 0.494;
  EXPECT_EQ(TheDefect(), Reason::kFixedJointMoved);
  input.joints[2].position = 0.504;
  EXPECT_THAT(Make(*database, input)->defects, IsEmpty());
}

TEST_F(MakeSceneTest, WithAFixedJointThatWasNotToldIsDefect) {
  input.joints.pop_back();
  EXPECT_EQ(TheDefect(), Reason::kFixedJointMoved);
  EXPECT_THAT(Make(*database, input)->defects[0].message, HasSubstr("'lift' has no value"));
}

TEST_F(MakeSceneTest, WithoutAUsableRobotImageAtTheRobotPositionIsDefect) {
  for (int a : {0, 2, 4}) {  // missing, corrupt, excluded
    input.joints = JointsAt(At(a, 7));
    EXPECT_EQ(TheDefect(), Reason::kRobotImageOfSceneMissing) << a;
    input.joints = JointsAt({At(a, 7)[0] + (a == 4 ? -0.1 : 0.1), At(a, 7)[1]});
    EXPECT_EQ(TheDefect(), Reason::kRobotImageOfSceneMissing) << "next to " << a;
    EXPECT_FALSE(Make(*database, input)->obstacle_images[0]);
  }
}

TEST_F(MakeSceneTest, WithTooLargeAnAreaOfCoreErrorsIsDefect) {
  // The robot says it is at (0, 0), but the cameras see nothing there. Only the foot's row and two
  // columns of post are errors: at the image's rim, some of them have only errors around them.
  for (int view = 0; view < 3; ++view) input.views[view].image = SceneMask{Mask(kViewSizes[view])};
  const absl::StatusOr<Scene> scene = Make(*database, input, {.max_core_error = 0});
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_EQ(scene->views[0]->core_error_pixels, Core(RobotMask(0, 0, 0)).Count());
  ASSERT_GT(scene->views[0]->core_error_pixels, 0u);
  EXPECT_THAT(ReasonsOf(*scene),
              ElementsAre(Reason::kErrorArea, Reason::kErrorArea, Reason::kErrorArea));
  EXPECT_EQ(scene->Blocked(), Reason::kErrorArea);
  const double share = static_cast<double>(scene->views[0]->core_error_pixels) / (16 * 12);
  input.views[2].image = SceneMask{RobotMask(2, 0, 0)};
  EXPECT_THAT(Make(*database, input, {.max_core_error = share})->defects, IsEmpty());
}

TEST_F(MakeSceneTest, ViewsThatMissForOneReasonAreNamedTogether) {
  input.views.resize(1);
  input.without_views = {{"right", "the camera is frozen"}, {"top", "the camera is frozen"}};
  ASSERT_EQ(TheDefect(), Reason::kViewMissing);
  EXPECT_EQ(Make(*database, input)->defects[0].message,
            "views 'right', 'top' are missing and count as showing an obstacle; the camera is "
            "frozen");
  input.without_views["top"] = "its cable is pulled";
  EXPECT_THAT(ReasonsOf(*Make(*database, input)),
              ElementsAre(Reason::kViewMissing, Reason::kViewMissing));
}

TEST_F(MakeSceneTest, WithSeveralDefectsTellsThemAll) {
  input.joints.clear();
  input.views.pop_back();
  input.views[0].captured = MomentOf(kMakeSceneNow.time - absl::Seconds(1), kMakeSceneNow);
  const absl::StatusOr<Scene> scene = Make(*database, input);
  EXPECT_THAT(ReasonsOf(*scene),
              ElementsAre(Reason::kRobotPositionUnknown, Reason::kFixedJointMoved,
                          Reason::kSceneSkewed, Reason::kViewMissing));
}

// Input that says nothing of the cell is refused, naming the field.

TEST_F(MakeSceneTest, RefusesAnUnknownView) {
  input.views[1].view = "bottom";
  EXPECT_EQ(Refusal(),
            "views[1] 'bottom': the cell has no such view; its views are left, right, top");
}

TEST_F(MakeSceneTest, RefusesAViewGivenTwice) {
  input.views[2] = input.views[0];
  EXPECT_EQ(Refusal(), "views[2] 'left': the view is given twice");
}

// Else a mask that comes beside the image of a frozen camera would stand for it.
TEST_F(MakeSceneTest, RefusesAViewThatIsSaidToBeMissing) {
  input.without_views[input.views[0].view] = "the camera is frozen";
  EXPECT_EQ(Refusal(), "views[0] 'left': the view is given twice");
}

TEST_F(MakeSceneTest, RefusesNoViewAtAll) {
  input.views.clear();
  EXPECT_THAT(Refusal(), HasSubstr("at least one view"));
}

TEST_F(MakeSceneTest, RefusesMasksOfTheWrongSize) {
  input.views[0].image = SceneMask{Mask({12, 16})};
  EXPECT_EQ(Refusal(), "views[0] 'left': the mask is 12x16, and should be 16x12");
  input.views[0].image = ObstacleMask{Mask({16, 13})};
  EXPECT_EQ(Refusal(), "views[0] 'left': the mask is 16x13, and should be 16x12");
}

TEST_F(MakeSceneTest, RefusesCameraImagesThatCannotBeReadOrHaveTheWrongSize) {
  const std::string whole = PngOf(CameraPicture(0, Mask(kViewSizes[0])));
  std::vector<uint8_t> jpeg;
  cv::imencode(".jpg", CameraPicture(0, Mask(kViewSizes[0])), jpeg);
  const std::string half_jpeg(jpeg.begin(), jpeg.begin() + static_cast<int>(jpeg.size() / 2));
  for (const std::string& bytes : {std::string(), std::string("no image"), whole.substr(0, 40),
                                   whole.substr(0, whole.size() / 2), half_jpeg}) {
    input.views[0].image = EncodedImage{bytes};
    EXPECT_THAT(Refusal(), HasSubstr("cannot be decoded"));
  }
  input.views[0].image = EncodedImage{PngOf(CameraPicture(2, Mask(kViewSizes[2])))};
  EXPECT_EQ(Refusal(), "views[0] 'left': the camera image is 40x40, and its reference image 64x48");
}

TEST_F(MakeSceneTest, RefusesCameraImagesThatUseOnlyTheLowerOfSixteenBits) {
  cv::Mat picture;
  CameraPicture(0, Mask(kViewSizes[0])).convertTo(picture, CV_16U, 15);
  std::vector<uint8_t> png;
  cv::imencode(".png", picture, png);
  input.views[0].image = EncodedImage{{png.begin(), png.end()}};
  EXPECT_THAT(Refusal(),
              HasSubstr("views[0] 'left': the camera image uses the lower 12 of its 16"));
}

// Of images that a decoder completes: pixels of its own making may look like the empty cell.
TEST_F(MakeSceneTest, RefusesAJpegImageThatLacksItsMiddle) {
  std::vector<uint8_t> jpeg;
  cv::imencode(".jpg", CameraPicture(0, RobotMask(0, 0, 0)), jpeg);
  const std::string whole(jpeg.begin(), jpeg.end());
  input.views[0].image = EncodedImage{whole.substr(0, whole.size() / 2) + "\xff\xd9"};
  EXPECT_THAT(Refusal(), HasSubstr("cannot be decoded"));
  input.views[0].image = EncodedImage{whole.substr(0, whole.size() - 2) + "more\xff\xd9"};
  EXPECT_TRUE(Make(*database, input).ok()) << "bytes after the last pixel, as some cameras send";
}

TEST_F(MakeSceneTest, RefusesCameraImagesWithoutReferences) {
  const auto without = NewDatabase();
  input.views[0].image = EncodedImage{PngOf(CameraPicture(0, Mask(kViewSizes[0])))};
  const absl::StatusOr<Scene> scene = Make(*without, input);
  EXPECT_TRUE(absl::IsFailedPrecondition(scene.status())) << scene.status();
  EXPECT_THAT(scene.status().message(), HasSubstr("no reference images"));
}

TEST_F(MakeSceneTest, RefusesATimeInTheFutureByMoreThanTheTolerance) {
  input.views[0].captured =
      MomentOf(kMakeSceneNow.time + kClockTolerance + absl::Nanoseconds(1), kMakeSceneNow);
  EXPECT_THAT(Refusal(), HasSubstr("in the future"));
  for (ViewInput& view : input.views)
    view.captured = MomentOf(kMakeSceneNow.time + kClockTolerance, kMakeSceneNow);
  const absl::StatusOr<Scene> scene = Make(*database, input);
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_EQ(scene->AgeAt(kMakeSceneNow), absl::ZeroDuration()) << "no younger than its arrival";
}

TEST_F(MakeSceneTest, RefusesUnknownRepeatedAndInfiniteJoints) {
  input.joints[1].name = "c";
  EXPECT_EQ(Refusal(),
            "joints[1]: the cell has no joint 'c'; its joints are a, b, lift; leave out "
            "those that follow others (mimic)");
  input.joints[1].name = "a";
  EXPECT_EQ(Refusal(), "joints[1]: joint 'a' is given twice");
  input.joints[1] = {"b", std::nan("")};
  EXPECT_EQ(Refusal(), "joints[1]: the position of 'b' is not a finite number");
}

}  // namespace
}  // namespace silhouette
