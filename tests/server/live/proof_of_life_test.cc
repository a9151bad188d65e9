// SPDX-License-Identifier: Apache-2.0
#include "server/live/proof_of_life.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <random>

#include "tests/random.h"

namespace silhouette {
namespace {

using ::testing::HasSubstr;

constexpr int kWidth = 160;
constexpr int kHeight = 120;
constexpr MaskSize kMask = {32, 24};
constexpr double kSigma = 1.5;

Mask Bar(int x) {
  return Mask::FromPredicate(
      kMask, [=](int px, int py) { return px >= x && px < x + 6 && py >= 4 && py < 20; });
}

struct ProofOfLifeTest : ::testing::Test {
  Random random;
  absl::Time time = absl::FromUnixSeconds(1'000'000);
  int robot = 2;  // where its bar is; darker than the cell

  cv::Mat Scene() const {
    const Mask mask = Bar(robot);
    cv::Mat scene(kHeight, kWidth, CV_32FC1);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const bool bar = mask.at(x * kMask.width / kWidth, y * kMask.height / kHeight);
        scene.at<float>(y, x) = static_cast<float>((bar ? 60 : 100) + (x * 7 + y * 13) % 40);
      }
    }
    return scene;
  }
  // With this noise, in grey levels, at the next moment.
  CameraImage Image(double sigma, const cv::Mat& scene) {
    std::normal_distribution<float> noise(0, static_cast<float>(sigma));
    CameraImage image;
    image.width = kWidth;
    image.height = kHeight;
    image.captured = time += absl::Milliseconds(40);
    for (const float level : cv::Mat_<float>(scene)) {
      image.pixels.push_back(
          static_cast<uint8_t>(std::lround(level + (sigma > 0 ? noise(random) : 0.0F))));
    }
    return image;
  }
  CameraImage Live() { return Image(kSigma, Scene()); }
  CameraImage Again(CameraImage image) {
    image.captured = time += absl::Milliseconds(40);
    return image;
  }
  Reference ReferenceOf(double sigma) {
    robot = -100;  // not there
    std::vector<CameraImage> images;
    std::vector<cv::Mat> pictures;
    for (int i = 0; i < 10; ++i) images.push_back(Image(sigma, Scene()));
    for (CameraImage& image : images) {
      pictures.emplace_back(kHeight, kWidth, CV_8UC1, image.pixels.data());
    }
    robot = 2;
    return Reference::FromImages(pictures);
  }
  Reference reference = ReferenceOf(kSigma);
  ProofOfLife life{{}, {true}};
  ProofOfLife without_noise{{}, {false}};

  absl::Status Judge(const CameraImage& image) { return life.Judge(0, image, reference); }
  // The image's own foreground is `foreground`.
  absl::Status Moved(ProofOfLife& proof, const CameraImage& image, int told,
                     const Mask& foreground) {
    const absl::Status judged = proof.Judge(0, image, reference);
    if (!judged.ok()) return judged;
    return proof.JudgeMotion(0, {Bar(told), Bar(told)}, foreground, reference);
  }
};

TEST_F(ProofOfLifeTest, LiveImagesPass) {
  for (int i = 0; i < 300; ++i) ASSERT_TRUE(Judge(Live()).ok()) << i;
  EXPECT_FALSE(life.AnyDead());
}

TEST_F(ProofOfLifeTest, ImageUnderAnotherTimeStampIsDeadAtOnceUntilTheCameraLives) {
  const CameraImage image = Live();
  ASSERT_TRUE(Judge(image).ok());
  EXPECT_TRUE(Judge(image).ok()) << "the same image, asked for twice";
  for (int i = 0; i < 20; ++i) {
    const absl::Status status = Judge(Again(image));
    ASSERT_EQ(status.code(), absl::StatusCode::kDataLoss) << i;
    EXPECT_THAT(std::string(status.message()), HasSubstr("byte for byte"));
    EXPECT_THAT(std::string(status.message()), HasSubstr("noise: none"));
  }
  EXPECT_TRUE(life.AnyDead());
  for (int i = 1; i < ProofOfLife::kLivePairs; ++i) EXPECT_FALSE(Judge(Live()).ok());
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(Judge(Live()).ok());
}

TEST_F(ProofOfLifeTest, CameraThatGivesEveryImageThreeTimesIsNeverAlive) {
  for (int i = 0; i < 10; ++i) {
    const CameraImage image = Live();
    const bool passed = Judge(image).ok();
    EXPECT_EQ(passed, i == 0) << i;
    EXPECT_FALSE(Judge(Again(image)).ok());
    EXPECT_FALSE(Judge(Again(image)).ok());
  }
}

TEST_F(ProofOfLifeTest, LoopOfImagesIsDead) {
  std::vector<CameraImage> loop;
  for (int i = 0; i < 200; ++i) loop.push_back(Live());
  for (const CameraImage& image : loop) ASSERT_TRUE(Judge(image).ok());
  for (const CameraImage& image : loop) EXPECT_FALSE(Judge(Again(image)).ok());
}

TEST_F(ProofOfLifeTest, ImagesWithFarLessNoiseThanTheReferenceAreDeadWithinThreeImages) {
  ASSERT_TRUE(Judge(Live()).ok());
  cv::Mat still = Scene();
  for (int i = 0; i < 20; ++i) {
    // Encoded again: a level changes here and there. A clock is inserted.
    cv::Mat frame = still.clone();
    for (int k = 0; k < 50; ++k) {
      frame.at<float>(static_cast<int>(random() % kHeight), static_cast<int>(random() % kWidth)) +=
          1;
    }
    frame(cv::Rect(100, 100, 50, 12)) = static_cast<float>(50 + i % 2 * 100);
    const absl::Status status = Judge(Image(0, frame));
    EXPECT_EQ(status.ok(), i < 2) << i << status;
    if (i >= 2) {
      EXPECT_THAT(std::string(status.message()), HasSubstr("least_noise"));
    }
  }
  for (int i = 0; i < ProofOfLife::kLivePairs; ++i) (void)Judge(Live());
  EXPECT_TRUE(Judge(Live()).ok());
}

TEST_F(ProofOfLifeTest, HalfTheReferencesNoiseIsLife) {
  for (int i = 0; i < 50; ++i) ASSERT_TRUE(Judge(Image(kSigma / 2, Scene())).ok()) << i;
}

TEST_F(ProofOfLifeTest, WhatMovesInTheImageIsNoProofOfDeath) {
  for (int i = 0; i < 50; ++i) {
    robot = i % 26;
    ASSERT_TRUE(Judge(Live()).ok()) << i;
  }
}

TEST_F(ProofOfLifeTest, SourceWithoutNoiseMayRepeatItself) {
  const CameraImage image = Live();
  for (int i = 0; i < 20; ++i) EXPECT_TRUE(without_noise.Judge(0, Again(image), reference).ok());
}

TEST_F(ProofOfLifeTest, StillImageWhileTheRobotMovesIsDeadUntilItChanges) {
  for (ProofOfLife* proof : {&life, &without_noise}) {
    robot = 2;
    ASSERT_TRUE(Moved(*proof, Live(), 2, Bar(2)).ok());
    // Noise is added to a still image; the robot says that it is elsewhere.
    const absl::Status status = Moved(*proof, Live(), 12, Bar(2));
    EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
    EXPECT_THAT(std::string(status.message()),
                HasSubstr("the robot did not move as its driver reports"));
    EXPECT_TRUE(proof->AnyDead());
    EXPECT_FALSE(Moved(*proof, Live(), 2, Bar(2)).ok()) << "and back again";
    robot = 12;
    EXPECT_TRUE(Moved(*proof, Live(), 12, Bar(12)).ok());
    EXPECT_FALSE(proof->AnyDead());
    EXPECT_FALSE(Moved(*proof, Live(), 22, Bar(12)).ok()) << "again";
  }
}

TEST_F(ProofOfLifeTest, LoopIsDeadUntilItsImageChangesWhereTheRobotWasOrIs) {
  ASSERT_TRUE(Moved(life, Live(), 2, Bar(2)).ok());
  ASSERT_FALSE(Moved(life, Live(), 12, Bar(2)).ok());
  for (int i = 0; i < 10; ++i) {  // someone walks, and the robot stands
    cv::Mat scene = Scene();
    scene(cv::Rect(110 + i, 50, 20, 20)) += 60;
    EXPECT_FALSE(Moved(life, Image(kSigma, scene), 12, Bar(2)).ok()) << i;
  }
  robot = 12;
  EXPECT_TRUE(Moved(life, Live(), 12, Bar(12)).ok());
}

TEST_F(ProofOfLifeTest, ThinRobotThatMovesInAStillImageProvesItDead) {
  const auto line = [](int x) {
    return Mask::FromPredicate(kMask, [=](int px, int py) { return px == x && py < 20; });
  };
  robot = -100;
  ASSERT_TRUE(Judge(Live()).ok());
  ASSERT_TRUE(life.JudgeMotion(0, {line(2), line(2)}, line(2), reference).ok());
  ASSERT_TRUE(Judge(Live()).ok());
  EXPECT_FALSE(life.JudgeMotion(0, {line(12), line(12)}, line(2), reference).ok());
}

TEST_F(ProofOfLifeTest, SomeoneAsBrightAsTheCellBeforeTheRobotIsNoProofIfItLeftItsPlace) {
  ASSERT_TRUE(Moved(life, Live(), 2, Bar(2)).ok());
  robot = -100;  // nothing is seen of it
  EXPECT_TRUE(Moved(life, Live(), 12, Mask(kMask)).ok());
  EXPECT_FALSE(Moved(life, Live(), 22, Mask(kMask)).ok()) << "it left no place where it was seen";
}

TEST_F(ProofOfLifeTest, ImagesThatFollowTheRobotPass) {
  for (int i = 0; i < 100; ++i) {
    robot = static_cast<int>(random() % 26);
    ASSERT_TRUE(Moved(life, Live(), robot, Bar(robot)).ok()) << i;
  }
}

TEST_F(ProofOfLifeTest, RobotImagesThatChangedAreNoMotion) {
  ASSERT_TRUE(Moved(life, Live(), 2, Bar(2)).ok());
  life.ForgetRobot();  // those of another database have the robot elsewhere
  ASSERT_TRUE(Moved(life, Live(), 12, Bar(2)).ok());
  EXPECT_FALSE(Moved(life, Live(), 22, Bar(2)).ok());
}

TEST_F(ProofOfLifeTest, DeadViewStaysDeadWithOtherRobotImagesUntilItsImageChanges) {
  ASSERT_TRUE(Moved(life, Live(), 2, Bar(2)).ok());
  ASSERT_FALSE(Moved(life, Live(), 12, Bar(2)).ok());
  life.ForgetRobot();
  EXPECT_TRUE(life.AnyDead());
  const absl::Status status = Moved(life, Live(), 12, Bar(2));
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(status.message()), HasSubstr("the robot did not move"));
  robot = 12;
  // Masks of another size, with the robot images that have them.
  const auto small = [](int x) {
    return Mask::FromPredicate({16, 12}, [=](int px, int) { return px >= x && px < x + 3; });
  };
  for (const int told : {6, 7}) {
    ASSERT_TRUE(Judge(Live()).ok());
    EXPECT_TRUE(life.JudgeMotion(0, {small(told), small(told)}, small(6), reference).ok());
  }
  EXPECT_FALSE(life.AnyDead());
}

TEST_F(ProofOfLifeTest, RobotThatHidesBehindWhatStandsThereIsNoProof) {
  // Something as wide as the image stands before the camera, and the robot moves behind it.
  const Mask all = Mask::FromPredicate(kMask, [](int, int) { return true; });
  for (const int told : {2, 12, 22}) EXPECT_TRUE(Moved(life, Live(), told, all).ok());
}

TEST_F(ProofOfLifeTest, ReferenceWithoutNoiseSaysNothingOfNoise) {
  reference = ReferenceOf(0);
  for (int i = 0; i < 20; ++i) EXPECT_TRUE(Judge(Image(0, Scene() + i)).ok()) << i;
}

}  // namespace
}  // namespace silhouette
