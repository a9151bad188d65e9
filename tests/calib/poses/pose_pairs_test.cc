// SPDX-License-Identifier: Apache-2.0
#include "calib/poses/pose_pairs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <random>
#include <utility>

#include "calib/camera/camera_model.h"

namespace silhouette {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

PoseView ViewOf(bool on_flange) {
  return {.name = "left",
          .lens = {.width = 640, .height = 480, .fx = 600, .fy = 600, .cx = 320, .cy = 240},
          .on_flange = on_flange};
}

constexpr double kPairPosition = 1e-3;           // noise per axis, metres
constexpr double kPairRotation = 0.1 * kDegree;  // radians

class Pairs {
 public:
  explicit Pairs(unsigned seed, int count = 25, bool on_flange = false) : random_(seed) {
    // Of the base, about a metre and a half away, and of the flange.
    const Eigen::Isometry3d far =
        PoseOf(1.5 * Normals(), {1.2 + 0.1 * normal_(random_), 0.3 * normal_(random_), 0.9});
    const Eigen::Isometry3d near = Anywhere(0.1, 3);
    camera_pose = on_flange ? near : far;
    board_pose = on_flange ? far : near;
    for (int i = 0; i < count; ++i) {
      const Eigen::Isometry3d seen =
          PoseOf(0.3 * Normals(), {Uniform(0.3), Uniform(0.2), 1.1 + Uniform(0.3)});
      const Eigen::Isometry3d link = camera_pose.inverse() * seen * board_pose.inverse();
      pairs.push_back({on_flange ? link.inverse() : link, seen * Noise()});
    }
  }

  Eigen::Isometry3d camera_pose;
  Eigen::Isometry3d board_pose;
  std::vector<PosePair> pairs;

  // Takes a pair at another pose of the flange, with a camera that stands still.
  void TakeAt(const Eigen::Isometry3d& base_from_flange, PosePair& pair) const {
    const Eigen::Isometry3d noise =
        (camera_pose * pair.base_from_flange * board_pose).inverse() * pair.camera_from_board;
    pair = {base_from_flange, camera_pose * base_from_flange * board_pose * noise};
  }
  // Again at the robot's pose of a pair.
  PosePair Repeated(size_t pair) {
    PosePair again = pairs[pair];
    again.camera_from_board = again.camera_from_board * PoseOf(1e-4 * Normals(), 1e-4 * Normals());
    return again;
  }

 private:
  double Uniform(double most) {
    return std::uniform_real_distribution<double>(-most, most)(random_);
  }
  Eigen::Vector3d Normals() { return {normal_(random_), normal_(random_), normal_(random_)}; }
  static Eigen::Isometry3d PoseOf(const Eigen::Vector3d& turn, const Eigen::Vector3d& shift) {
    Eigen::Isometry3d pose(Eigen::Translation3d{shift});
    pose.rotate(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
    return pose;
  }
  Eigen::Isometry3d Anywhere(double far, double turn) {
    return PoseOf(turn / 2 * Normals(), far / 2 * Normals());
  }
  Eigen::Isometry3d Noise() { return PoseOf(kPairRotation * Normals(), kPairPosition * Normals()); }

  std::mt19937 random_;
  std::normal_distribution<double> normal_;
};

std::vector<PosePair> RobotInverted(std::vector<PosePair> pairs) {
  for (PosePair& pair : pairs) pair.base_from_flange = pair.base_from_flange.inverse();
  return pairs;
}

std::string RefusalOfPairs(const std::vector<PosePair>& pairs, bool on_flange) {
  return std::string(SolvePosePairs(pairs, ViewOf(on_flange)).status().message());
}

TEST(PosePairs, GiveTheCameraAsExactlyAsTheySay) {
  constexpr unsigned kRuns = 40;
  double chi2 = 0;
  for (const bool on_flange : {false, true}) {
    for (unsigned seed = 1; seed <= kRuns; ++seed) {
      const Pairs truth(on_flange ? 1000 + seed : seed, 25, on_flange);
      const auto solution = SolvePosePairs(truth.pairs, ViewOf(on_flange));
      ASSERT_TRUE(solution.ok()) << seed << ": " << solution.status();
      const Eigen::Isometry3d off = truth.camera_pose.inverse() * solution->camera_pose;
      Eigen::Matrix<double, 6, 1> error;
      error << RotationVectorOf(off), off.translation();
      chi2 += error.dot(solution->covariance.ldlt().solve(error)) / (6 * 2 * kRuns);
      EXPECT_LT(off.translation().norm(), 0.005) << seed;
      EXPECT_NEAR(solution->position_sigma, kPairPosition, 0.4e-3) << seed;
      EXPECT_NEAR(solution->rotation_sigma, kPairRotation, 0.04 * kDegree) << seed;
    }
  }
  EXPECT_GT(chi2, 0.6);
  EXPECT_LT(chi2, 1.6);
}

TEST(PosePairs, AWrongPairIsLeftOut) {
  Pairs truth(3);
  truth.pairs[7].camera_from_board.translation().x() += 0.05;
  const auto solution = SolvePosePairs(truth.pairs, ViewOf(false));
  ASSERT_TRUE(solution.ok()) << solution.status();
  for (size_t i = 0; i < truth.pairs.size(); ++i) {
    EXPECT_EQ(solution->residuals[i].outlier, i == 7) << i;
  }
  EXPECT_LT((truth.camera_pose.inverse() * solution->camera_pose).translation().norm(), 0.005);
}

TEST(PosePairs, OfTheOtherMountOrInvertedAreRefusedWithTheReason) {
  const Pairs standing(5);
  EXPECT_THAT(RefusalOfPairs(standing.pairs, true), HasSubstr("without --eye-in-hand"));
  const Pairs riding(5, 25, true);
  EXPECT_THAT(RefusalOfPairs(riding.pairs, false),
              HasSubstr("the camera on the flange (--eye-in-hand)"));
  std::vector<PosePair> inverted = standing.pairs;
  for (PosePair& pair : inverted) pair.camera_from_board = pair.camera_from_board.inverse();
  EXPECT_THAT(RefusalOfPairs(inverted, false), HasSubstr("camera's poses inverted"));
  std::vector<PosePair> shifted = standing.pairs;
  for (size_t i = 0; i + 1 < shifted.size(); ++i) {
    shifted[i].camera_from_board = shifted[i + 1].camera_from_board;
  }
  EXPECT_THAT(RefusalOfPairs(shifted, false), HasSubstr("belongs to its robot pose"));
}

// They fit each other as well as right ones; the camera tells.
TEST(PosePairs, ExchangedOrBothInvertedAreRefusedWithTheReason) {
  for (const bool on_flange : {false, true}) {
    for (unsigned seed = 1; seed <= 5; ++seed) {
      const std::vector<PosePair> right = Pairs(seed, 25, on_flange).pairs;
      std::vector<PosePair> exchanged = right;
      std::vector<PosePair> inverted = right;
      for (PosePair& pair : exchanged) std::swap(pair.base_from_flange, pair.camera_from_board);
      for (PosePair& pair : inverted) {
        pair = {pair.base_from_flange.inverse(), pair.camera_from_board.inverse()};
      }
      EXPECT_THAT(RefusalOfPairs(exchanged, on_flange),
                  HasSubstr("the robot's poses and the board's exchanged they do"))
          << seed;
      EXPECT_THAT(RefusalOfPairs(inverted, on_flange), HasSubstr("both poses inverted they do"))
          << seed;
    }
  }
}

TEST(PosePairs, AtOnePoseOfTheRobotCountOnce) {
  Pairs truth(4, 10);
  const auto once = SolvePosePairs(truth.pairs, ViewOf(false));
  ASSERT_TRUE(once.ok()) << once.status();
  for (int i = 0; i < 40; ++i) truth.pairs.push_back(truth.Repeated(9));
  const auto often = SolvePosePairs(truth.pairs, ViewOf(false));
  ASSERT_TRUE(often.ok()) << often.status();
  EXPECT_EQ(often->robot_poses, 10u);
  EXPECT_EQ(often->residuals.size(), 50u);
  EXPECT_NEAR(std::sqrt(often->covariance.trace() / once->covariance.trace()), 1, 0.15);
  const std::vector<PosePair> few(truth.pairs.begin() + 6, truth.pairs.end());
  EXPECT_THAT(RefusalOfPairs(few, false),
              HasSubstr("only 4 pairs of poses at different poses of the robot, of 44"));
}

TEST(PosePairs, OfABoardOfAnotherSizeNameIt) {
  Pairs truth(6);
  for (PosePair& pair : truth.pairs) pair.camera_from_board.translation() *= 1.03;
  EXPECT_THAT(RefusalOfPairs(truth.pairs, false), HasSubstr("measure 97."));
  const auto found = SolvePosePairs(truth.pairs, ViewOf(false), SizeTrust::kFound);
  ASSERT_TRUE(found.ok()) << found.status();
  EXPECT_NEAR(found->size, 1 / 1.03, 0.003);
  EXPECT_LT((truth.camera_pose.inverse() * found->camera_pose).translation().norm(), 0.005);
  const auto stated = SolvePosePairs(truth.pairs, ViewOf(false), SizeTrust::kStated);
  ASSERT_TRUE(stated.ok()) << stated.status();
  EXPECT_THAT(stated->warning, HasSubstr("measure 97."));
}

// The wrist alone turns: a camera that is farther away sees a larger board just so.
TEST(PosePairs, OfABoardWhoseSizeNothingChecksAreDoubtedUnlessItIsVouchedFor) {
  Pairs truth(6);
  for (PosePair& pair : truth.pairs) {
    Eigen::Isometry3d flange = pair.base_from_flange;
    flange.translation() = truth.pairs[0].base_from_flange.translation();
    truth.TakeAt(flange, pair);
  }
  for (PosePair& pair : truth.pairs) pair.camera_from_board.translation() *= 1.03;
  const auto unchecked = HasSubstr("has boards whose size the motion of the robot does not");
  for (const SizeTrust trust : {SizeTrust::kNeither, SizeTrust::kFound}) {
    const auto doubted = SolvePosePairs(truth.pairs, ViewOf(false), trust);
    ASSERT_TRUE(doubted.ok()) << doubted.status();
    EXPECT_THAT(doubted->doubts, Contains(unchecked));
    EXPECT_EQ(doubted->warning, "");
    EXPECT_GT((truth.camera_pose.inverse() * doubted->camera_pose).translation().norm(), 0.02)
        << "which is why";
  }
  const auto stated = SolvePosePairs(truth.pairs, ViewOf(false), SizeTrust::kStated);
  ASSERT_TRUE(stated.ok()) << stated.status();
  EXPECT_THAT(stated->doubts, IsEmpty());
  EXPECT_THAT(stated->warning, unchecked);
}

TEST(PosePairs, ThatRestOnASingleOneAreRefused) {
  for (const int count : {12, 20}) {
    Pairs truth(8, count);
    for (size_t i = 1; i < truth.pairs.size(); ++i) {
      Eigen::Isometry3d flange = truth.pairs[i].base_from_flange;
      flange.linear() = Eigen::AngleAxisd(0.1 * static_cast<double>(i), Eigen::Vector3d::UnitZ())
                            .toRotationMatrix();
      truth.TakeAt(flange, truth.pairs[i]);
    }
    Eigen::Isometry3d tilted = truth.pairs[0].base_from_flange;
    tilted.linear() = Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()).toRotationMatrix();
    truth.TakeAt(tilted, truth.pairs[0]);
    EXPECT_THAT(RefusalOfPairs(truth.pairs, false),
                HasSubstr("rests on pair 1 of its poses alone: without it "))
        << count;
  }
}

TEST(PosePairs, OfACameraThatMovedAreDoubted) {
  Pairs truth(9, 30);
  const auto still = SolvePosePairs(truth.pairs, ViewOf(false));
  ASSERT_TRUE(still.ok()) << still.status();
  EXPECT_THAT(still->doubts, IsEmpty());
  for (size_t i = 18; i < truth.pairs.size(); ++i) {
    truth.pairs[i].camera_from_board =
        Eigen::Translation3d(0.02, 0, 0) * truth.pairs[i].camera_from_board;
  }
  const auto moved = SolvePosePairs(truth.pairs, ViewOf(false));
  ASSERT_TRUE(moved.ok()) << moved.status();
  EXPECT_THAT(moved->doubts, Contains(HasSubstr("half alone has points of the workspace")));
}

TEST(PosePairs, ThatFitOnlyWithOtherDistancesOfTheBoardsAreRefused) {
  for (const double factor : {2.5, 0.4, 0.001}) {
    Pairs truth(6);
    for (PosePair& pair : truth.pairs) pair.camera_from_board.translation() *= factor;
    for (const SizeTrust trust : {SizeTrust::kNeither, SizeTrust::kStated, SizeTrust::kFound}) {
      const auto solution = SolvePosePairs(truth.pairs, ViewOf(false), trust);
      EXPECT_EQ(solution.status().code(), absl::StatusCode::kFailedPrecondition) << factor;
    }
  }
}

TEST(PosePairs, TooFewOrOnlyOneAxisAreRefused) {
  EXPECT_THAT(RefusalOfPairs(Pairs(1, 4).pairs, false), HasSubstr("only 4 pairs"));
  Pairs turned(1, 10);
  for (PosePair& pair : turned.pairs) {
    const double angle = RotationVectorOf(pair.base_from_flange).x();
    pair.base_from_flange.linear() =
        Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  }
  EXPECT_THAT(RefusalOfPairs(turned.pairs, false), HasSubstr("about one axis only"));
}

TEST(PosePairs, AreReadAsMoveItAndEasyHandeyeWriteThem) {
  const auto moveit = PosePairsFromText(
      "- effector_wrt_world: [1, 0, 0, 0.4, 0, 1, 0, 0.5, 0, 0, 1, 0.6, 0, 0, 0, 1]\n"
      "  object_wrt_sensor:\n    - 0\n    - -1\n    - 0\n    - 0.1\n    - 1\n    - 0\n    - 0\n"
      "    - 0.2\n    - 0\n    - 0\n    - 1\n    - 0.3\n    - 0\n    - 0\n    - 0\n    - 1\n",
      "samples.yaml");
  ASSERT_TRUE(moveit.ok()) << moveit.status();
  ASSERT_EQ(moveit->pairs.size(), 1u);
  EXPECT_FALSE(moveit->easy_handeye);
  const PosePair& pair = moveit->pairs.front();
  EXPECT_TRUE(pair.base_from_flange.translation().isApprox(Eigen::Vector3d(0.4, 0.5, 0.6)));
  EXPECT_TRUE(
      (pair.camera_from_board * Eigen::Vector3d::UnitX()).isApprox(Eigen::Vector3d(0.1, 1.2, 0.3)));
  const auto easy = PosePairsFromText(
      "parameters:\n  name: ''\nsamples:\n"
      "- robot:\n    translation: {x: 0.4, y: 0.5, z: 0.6}\n"
      "    rotation: {x: 0.0, y: 0.0, z: 0.0, w: 1.0}\n"
      "  tracking:\n    translation: {x: 0.1, y: 0.2, z: 0.3}\n"
      "    rotation: {x: 0.0, y: 0.0, z: 0.70710678, w: 0.70710678}\n",
      "demo.samples");
  ASSERT_TRUE(easy.ok()) << easy.status();
  ASSERT_EQ(easy->pairs.size(), 1u);
  EXPECT_TRUE(easy->easy_handeye);
  const PosePair& same = easy->pairs.front();
  EXPECT_TRUE(same.base_from_flange.isApprox(pair.base_from_flange, 1e-6));
  EXPECT_TRUE(same.camera_from_board.isApprox(pair.camera_from_board, 1e-6));
}

// Its robot poses are lookup_transform(base, effector) of a camera on the flange, and
// lookup_transform(effector, base) of one that stands.
TEST(PosePairs, OfEasyHandeyeAreTakenAsItStoresThemForEitherMount) {
  for (const bool on_flange : {false, true}) {
    const Pairs truth(7, 25, on_flange);
    const std::vector<PosePair> inverted = RobotInverted(truth.pairs);
    const auto distance = [&](const std::vector<PosePair>& pairs, std::string& warning) {
      const auto solution =
          SolvePairFile({.pairs = pairs, .easy_handeye = true}, ViewOf(on_flange));
      EXPECT_TRUE(solution.ok()) << solution.status();
      if (!solution.ok()) return 1.0;
      warning = solution->warning;
      return (truth.camera_pose.inverse() * solution->camera_pose).translation().norm();
    };
    std::string warning;
    EXPECT_LT(distance(on_flange ? truth.pairs : inverted, warning), 0.005);
    EXPECT_EQ(warning, "");
    EXPECT_LT(distance(on_flange ? inverted : truth.pairs, warning), 0.005);
    EXPECT_THAT(warning, HasSubstr("the inverse of those that easy_handeye stores"));
    EXPECT_FALSE(SolvePairFile({.pairs = inverted}, ViewOf(on_flange)).ok()) << "MoveIt's";
  }
}

TEST(PosePairs, OfEasyHandeyeAndTheOtherMountAreRefusedThoughTheyFit) {
  for (const bool on_flange : {false, true}) {
    const Pairs truth(7, 25, on_flange);
    const PairFile file = {on_flange ? truth.pairs : RobotInverted(truth.pairs), true};
    EXPECT_THAT(std::string(SolvePairFile(file, ViewOf(!on_flange)).status().message()),
                HasSubstr(on_flange ? "were on the flange (--eye-in-hand)"
                                    : "stood still (without --eye-in-hand)"));
  }
}

TEST(PosePairs, OtherFilesAreRefusedWithLine) {
  const auto refusal = [](const std::string& text) {
    return std::string(PosePairsFromText(text, "samples.yaml").status().message());
  };
  EXPECT_THAT(refusal("transforms: []\n"), HasSubstr("'samples' is missing"));
  EXPECT_THAT(refusal("- effector_wrt_world: [1, 0, 0]\n  object_wrt_sensor: []\n"),
              HasSubstr("samples.yaml:1"));
  EXPECT_THAT(refusal("samples:\n- robot:\n    translation: {x: 0, y: 0, z: 0}\n"
                      "    rotation: {x: 1, y: 1, z: 0, w: 0}\n  tracking: {}\n"),
              HasSubstr("samples.yaml"));
}

}  // namespace
}  // namespace silhouette
