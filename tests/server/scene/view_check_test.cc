// SPDX-License-Identifier: Apache-2.0
#include "server/scene/view_check.h"

#include <gmock/gmock.h>

#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "server/scene/checker.h"
#include "tests/server/test_cell.h"

namespace silhouette {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr MaskSize kCheckedSize = {64, 48};
const std::vector<std::string> kCheckedNames = {"top", "left"};

Mask Columns(int from, int to) {
  return Mask::FromPredicate(kCheckedSize, [=](int x, int) { return x >= from && x < to; });
}

struct ViewCheckTest : ::testing::Test {
  ImageCondition condition{.structure = 1};
  Mask foreground = Columns(10, 14);
  RobotCover robot{Columns(10, 14), Columns(10, 14)};
  ViewCheckSettings settings;

  std::vector<SceneDefect> Check(const ViewToCheck& view) const {
    return CheckViews({&view, 1}, kCheckedNames, settings);
  }
  std::vector<SceneDefect> Defects() const {
    return Check(
        {.name = "top", .condition = &condition, .foreground = &foreground, .robot = &robot});
  }
  std::vector<Reason> Reasons() const {
    std::vector<Reason> reasons;
    for (const SceneDefect& defect : Defects()) {
      EXPECT_THAT(defect.message, HasSubstr("view 'top' "));
      reasons.push_back(defect.reason);
    }
    return reasons;
  }
};

TEST_F(ViewCheckTest, ViewAsItShouldBeHasNoDefect) { EXPECT_THAT(Defects(), IsEmpty()); }

TEST_F(ViewCheckTest, EveryFaultHasItsReason) {
  for (const double gain : {0.01, 0.5, 2.0}) {
    condition.gain = gain;
    EXPECT_THAT(Reasons(), ElementsAre(Reason::kLightChanged)) << gain;
  }
  condition = {.saturated = 0.9, .structure = 0};
  EXPECT_THAT(Reasons(), ElementsAre(Reason::kLightChanged));
  condition = {.structure = 0.05};
  EXPECT_THAT(Reasons(), ElementsAre(Reason::kViewCovered));
  condition = {.structure = 0.05, .other = 1};
  EXPECT_THAT(Reasons(), ElementsAre(Reason::kViewsSwapped));
  EXPECT_THAT(Defects()[0].message, HasSubstr("'left'"));
  condition = {.structure = 0.9, .shift = 2};
  EXPECT_THAT(Reasons(), ElementsAre(Reason::kCameraMoved));
  condition = {.structure = 1};
  foreground = Columns(0, 60);
  EXPECT_THAT(Reasons(), ElementsAre(Reason::kViewCovered));
  foreground = Columns(12, 16);
  EXPECT_THAT(Reasons(), ElementsAre(Reason::kRobotElsewhere));
}

TEST_F(ViewCheckTest, MasksAloneAreCheckedForForegroundAndRobot) {
  foreground = Columns(0, 60);
  EXPECT_EQ(Check({.name = "top", .foreground = &foreground}).size(), 1u);
  foreground = Mask(kCheckedSize);
  EXPECT_EQ(Check({.name = "top", .foreground = &foreground, .robot = &robot}).size(), 1u);
  EXPECT_THAT(Check({.name = "top"}), IsEmpty());
}

TEST_F(ViewCheckTest, RobotElsewhereIsFoundByTheOnlyCameraThatCanSeeIt) {
  foreground = Columns(12, 16);
  const ViewToCheck camera{.name = "top", .foreground = &foreground, .robot = &robot};
  const ViewToCheck sensor{.name = "left", .robot = &robot};
  const RobotCover outside{Mask(kCheckedSize), Mask(kCheckedSize)};
  const ViewToCheck blind{.name = "left", .foreground = &foreground, .robot = &outside};
  const std::vector<std::vector<ViewToCheck>> scenes = {
      {camera}, {sensor, camera}, {blind, camera}};
  for (const std::vector<ViewToCheck>& views : scenes) {
    const std::vector<SceneDefect> defects = CheckViews(views, kCheckedNames, settings);
    ASSERT_EQ(defects.size(), 1u);
    EXPECT_EQ(defects[0].reason, Reason::kRobotElsewhere);
    EXPECT_THAT(defects[0].message, HasSubstr("view 'top' "));
  }
}

TEST_F(ViewCheckTest, BaseOfTheRobotIsNoProofOfItsPlace) {
  robot = {Columns(10, 40), Columns(10, 40)};
  foreground = Columns(10, 39);
  EXPECT_THAT(Defects(), IsEmpty()) << "a thirtieth";
  const Mask base = Columns(10, 34);
  EXPECT_EQ(
      Check({.name = "top", .foreground = &foreground, .robot = &robot, .base = &base}).size(), 1u)
      << "a sixth";
}

TEST_F(ViewCheckTest, WhatHidesTheRobotInOneViewOrALittleInTwoMovesItNowhere) {
  // Of 192 pixels that should show the robot.
  const auto seen_but = [](int pixels) {
    return Mask::FromPredicate(
        kCheckedSize, [=](int x, int y) { return x >= 10 && x < 14 && (x > 10 || y >= pixels); });
  };
  const auto defects = [&](std::vector<int> missing) {
    std::vector<Mask> masks;
    for (const int pixels : missing) masks.push_back(seen_but(pixels));
    std::vector<ViewToCheck> views;
    for (const Mask& mask : masks) {
      views.push_back({.name = "top", .foreground = &mask, .robot = &robot});
    }
    return CheckViews(views, kCheckedNames, settings).size();
  };
  EXPECT_EQ(defects({0, 48}), 0u);
  EXPECT_EQ(defects({12, 12}), 2u) << "0.06";
  EXPECT_EQ(defects({48, 14, 2, 0}), 0u) << "0.08 but in one: someone as bright as the floor";
  EXPECT_EQ(defects({48, 24, 0, 0}), 2u) << "0.13";
  EXPECT_EQ(defects({9, 9, 0, 9}), 3u) << "a little, but in three";
}

// A robot that coarse masks show as thin: few pixels or none are certainly its own.
struct ThinRobotTest : ViewCheckTest {
  // How many defects views have that miss `missing` of `certain` pixels, and show `seen` of the 48
  // that the robot may cover.
  struct Seen {
    int certain;
    int missing;
    int seen;
  };
  size_t DefectsOf(const std::vector<Seen>& seen) const {
    const auto rows = [](int from, int to) {
      return Mask::FromPredicate(kCheckedSize,
                                 [=](int x, int y) { return x == 10 && y >= from && y < to; });
    };
    std::vector<Mask> foregrounds;
    std::vector<RobotCover> robots;
    for (const Seen& view : seen) {
      foregrounds.push_back(rows(view.missing, view.missing + view.seen));
      robots.push_back({rows(0, 48), rows(0, view.certain)});
    }
    std::vector<ViewToCheck> views;
    for (size_t view = 0; view < seen.size(); ++view) {
      views.push_back({.name = "top", .foreground = &foregrounds[view], .robot = &robots[view]});
    }
    return CheckViews(views, kCheckedNames, settings).size();
  }
};

TEST_F(ThinRobotTest, ThatViewsMissTogetherIsElsewhere) {
  EXPECT_EQ(DefectsOf({{10, 10, 20}, {10, 10, 20}, {6, 6, 20}, {3, 3, 20}}), 4u);
  EXPECT_EQ(DefectsOf({{10, 10, 20}, {10, 2, 20}, {6, 2, 20}, {3, 0, 20}}), 0u)
      << "much in one view only";
  EXPECT_EQ(DefectsOf({{10, 10, 20}, {10, 10, 20}, {3, 3, 20}}), 0u)
      << "of 13 pixels nothing follows";
}

TEST_F(ThinRobotTest, ThatNoViewOrOneAloneShowsIsElsewhere) {
  EXPECT_EQ(DefectsOf({{0, 0, 0}, {0, 0, 0}, {0, 0, 0}}), 3u);
  EXPECT_EQ(DefectsOf({{0, 0, 1}, {0, 0, 1}, {0, 0, 30}}), 2u) << "somebody stands there";
  EXPECT_EQ(DefectsOf({{0, 0, 0}, {0, 0, 10}, {0, 0, 10}}), 0u) << "as bright as the floor in one";
  EXPECT_EQ(DefectsOf({{0, 0, 0}, {0, 0, 30}}), 0u);
}

TEST_F(ViewCheckTest, IgnoredPixelsDoNotCount) {
  foreground = Mask(kCheckedSize);
  const Mask ignored = Columns(0, 30);
  EXPECT_THAT(Check({.name = "top",
                     .condition = &condition,
                     .foreground = &foreground,
                     .robot = &robot,
                     .ignored = &ignored}),
              IsEmpty());
}

// Scenes of camera images, and what may be done with them.
struct CheckedSceneTest : ::testing::Test {
  std::shared_ptr<const ServedDatabase> database = NewDatabase({.references = true});
  Moment now{absl::FromUnixSeconds(1'000'000), absl::Seconds(50)};

  // The cell with the robot at (0, 0), a picture changed.
  Scene SceneOf(const std::function<void(std::vector<cv::Mat>&)>& change) {
    std::vector<cv::Mat> pictures;
    for (int view = 0; view < 3; ++view)
      pictures.push_back(CameraPicture(view, RobotMask(view, 0, 0)));
    change(pictures);
    SceneInput input;
    input.joints = JointsAt(At(0, 0));
    for (size_t view = 0; view < 3; ++view) {
      input.views.push_back({kViewNames[view], std::nullopt, EncodedImage{PngOf(pictures[view])}});
    }
    auto scene = MakeScene(*database, input, {}, {}, now);
    EXPECT_TRUE(scene.ok()) << scene.status();
    return *std::move(scene);
  }
  int Free(Scene scene) {
    const Checker checker({.database = database,
                           .scene = std::make_shared<const Scene>(std::move(scene)),
                           .without_scene = Reason::kNone},
                          {}, {}, now);
    int free = 0;
    for (int a = 0; a < 5; ++a) {
      for (int b = 0; b < 8; ++b) free += checker.Check(At(a, b)).free() ? 1 : 0;
    }
    return free;
  }
};

TEST_F(CheckedSceneTest, ImagesAsTheyShouldBeAreFree) {
  const Scene scene = SceneOf([](auto&) {});
  EXPECT_THAT(scene.defects, IsEmpty());
  EXPECT_GT(Free(scene), 0);
}

TEST_F(CheckedSceneTest, NothingIsFreeInAViewThatIsNotAsItWas) {
  const std::vector<std::pair<Reason, std::function<void(cv::Mat&)>>> faults = {
      {Reason::kLightChanged, [](cv::Mat& image) { image *= 0.5; }},
      {Reason::kLightChanged, [](cv::Mat& image) { image *= 0.01; }},
      {Reason::kLightChanged, [](cv::Mat& image) { image.setTo(255); }},
      {Reason::kViewCovered, [](cv::Mat& image) { image.setTo(150); }},
  };
  for (const auto& [reason, fault] : faults) {
    const Scene scene = SceneOf([&](auto& pictures) { fault(pictures[1]); });
    EXPECT_EQ(scene.Blocked(), reason);
    EXPECT_EQ(Free(scene), 0);
    ASSERT_FALSE(scene.defects.empty());
    EXPECT_THAT(scene.defects[0].message, HasSubstr("'right'"));
  }
}

}  // namespace
}  // namespace silhouette
