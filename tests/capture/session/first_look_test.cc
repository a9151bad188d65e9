// SPDX-License-Identifier: Apache-2.0
// A capture whose first images are not those of the robot ends before anything is stored.
#include "capture/session/first_look.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "calib/robot/parts.h"
#include "tests/calib/robot/urdf_files.h"
#include "tests/capture/session/fake_cell.h"

namespace silhouette {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

// The fake robot stays clear of the images' borders: it is cut only where `lift` is 0.
CaptureSettings Looking() {
  CaptureSettings settings = QuickSettings();
  settings.first_look = FirstLookSettings();
  settings.first_look.may_be_cut = true;
  settings.sentinels.count = 3;
  return settings;
}

class FirstLookTest : public testing::Test {
 protected:
  void ExpectRefused(const std::string& why) {
    const CaptureReport report = cell_.Capture();
    EXPECT_EQ(report.status.code(), absl::StatusCode::kFailedPrecondition) << report.status;
    EXPECT_THAT(std::string(report.status.message()), HasSubstr(why));
    EXPECT_EQ(report.captured, 0u);
    EXPECT_THAT(cell_.Content(), IsEmpty());
    EXPECT_GE(cell_.robot.stops, 1);
    EXPECT_LE(cell_.robot.moves.size(), 3u) << "at once";
  }

  FakeCell cell_{FakeDescription(), Looking()};
};

TEST_F(FirstLookTest, RobotThatIsSeenAndMovesIsCapturedAsWithoutIt) {
  cell_.TakeReferences();
  const CaptureReport report = cell_.Capture();
  ASSERT_TRUE(report.complete()) << report.status;
  FakeCell other;
  other.TakeReferences();
  ASSERT_TRUE(other.Capture().complete());
  EXPECT_EQ(cell_.Content(), other.Content());
}

TEST_F(FirstLookTest, RobotThatNoViewSeesEndsTheSession) {
  cell_.TakeReferences();
  cell_.rig.robot_present = false;
  ExpectRefused("no view sees the robot");
  cell_.rig.robot_present = true;
  EXPECT_TRUE(cell_.Capture().complete()) << "once it is mended, the same command goes on";
}

TEST_F(FirstLookTest, RobotThatTheBorderCutsEndsTheSessionUnlessItMay) {
  cell_.settings.first_look.may_be_cut = false;
  cell_.TakeReferences();
  ExpectRefused("the border of the image cuts the robot in ");
  cell_.settings.first_look.may_be_cut = true;
  EXPECT_TRUE(cell_.Capture().complete());
}

TEST_F(FirstLookTest, ImagesThatDoNotFollowTheRobotEndTheSession) {
  cell_.TakeReferences();
  std::vector<CameraImage> frozen;
  cell_.rig.on_grab = [&](size_t, std::vector<CameraImage>& images) {
    if (frozen.empty()) frozen = images;
    images = frozen;
    return absl::OkStatus();
  };
  ExpectRefused("as if the robot did not move");
}

TEST_F(FirstLookTest, RobotInTheReferenceImagesEndsTheSession) {
  // It stood apart from where it is now; there, the empty cell is foreground.
  cell_.rig.on_grab = [&](size_t, std::vector<CameraImage>& images) {
    for (CameraImage& image : images) {
      for (int y = 40; y < 55; ++y) {
        for (int x = 20; x < 30; ++x) image.pixels[static_cast<size_t>(y * image.width + x)] = 220;
      }
    }
    return absl::OkStatus();
  };
  cell_.TakeReferences();
  cell_.rig.on_grab = nullptr;
  ExpectRefused("is always foreground and apart from the robot that moves");
}

TEST(FirstLook, RobotInTheWrongPlaceIsFound) {
  const auto square = [](int left) {
    return Mask::FromPredicate(
        {64, 64}, [&](int x, int y) { return x >= left && x < left + 10 && y >= 20 && y < 40; });
  };
  FirstLook look(FirstLookSettings{}, {"front", "side"});
  EXPECT_EQ(look.Compare(7, {square(20), square(30)}, {square(20), square(30)}), "");
  EXPECT_EQ(look.Compare(7, {square(20), square(30)}, {square(22), square(28)}), "");
  const std::string fault = look.Compare(7, {square(20), square(30)}, {square(20), square(37)});
  EXPECT_THAT(fault, HasSubstr("configuration 7: 'side' shows the robot in the wrong place"));
  EXPECT_THAT(fault, HasSubstr("30 % is foreground, less than 75 %"));
  // More than the robot is no fault: shadows, cables.
  EXPECT_EQ(look.Compare(7, {square(20) | square(5), square(30)}, {square(20), square(30)}), "");
  // A view that does not see the robot says nothing.
  EXPECT_EQ(look.Compare(7, {Mask({64, 64}), square(30)}, {Mask({64, 64}), square(30)}), "");
}

TEST_F(FirstLookTest, RobotThatIsNotWhereItsModelSaysEndsTheSession) {
  cell_.TakeReferences();
  // A ball that the views see nowhere near the fake robot.
  const auto expect_at = [&](double x) {
    const auto joint = [](const std::string& name, const std::string& parent,
                          const std::string& child) {
      return absl::StrCat("<joint name='", name, "' type='revolute'><parent link='", parent,
                          "'/><child link='", child, "'/><limit lower='-1' upper='1' effort='1' ",
                          "velocity='1'/></joint><link name='", child, "'/>");
    };
    const auto model = RobotModel::FromUrdf(
        WriteFile(FreshFolder() / "r.urdf",
                  absl::StrCat("<robot name='r'><link name='a'><visual><origin xyz='", x,
                               " 0 2'/><geometry><sphere radius='0.2'/></geometry></visual></link>",
                               joint("turn", "a", "b"), joint("lift", "b", "c"),
                               joint("wrist", "c", "d"), "</robot>")));
    const CameraModel front(
        {.width = 80, .height = 60, .fx = 60, .fy = 60, .cx = 39.5, .cy = 29.5});
    const CameraModel top({.width = 64, .height = 64, .fx = 60, .fy = 60, .cx = 31.5, .cy = 31.5});
    return DrawnRobotOf(*model, {}, std::vector<std::string>{"turn", "lift", "wrist"}, {},
                        Calibration{{front, top}, {}}, std::vector<MaskSize>{{16, 16}, {20, 20}},
                        0);
  };
  const auto expected = expect_at(-1);
  ASSERT_TRUE(expected.ok()) << expected.status();
  const std::vector<Mask> masks = expected->Touched(std::vector<double>{0, 0, 0.25});
  ASSERT_THAT(masks, SizeIs(2));
  EXPECT_EQ(masks[0].size(), (MaskSize{16, 16}));
  EXPECT_FALSE(masks[0].Empty());
  cell_.expected = *expected;
  ExpectRefused("shows the robot in the wrong place");
  cell_.expected.reset();
  EXPECT_TRUE(cell_.Capture().complete());
}

TEST_F(FirstLookTest, SessionThatEndsBeforeItIsOverStoresNothingSaysSoAndTheNextLooksAgain) {
  cell_.TakeReferences();
  for (const bool device_fails : {false, true}) {
    uint64_t done = 0;
    std::string said;
    CaptureObserver observer;
    observer.progress = [&](uint64_t now) { done = now; };
    observer.say = [&](const std::string& line) { said += line + "\n"; };
    if (device_fails) {
      cell_.robot.on_move = [&](size_t) {
        return done < 2 ? absl::OkStatus() : absl::InternalError("a fuse blew");
      };
    } else {
      observer.stop_requested = [&] { return done >= 2; };
    }
    const CaptureReport report = cell_.Capture({}, observer);
    EXPECT_EQ(report.stopped, !device_fails);
    EXPECT_EQ(report.captured, 0u);
    EXPECT_THAT(cell_.Content(), IsEmpty());
    EXPECT_THAT(said, HasSubstr("the 2 captured until then are not stored"));
    cell_.robot.on_move = nullptr;
    cell_.robot.moves.clear();
  }
  cell_.settings.first_look.may_be_cut = false;
  ExpectRefused("the border of the image cuts the robot in ");
}

TEST_F(FirstLookTest, MoreThanTheSentinelsAreLookedAt) {
  cell_.settings.sentinels.count = 2;
  cell_.settings.first_look.configurations = 4;
  cell_.TakeReferences();
  cell_.rig.on_grab = [this](size_t grab, std::vector<CameraImage>&) {
    cell_.rig.robot_present = grab < 2;  // in the next image
    return absl::OkStatus();
  };
  ExpectRefused("no view sees the robot");
  const auto sentinels = [this] {
    return cell_.database->Read()->CaptureHistory()->sentinels_size();
  };
  EXPECT_EQ(sentinels(), 0);
  cell_.rig.on_grab = nullptr;
  cell_.rig.robot_present = true;
  EXPECT_TRUE(cell_.Capture().complete());
  EXPECT_EQ(sentinels(), 2);
}

TEST_F(FirstLookTest, RefusedImagesAreNotSaidToBeDroppedByAnEndThatCameTooSoon) {
  cell_.TakeReferences();
  std::string said;
  CaptureObserver observer;
  observer.say = [&](const std::string& line) { said += line + "\n"; };
  size_t visits = 0;
  cell_.rig.on_grab = [&](size_t, std::vector<CameraImage>&) {
    cell_.rig.robot_present = ++visits < 2;
    return absl::OkStatus();
  };
  EXPECT_EQ(cell_.Capture({}, observer).status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(cell_.Content(), IsEmpty());
  EXPECT_THAT(said, Not(HasSubstr("the session ended before")));
}

TEST_F(FirstLookTest, ResumedSessionIsNotLookedAtAgain) {
  cell_.TakeReferences();
  uint64_t done = 0;
  CaptureObserver observer;
  observer.progress = [&](uint64_t now) { done = now; };
  observer.stop_requested = [&] { return done >= 5; };
  EXPECT_TRUE(cell_.Capture({}, observer).stopped);
  EXPECT_THAT(cell_.Content(), SizeIs(5));
  cell_.settings.first_look.may_be_cut = false;  // it would be found now
  cell_.settings.sentinels.count = 0;
  EXPECT_TRUE(cell_.Capture().complete());
}

// By themselves, in views of 40 x 40: the first images see an arm of 6 x 20 that goes to the right.
class FirstLookAtMasksTest : public testing::Test {
 protected:
  static Mask Box(int x, int y, int width, int height) {
    return Mask::FromPredicate({40, 40}, [=](int px, int py) {
      return px >= x && px < x + width && py >= y && py < y + height;
    });
  }
  // What `sees(i)` shows in the second of `views` views, the others show the arm.
  static std::string Found(size_t views, const std::function<Mask(int)>& sees) {
    FirstLook look({}, std::vector<std::string>(views, "view"));
    for (int i = 0; i < 3; ++i) {
      std::vector<Mask> masks(views, Box(10 + 8 * i, 10, 6, 20));
      masks[1] = sees(i);
      EXPECT_EQ(look.Add(static_cast<ConfigurationNumber>(i), masks), "");
    }
    return look.Judge();
  }
};

TEST_F(FirstLookAtMasksTest, WhatStandsApartInHalfOfTheViewsThatSeeTheRobotIsFound) {
  const auto apart = [](int i) { return Box(10 + 8 * i, 10, 6, 20) | Box(2, 30, 5, 5); };
  EXPECT_THAT(Found(2, apart), HasSubstr("apart from the robot"));
  EXPECT_EQ(Found(3, apart), "") << "in one view, a dark part splits the robot's image";
  const auto flickers = [&](int i) { return apart(i) | Box(2 + i, 29, 1, 1); };
  EXPECT_THAT(Found(2, flickers), HasSubstr("apart from the robot")) << "rims change by a pixel";
}

TEST_F(FirstLookAtMasksTest, BaseThatTheArmJoinsIsTheRobot) {
  const auto base = [](int i) { return Box(10 + 8 * i, 10, 6, 20) | Box(2, 28, 36, 5); };
  EXPECT_EQ(Found(2, base), "");
}

TEST_F(FirstLookAtMasksTest, FixedPartOfTheModelThatStandsApartIsTheRobotAndNothingElseIs) {
  for (const bool of_the_model : {true, false}) {
    FirstLook look({}, {"front", "side"});
    for (int i = 0; i < 3; ++i) {
      const Mask arm = Box(10 + 8 * i, 10, 6, 20);
      const Mask seen = arm | Box(2, 30, 5, 5);
      const Mask expected = of_the_model ? arm | Box(3, 31, 3, 3) : arm;
      const auto number = static_cast<ConfigurationNumber>(i);
      EXPECT_EQ(look.Add(number, {seen, seen}), "");
      EXPECT_EQ(look.Compare(number, {seen, seen}, {expected, expected}), "");
    }
    if (of_the_model) {
      EXPECT_EQ(look.Judge(), "");
    } else {
      EXPECT_THAT(look.Judge(), HasSubstr("apart from the robot"));
    }
  }
}

TEST_F(FirstLookAtMasksTest, ViewThatNeverSeesTheRobotIsNoMotion) {
  FirstLook look({}, {"sees", "does not"});
  for (const ConfigurationNumber number : {1, 2}) {
    EXPECT_EQ(look.Add(number, {Box(10, 10, 6, 20), Box(static_cast<int>(number), 5, 1, 1)}), "");
  }
  EXPECT_THAT(look.Judge(), HasSubstr("as if the robot did not move"));
}

}  // namespace
}  // namespace silhouette
