// SPDX-License-Identifier: Apache-2.0
// The loop with devices that fail: nothing is free, the reason is told, and it goes on.
#include <gmock/gmock.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <random>
#include <stdexcept>

#include "tests/server/live/live_cell.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

struct LiveFaultsTest : LiveCellTest {
  // A view that lacks: nothing is free, the reason names view and cause; then all is well again.
  void ViewIsMissingBecause(const std::string& cause) {
    const SharedScene scene = SceneWithDefect(Reason::kViewMissing, cause);
    EXPECT_THAT(DefectOf(*scene, Reason::kViewMissing)->message, HasSubstr("'right'"));
    EXPECT_FALSE(scene->views[1]);
    EXPECT_TRUE(scene->views[0]);
    EXPECT_EQ(FreeBy(scene), 0);
    const LiveStatus status = record->Status();
    EXPECT_GT(status.cameras[1].errors, 0u);
    EXPECT_THAT(status.cameras[1].last_error, HasSubstr(cause));
    EXPECT_EQ(status.cameras[0].errors, 0u);
  }
  void RobotIsNowhereBecause(const std::string& cause) {
    const SharedScene scene = SceneWithDefect(Reason::kRobotPositionUnknown, cause);
    EXPECT_EQ(scene->Blocked(), Reason::kRobotPositionUnknown);
    EXPECT_EQ(FreeBy(scene), 0);
  }
  void AllIsWellAgain() { EXPECT_GT(FreeBy(GoodScene()), 0); }
};

TEST_F(LiveFaultsTest, CameraThatFailsIsMissingAndNothingIsFree) {
  ASSERT_TRUE(Start().ok());
  AllIsWellAgain();
  Script([](LiveScript& to) { to.camera_errors[1] = absl::UnavailableError("cable pulled"); });
  ViewIsMissingBecause("cable pulled");
  Script([](LiveScript& to) { to.camera_errors[1] = absl::OkStatus(); });
  AllIsWellAgain();
}

// The camera gives the same pixels again and again, with the time of now.
void Freeze(LiveScript& to, int place) {
  to.change = [place, still = std::optional<CameraImage>()](
                  std::vector<absl::StatusOr<CameraImage>>& images) mutable {
    absl::StatusOr<CameraImage>& image = images[static_cast<size_t>(place)];
    if (!still) still = *image;
    image->pixels = still->pixels;
  };
}

TEST_F(LiveFaultsTest, FrozenCameraIsMissingAndNothingIsFree) {
  ASSERT_TRUE(Start().ok());
  AllIsWellAgain();
  Script([](LiveScript& to) { Freeze(to, 2); });
  ViewIsMissingBecause("the camera is frozen: it repeats an image byte for byte");
  Script([](LiveScript& to) { to.change = nullptr; });
  AllIsWellAgain();
}

TEST_F(LiveFaultsTest, CamerasThatFreezeTogetherReplaceTheLastSceneAtOnce) {
  ASSERT_TRUE(Start().ok());
  AllIsWellAgain();
  const uint64_t last = Newest()->id;
  Script([](LiveScript& to) {
    to.change = [still = std::vector<CameraImage>()](auto& images) mutable {
      if (still.empty()) {
        for (const auto& image : images) still.push_back(*image);
      }
      for (size_t i = 0; i < images.size(); ++i) images[i]->pixels = still[i].pixels;
    };
    to.blocks = {3, 3, 3};  // comes unseen
  });
  const SharedScene scene = NextScene("a scene without views", [](const Scene& made) {
    return std::ranges::none_of(made.views, &std::optional<SceneView>::has_value);
  });
  EXPECT_EQ(scene->Blocked(), Reason::kNone);
  EXPECT_EQ(FreeBy(scene), 0);
  EXPECT_EQ(FreeBy(nullptr), 0);
  ASSERT_EQ(scene->defects.size(), 1u);
  EXPECT_EQ(scene->defects[0].reason, Reason::kViewMissing);
  EXPECT_THAT(
      scene->defects[0].message,
      HasSubstr("views 'left', 'right', 'top' are missing and count as showing an obstacle; "
                "the camera is frozen"));
  EXPECT_GT(scene->id, last);
  Script([](LiveScript& to) { to.change = nullptr; });
  const SharedScene good = GoodScene();
  EXPECT_FALSE(CheckerNow(good).Check(At(3, 0)).free());
}

TEST_F(LiveFaultsTest, SourceWithoutNoiseMayRepeatItsImages) {
  config.without_noise = {"left", "right", "top"};
  Script([](LiveScript& to) { to.noise = false; });
  ASSERT_TRUE(Start().ok());
  const uint64_t first = GoodScene()->id;
  NextScene("more scenes", [&](const Scene& scene) { return scene.id >= first + 5; });
  EXPECT_GT(FreeBy(GoodScene()), 0);
}

// A robot wide enough for its motion to be seen: in the upper rows, at the left for a below 2, else
// at the right.
constexpr char kWide[] = "wide";
Mask WideRobot(int view, int a) {
  const MaskSize size = kViewSizes[static_cast<size_t>(view)];
  return Mask::FromPredicate(
      size, [=](int x, int y) { return y < 8 && (a < 2 ? x < 4 : x >= size.width - 4); });
}

// `shift`: its robot images are those of another a.
std::shared_ptr<const ServedDatabase> WithWideRobot(int shift = 0) {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabase(folder / "db", {.references = true});
  {
    const auto database = Database::Open(folder / "db", Database::Access::kWrite);
    const auto variant = (*database)->CreateVariant(kWide, "test");
    auto writer = (*variant)->Write("test");
    for (int a = 0; a < 5; ++a) {
      for (int b = 0; b < 8; ++b) {
        RobotImage image = TestRobotImage((*variant)->grid(), a, b);
        for (int view = 0; view < 3; ++view) {
          image.masks[static_cast<size_t>(view)] = WideRobot(view, (a + shift) % 5);
        }
        EXPECT_TRUE(writer->Put(image).ok());
      }
    }
    EXPECT_TRUE(writer->Commit().ok());
  }
  return LoadDatabase(folder / "db");
}

struct WideRobotTest : LiveFaultsTest {
  // What the cameras show: by camera, where the robot is.
  std::shared_ptr<std::vector<int>> shown = std::make_shared<std::vector<int>>(3, 0);

  void SetUp() override {
    scenes.ReplaceDatabase(WithWideRobot());
    config.live.variant = kWide;
    Script([&](LiveScript& to) {
      to.change = [shown = shown, &to](auto& images) {
        const int views[] = {2, 0, 1};
        for (size_t i = 0; i < images.size(); ++i) {
          const cv::Mat picture = CameraPicture(views[i], WideRobot(views[i], (*shown)[i]));
          images[i]->pixels.assign(picture.datastart, picture.dataend);
          std::minstd_rand random(static_cast<unsigned>(to.grabs));
          for (uint8_t& level : images[i]->pixels) level += random() >> 8 & 1;
        }
      };
    });
    ASSERT_TRUE(Start().ok());
    GoodScene();
  }
};

TEST_F(WideRobotTest, CameraThatDoesNotSeeTheRobotMoveIsMissingUntilItDoes) {
  Script([&](LiveScript& to) {
    to.joints[2] = At(4, 0)[0];
    *shown = {4, 4, 0};
  });
  ViewIsMissingBecause("the robot did not move as its driver reports");
  for (uint64_t id = Newest()->id; id > 0; --id) {
    const SharedScene scene = scenes.Find(id);
    if (scene == nullptr || scene->joints.empty() || scene->joints[0].position == 0) break;
    EXPECT_FALSE(scene->views[1]) << "from the first scene on";
  }
  Script([&](LiveScript&) { *shown = {4, 4, 4}; });
  GoodScene();
}

TEST_F(WideRobotTest, OtherRobotImagesAreNoMotion) {
  scenes.ReplaceDatabase(WithWideRobot(4));
  const SharedScene scene = NextScene("a scene with them", [](const Scene&) { return true; });
  EXPECT_EQ(DefectOf(*scene, Reason::kViewMissing), nullptr);
}

TEST_F(LiveFaultsTest, ImageOfTheFutureIsMissing) {
  Script([](LiveScript& to) { to.stamps[1] = absl::Hours(1); });
  ASSERT_TRUE(Start().ok());
  ViewIsMissingBecause("in the future");
  Script([](LiveScript& to) { to.stamps[1] = absl::ZeroDuration(); });
  AllIsWellAgain();
}

TEST_F(LiveFaultsTest, ImageThatComesTooLateIsMissing) {
  Script([](LiveScript& to) { to.stamps[1] = -absl::Hours(1); });
  ASSERT_TRUE(Start().ok());
  ViewIsMissingBecause("longer than max_age");
}

TEST_F(LiveFaultsTest, ImagesOutOfOrderAreMissing) {
  ASSERT_TRUE(Start().ok());
  AllIsWellAgain();
  Script([](LiveScript& to) { to.stamps[1] = -absl::Seconds(2); });
  ViewIsMissingBecause("before one that came earlier");
}

TEST_F(LiveFaultsTest, ImageOfAnotherSizeIsMissing) {
  Script([](LiveScript& to) {
    to.change = [](std::vector<absl::StatusOr<CameraImage>>& images) { images[2]->width = 7; };
  });
  ASSERT_TRUE(Start().ok());
  ViewIsMissingBecause("7 x 48 pixels; the cell says 64 x 48: set the camera to that size");
}

TEST_F(LiveFaultsTest, ImagesTooFarApartAreNeverFree) {
  Script([](LiveScript& to) { to.stamps[1] = -absl::Seconds(1); });
  ASSERT_TRUE(Start().ok());
  const SharedScene scene =
      NextScene("a scene that is no good for its skew",
                [](const Scene& made) { return made.Blocked() == Reason::kSceneSkewed; });
  EXPECT_EQ(FreeBy(scene), 0);
}

TEST_F(LiveFaultsTest, WhenNoCameraDeliversTheLastSceneBecomesTooOld) {
  config.scene.max_age = absl::Milliseconds(300);
  ASSERT_TRUE(Start().ok());
  NextScene("a scene", [](const Scene&) { return true; });
  Script([](LiveScript& to) {
    to.camera_errors = {3, absl::UnavailableError("the switch is off")};
  });
  WaitUntil([&] { return CheckerNow(nullptr).blocked() == Reason::kSceneStale; }, "a stale scene");
  EXPECT_EQ(FreeBy(nullptr), 0);
  WaitUntil([&] { return !record->Status().serving; }, "not serving");
  EXPECT_THAT(record->Status().fault, HasSubstr("the switch is off"));
  EXPECT_GT(record->Status().lost_sets, 0u);
  Script([](LiveScript& to) { to.camera_errors = {3, absl::OkStatus()}; });
  WaitUntil([&] { return CheckerNow(nullptr).blocked() == Reason::kNone; }, "scenes again");
}

TEST_F(LiveFaultsTest, CamerasThatThrowOrGiveTooFewImagesEndNothing) {
  ASSERT_TRUE(Start().ok());
  AllIsWellAgain();
  Script([](LiveScript& to) {
    to.change = [](auto&) { throw std::runtime_error("the driver has a fault"); };
  });
  WaitUntil([&] { return !record->Status().fault.empty(); }, "a fault");
  EXPECT_THAT(record->Status().fault, HasSubstr("the driver has a fault"));
  Script([](LiveScript& to) { to.change = [](auto& images) { images.pop_back(); }; });
  WaitUntil([&] { return record->Status().fault.find("for 3 views") != std::string::npos; },
            "another fault");
  Script([](LiveScript& to) { to.change = nullptr; });
  WaitUntil([&] { return record->Status().fault.empty(); }, "no fault");
  AllIsWellAgain();
}

TEST_F(LiveFaultsTest, RobotThatMovesIsNowhere) {
  Script([](LiveScript& to) { to.joint_drift = 0.02; });
  ASSERT_TRUE(Start().ok());
  RobotIsNowhereBecause("max_joint_movement");
  EXPECT_TRUE(record->Status().robot.serving) << "it tells its joints";
  Script([](LiveScript& to) {
    to.joint_drift = 0;
    to.joints[2] = At(0, 0)[0];
  });
  AllIsWellAgain();
}

TEST_F(LiveFaultsTest, RobotWhoseJointsAreOldIsNowhere) {
  config.live.joints_gap = absl::Milliseconds(200);
  ASSERT_TRUE(Start().ok());
  AllIsWellAgain();
  Script([](LiveScript& to) { to.joints_late = absl::Milliseconds(800); });
  RobotIsNowhereBecause("did not report its joints");
  Script([](LiveScript& to) { to.joints_late = absl::ZeroDuration(); });
  AllIsWellAgain();
}

TEST_F(LiveFaultsTest, RobotThatIsLostIsNowhere) {
  ASSERT_TRUE(Start().ok());
  AllIsWellAgain();
  Script([](LiveScript& to) { to.robot_error = absl::UnavailableError("controller is off"); });
  RobotIsNowhereBecause("controller is off");
  Script([](LiveScript& to) { to.robot_error = absl::OkStatus(); });
  AllIsWellAgain();
}

TEST_F(LiveFaultsTest, RobotOutsideTheGridAndFixedJointThatMovedAreNeverFree) {
  Script([](LiveScript& to) { to.joints[2] = 4.5; });
  ASSERT_TRUE(Start().ok());
  RobotIsNowhereBecause("outside the grid");
  Script([](LiveScript& to) { to.joints = {0.6, At(0, 0)[1], At(0, 0)[0]}; });
  EXPECT_EQ(FreeBy(SceneWithDefect(Reason::kFixedJointMoved)), 0);
}

TEST_F(LiveFaultsTest, DevicesThatCannotBeReachedAtTheStartAreOpenedLater) {
  Script([](LiveScript& to) {
    to.open_cameras = absl::UnavailableError("no camera answers");
    to.open_robot = absl::DeadlineExceededError("the robot does not answer");
  });
  ASSERT_TRUE(Start().ok());
  EXPECT_FALSE(record->Status().serving);
  EXPECT_EQ(Newest(), nullptr);
  Script([](LiveScript& to) { to.open_cameras = absl::OkStatus(); });
  RobotIsNowhereBecause("the robot does not answer");
  Script([](LiveScript& to) { to.open_robot = absl::OkStatus(); });
  AllIsWellAgain();
}

TEST_F(LiveFaultsTest, DevicesThatFailForLongAreOpenedAnew) {
  config.live.reopen_after = absl::Milliseconds(50);
  ASSERT_TRUE(Start().ok());
  AllIsWellAgain();
  Script([](LiveScript& to) {
    to.camera_errors = {3, absl::UnavailableError("gone")};
    to.robot_error = absl::UnavailableError("gone");
  });
  WaitUntil(
      [&] {
        const std::lock_guard lock(script.mutex);
        return script.cameras_opened >= 3 && script.robots_opened >= 3;
      },
      "devices opened anew");
  Script([](LiveScript& to) {
    to.camera_errors = {3, absl::OkStatus()};
    to.robot_error = absl::OkStatus();
  });
  WaitUntil([&] { return record->Status().serving; }, "devices that serve again");
  AllIsWellAgain();
}

TEST_F(LiveFaultsTest, WrongAddressIsTheUsersMistakeAndNotTriedAgain) {
  Script([](LiveScript& to) { to.open_cameras = absl::InvalidArgumentError("no such camera"); });
  EXPECT_EQ(Start(), absl::InvalidArgumentError("no such camera"));
}

}  // namespace
}  // namespace silhouette
