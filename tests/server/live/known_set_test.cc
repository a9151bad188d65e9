#include "server/live/known_set.h"

#include <gmock/gmock.h>

#include <iostream>
#include <random>

#include "server/scene/make_scene.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

const std::vector<std::string> kOne = {"default"};
const std::vector<std::string> kSets = {"default", "open", "with-part"};

absl::Duration KnownSetAt(double milliseconds) { return absl::Milliseconds(milliseconds); }

std::string Why(const KnownSet& known, absl::Duration oldest,
                const std::vector<std::string>& sets = kSets) {
  const absl::StatusOr<std::string> set = known.Of(oldest, sets);
  EXPECT_EQ(set.status().code(), absl::StatusCode::kFailedPrecondition);
  return std::string(set.status().message());
}

TEST(KnownSet, NobodyHasToTellWhereThereIsButOne) {
  const KnownSet known;
  EXPECT_EQ(known.Of(KnownSetAt(-5000), kOne).value(), "default");
  EXPECT_THAT(Why(known, KnownSetAt(5000)), HasSubstr("silhouette scene set NAME"));
  EXPECT_THAT(Why(known, KnownSetAt(5000)), HasSubstr("default, open, with-part"));
}

TEST(KnownSet, TheSetOfTheStartShowsTheRobotInAllImages) {
  const KnownSet known("open");
  EXPECT_EQ(known.Of(KnownSetAt(-5000), kSets).value(), "open");
  EXPECT_THAT(Why(known, KnownSetAt(0), kOne), HasSubstr("'open'"));
}

TEST(KnownSet, ImagesThatMayBeOfBeforeItWasToldHaveNone) {
  KnownSet known("open");
  EXPECT_TRUE(known.Tell("with-part", KnownSetAt(1000)));
  for (const double oldest : {-9e9, 900.0, 1000.0, 1099.0}) {
    EXPECT_THAT(Why(known, KnownSetAt(oldest)), HasSubstr("wait")) << oldest;
  }
  EXPECT_EQ(known.Of(KnownSetAt(1000) + kClockTolerance, kSets).value(), "with-part");
  EXPECT_EQ(known.OfLaterImages(kSets).value(), "with-part");
}

TEST(KnownSet, WhileItChangesNoImageHasAny) {
  for (KnownSet known : {KnownSet(), KnownSet("open")}) {
    EXPECT_TRUE(known.TellChanging());
    EXPECT_TRUE(known.changing());
    for (const auto& sets : {kOne, kSets}) {
      EXPECT_THAT(Why(known, KnownSetAt(0), sets), HasSubstr("being changed"));
      EXPECT_FALSE(known.OfLaterImages(sets).ok());
    }
    EXPECT_TRUE(known.Tell("open", KnownSetAt(2000)));
    EXPECT_FALSE(known.changing());
    EXPECT_FALSE(known.Of(KnownSetAt(2050), kSets).ok())
        << "the same set again is as new as another";
    EXPECT_EQ(known.Of(KnownSetAt(2100), kSets).value(), "open");
  }
}

TEST(KnownSet, WhatIsKnownMayBeToldAgain) {
  KnownSet known("open");
  EXPECT_FALSE(known.Tell("open", KnownSetAt(3000)));
  EXPECT_EQ(known.Of(KnownSetAt(0), kSets).value(), "open");
  EXPECT_TRUE(known.TellChanging());
  EXPECT_FALSE(known.TellChanging());
}

TEST(KnownSet, ASetThatTheDatabaseLostIsUnknownUntilItIsToldAnew) {
  KnownSet known("open");
  known.NoteSets({"default", "open"});
  EXPECT_EQ(known.OfLaterImages(kSets).value(), "open");
  known.NoteSets(kOne);
  EXPECT_THAT(Why(known, KnownSetAt(0), kOne), HasSubstr("'open'"))
      << "though there is but one now";
  known.NoteSets(kSets);
  EXPECT_FALSE(known.OfLaterImages(kSets).ok()) << "though it is there again";
  EXPECT_TRUE(known.Tell("open", KnownSetAt(100)));
  EXPECT_EQ(known.OfLaterImages(kSets).value(), "open");
}

TEST(KnownSet, ADatabaseThatIsNotNotedYetIsNotTakenForOneThatHasTheSet) {
  KnownSet known;
  known.Tell("with-part", KnownSetAt(0));
  EXPECT_THAT(Why(known, KnownSetAt(500), kOne), HasSubstr("has only default"));
}

// A robot that changes again and again, told before and after, and a camera whose clock is up to
// kClockTolerance ahead, or as far behind as it likes.
TEST(KnownSet, AnImageNeverHasASetThatTheRobotDidNotHave) {
  const unsigned seed = std::random_device()();
  std::cout << "seed " << seed << '\n';
  std::mt19937 random(seed);
  const auto between = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  };
  const double tolerance = absl::ToDoubleMilliseconds(kClockTolerance);
  int known_images = 0;
  for (int round = 0; round < 200; ++round) {
    KnownSet known;
    std::string robot;  // as it is; empty: in between
    const double ahead = between(-2 * tolerance, tolerance);
    // Images that are under way: when they were really taken, and of what robot.
    struct Image {
      double taken;
      double arrives;
      std::string robot;
    };
    std::vector<Image> images;
    double changes = 0;
    for (double now = 0; now < 3000; now += 5) {
      if (now >= changes) {
        changes = now + between(5, 600);
        if (robot.empty()) {
          robot = kSets[random() % kSets.size()];
          known.Tell(robot, KnownSetAt(now));
        } else {
          known.TellChanging();
          robot.clear();
        }
      }
      images.push_back({now, now + between(0, 80), robot});
      for (const Image& image : images) {
        if (image.arrives > now) continue;
        const double stamped = std::min(image.taken + ahead, now);
        const absl::StatusOr<std::string> set = known.Of(KnownSetAt(stamped), kSets);
        if (!set.ok()) continue;
        ++known_images;
        ASSERT_EQ(*set, image.robot) << "taken at " << image.taken << ", now it is " << now;
        ASSERT_EQ(*set, robot) << "what is told of later has no old set";
      }
      std::erase_if(images, [&](const Image& image) { return image.arrives <= now; });
    }
  }
  EXPECT_GT(known_images, 1000);
}

}  // namespace
}  // namespace silhouette
