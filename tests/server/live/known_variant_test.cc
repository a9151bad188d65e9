// SPDX-License-Identifier: Apache-2.0
#include "server/live/known_variant.h"

#include <gmock/gmock.h>

#include <random>

#include "server/scene/make_scene.h"
#include "tests/random.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

const std::vector<std::string> kOne = {"default"};
const std::vector<std::string> kVariants = {"default", "open", "with-part"};

absl::Duration KnownVariantAt(double milliseconds) { return absl::Milliseconds(milliseconds); }

std::string Why(const KnownVariant& known, absl::Duration oldest,
                const std::vector<std::string>& variants = kVariants) {
  const absl::StatusOr<std::string> variant = known.Of(oldest, variants);
  EXPECT_EQ(variant.status().code(), absl::StatusCode::kFailedPrecondition);
  return std::string(variant.status().message());
}

TEST(KnownVariant, NobodyHasToTellWhereThereIsButOne) {
  const KnownVariant known;
  EXPECT_EQ(known.Of(KnownVariantAt(-5000), kOne).value(), "default");
  EXPECT_THAT(Why(known, KnownVariantAt(5000)), HasSubstr("silhouette scene variant NAME"));
  EXPECT_THAT(Why(known, KnownVariantAt(5000)), HasSubstr("default, open, with-part"));
}

TEST(KnownVariant, TheVariantOfTheStartShowsTheRobotInAllImages) {
  const KnownVariant known("open");
  EXPECT_EQ(known.Of(KnownVariantAt(-5000), kVariants).value(), "open");
  EXPECT_THAT(Why(known, KnownVariantAt(0), kOne), HasSubstr("'open'"));
}

TEST(KnownVariant, ImagesThatMayBeOfBeforeItWasToldHaveNone) {
  KnownVariant known("open");
  EXPECT_TRUE(known.Tell("with-part", KnownVariantAt(1000)));
  for (const double oldest : {-9e9, 900.0, 1000.0, 1099.0}) {
    EXPECT_THAT(Why(known, KnownVariantAt(oldest)), HasSubstr("wait")) << oldest;
  }
  EXPECT_EQ(known.Of(KnownVariantAt(1000) + kClockTolerance, kVariants).value(), "with-part");
  EXPECT_EQ(known.OfLaterImages(kVariants).value(), "with-part");
}

TEST(KnownVariant, WhileItChangesNoImageHasAny) {
  for (KnownVariant known : {KnownVariant(), KnownVariant("open")}) {
    EXPECT_TRUE(known.TellChanging());
    EXPECT_TRUE(known.changing());
    for (const auto& variants : {kOne, kVariants}) {
      EXPECT_THAT(Why(known, KnownVariantAt(0), variants), HasSubstr("being changed"));
      EXPECT_FALSE(known.OfLaterImages(variants).ok());
    }
    EXPECT_TRUE(known.Tell("open", KnownVariantAt(2000)));
    EXPECT_FALSE(known.changing());
    EXPECT_FALSE(known.Of(KnownVariantAt(2050), kVariants).ok())
        << "the same variant again is as new as another";
    EXPECT_EQ(known.Of(KnownVariantAt(2100), kVariants).value(), "open");
  }
}

TEST(KnownVariant, WhatIsKnownMayBeToldAgain) {
  KnownVariant known("open");
  EXPECT_FALSE(known.Tell("open", KnownVariantAt(3000)));
  EXPECT_EQ(known.Of(KnownVariantAt(0), kVariants).value(), "open");
  EXPECT_TRUE(known.TellChanging());
  EXPECT_FALSE(known.TellChanging());
}

TEST(KnownVariant, AVariantThatTheDatabaseLostIsUnknownUntilItIsToldAnew) {
  KnownVariant known("open");
  known.NoteVariants({"default", "open"});
  EXPECT_EQ(known.OfLaterImages(kVariants).value(), "open");
  known.NoteVariants(kOne);
  EXPECT_THAT(Why(known, KnownVariantAt(0), kOne), HasSubstr("'open'"))
      << "though there is but one now";
  known.NoteVariants(kVariants);
  EXPECT_FALSE(known.OfLaterImages(kVariants).ok()) << "though it is there again";
  EXPECT_TRUE(known.Tell("open", KnownVariantAt(100)));
  EXPECT_EQ(known.OfLaterImages(kVariants).value(), "open");
}

TEST(KnownVariant, ADatabaseThatIsNotNotedYetIsNotTakenForOneThatHasTheVariant) {
  KnownVariant known;
  known.Tell("with-part", KnownVariantAt(0));
  EXPECT_THAT(Why(known, KnownVariantAt(500), kOne), HasSubstr("has only default"));
}

// A robot that changes again and again, told before and after, and a camera whose clock is up to
// kClockTolerance ahead, or as far behind as it likes.
TEST(KnownVariant, AnImageNeverHasAVariantThatTheRobotDidNotHave) {
  Random random;
  const auto between = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  };
  const double tolerance = absl::ToDoubleMilliseconds(kClockTolerance);
  int known_images = 0;
  for (int round = 0; round < 200; ++round) {
    KnownVariant known;
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
          robot = kVariants[random() % kVariants.size()];
          known.Tell(robot, KnownVariantAt(now));
        } else {
          known.TellChanging();
          robot.clear();
        }
      }
      images.push_back({now, now + between(0, 80), robot});
      for (const Image& image : images) {
        if (image.arrives > now) continue;
        const double stamped = std::min(image.taken + ahead, now);
        const absl::StatusOr<std::string> variant = known.Of(KnownVariantAt(stamped), kVariants);
        if (!variant.ok()) continue;
        ++known_images;
        ASSERT_EQ(*variant, image.robot) << "taken at " << image.taken << ", now it is " << now;
        ASSERT_EQ(*variant, robot) << "what is told of later has no old variant";
      }
      std::erase_if(images, [&](const Image& image) { return image.arrives <= now; });
    }
  }
  EXPECT_GT(known_images, 1000);
}

}  // namespace
}  // namespace silhouette
