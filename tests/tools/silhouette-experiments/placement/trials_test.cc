// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/placement/trials.h"

#include <gtest/gtest.h>

#include <fstream>
#include <random>

#include "tests/capture/sim/small_cell.h"
#include "tests/random.h"
#include "tools/silhouette-experiments/placement/silhouettes.h"

namespace silhouette {
namespace {

CameraModel CameraAt(const Eigen::Vector3d& position, const Eigen::Vector3d& look_at,
                     double focal) {
  const CameraIntrinsics intrinsics{
      .width = 32, .height = 32, .fx = focal, .fy = focal, .cx = 15.5, .cy = 15.5};
  return {intrinsics, LookAt(position, look_at, Eigen::Vector3d::UnitZ())};
}

Candidate CandidateAt(const std::string& name, const Eigen::Vector3d& position,
                      const Eigen::Vector3d& look_at, double focal = 22) {
  return {name, position, look_at, CameraAt(position, look_at, focal)};
}

// Every point of a solid that is a quarter of a pixel inside its pixel makes it a part of the
// silhouette, and no pixel far from all points is one.
TEST(Silhouette, HasThePixelsThatThePartsTouch) {
  Random random;
  std::uniform_real_distribution<double> number(-1, 1);
  const CameraModel camera = CameraAt({3, 0.4, 1}, {0, 0, 0}, 30);
  for (bool convex : {true, false}) {
    const Eigen::Vector3d edges(0.9, 0.5, 0.7);
    std::vector<Solid> solids =
        SolidsOf(std::vector<BodyPart>{{.name = "box", .frame = 0, .mesh = BoxMesh(edges)}});
    ASSERT_TRUE(solids[0].convex);
    solids[0].convex = convex;
    Eigen::Isometry3d pose(
        Eigen::AngleAxisd(number(random), Eigen::Vector3d(1, 2, 3).normalized()));
    const Mask mask = SilhouetteOf(solids, {pose}, camera);
    Mask touched(mask.size());
    std::vector<uint64_t> words(touched.words().begin(), touched.words().end());
    for (int i = 0; i < 60000; ++i) {
      Eigen::Vector3d point(number(random), number(random), number(random));
      const auto pixel = camera.Project(pose * (0.5 * point.cwiseProduct(edges)));
      ASSERT_TRUE(pixel && camera.Contains(*pixel));
      const Eigen::Vector2d in_pixel = *pixel - Eigen::Vector2d(pixel->array().round());
      if (in_pixel.lpNorm<Eigen::Infinity>() > 0.25) continue;
      const auto bit = static_cast<size_t>(std::lround(pixel->y())) * 32 +
                       static_cast<size_t>(std::lround(pixel->x()));
      words[bit / 64] |= uint64_t{1} << (bit % 64);
    }
    touched = Mask::FromWords(mask.size(), words);
    EXPECT_TRUE((touched - mask).Empty());
    const Mask eroded = Core(mask);
    EXPECT_TRUE((eroded - touched).Empty());
    EXPECT_GT(eroded.Count(), 0u);
  }
}

TEST(Silhouette, PartBehindTheCameraIsCutOff) {
  const CameraModel camera = CameraAt({1, 0, 0}, {0, 0, 0}, 20);
  const auto of_box = [&](double x, bool convex) {
    std::vector<Solid> solids = SolidsOf(
        std::vector<BodyPart>{{.name = "box", .frame = 0, .mesh = BoxMesh({0.4, 0.4, 0.4})}});
    solids[0].convex = convex;
    return SilhouetteOf(solids, {Eigen::Isometry3d(Eigen::Translation3d(x, 0, 0))}, camera);
  };
  for (bool convex : {true, false}) {
    EXPECT_TRUE(of_box(3, convex).Empty());
    EXPECT_EQ(of_box(1, convex).Count(), 32u * 32u) << "the camera is in the box";
  }
}

class TrialsTest : public testing::Test {
 protected:
  TrialsTest() : robot_(ThreeJointRobot()) {
    std::vector<GridJoint> joints;
    for (const RobotJoint& joint : robot_.joints()) {
      joints.push_back({.name = joint.name,
                        .lower = std::max(joint.lower, -1.0),
                        .upper = std::min(joint.upper, 1.0),
                        .steps = 5});
    }
    grid_.emplace(joints);
    places_.mask_size = {32, 32};
    places_.samples = {.configurations = 40, .scenes = 6, .most_obstacles = 2, .seed = 3};
  }

  absl::StatusOr<Trials> Make() {
    return Trials::Make(
        robot_, *grid_, [](const Configuration& q) { return q; }, places_,
        [](uint64_t, uint64_t) { return true; });
  }

  RobotModel robot_;
  std::optional<ConfigurationGrid> grid_;
  Places places_;
};

TEST_F(TrialsTest, PlaceThatCutsTheRobotOffIsLeftOut) {
  places_.candidates = {CandidateAt("away", {6, 0, 1}, {12, 0, 1}),
                        CandidateAt("good", {6, 0, 1}, {0, 0, 1}),
                        CandidateAt("narrow", {6, 0, 1}, {0, 0, 1}, 500)};
  const absl::StatusOr<Trials> trials = Make();
  ASSERT_TRUE(trials.ok()) << trials.status();
  EXPECT_EQ(trials->usable(), std::vector<int>{1});
  places_.candidates = {CandidateAt("away", {6, 0, 1}, {12, 0, 1})};
  EXPECT_EQ(Make().status().code(), absl::StatusCode::kFailedPrecondition);
}

// From far away the robot covers with its one pixel every obstacle that it touches.
TEST_F(TrialsTest, PlaceThatSeesWellIsBetterThanOnesThatSeeNothing) {
  places_.candidates = {CandidateAt("far", {90, 0, 1}, {0, 0, 1}),
                        CandidateAt("near", {6, 0, 1}, {0, 0, 1}),
                        CandidateAt("farther", {0, 120, 1}, {0, 0, 1}),
                        CandidateAt("other side", {0, 6, 1}, {0, 0, 1})};
  const absl::StatusOr<Trials> trials = Make();
  ASSERT_TRUE(trials.ok()) << trials.status();
  const Policy policy{.preset = Preset::kCalibrated};
  const Evaluate evaluate = [&](const std::vector<CameraSet>& sets) {
    std::vector<Measures> measures;
    for (const CameraSet& set : sets) measures.push_back(trials->MeasuresOf(set, policy));
    return measures;
  };
  const std::vector<Selection> selections = Select(4, 2, evaluate, [] { return false; });
  CameraSet both = selections[1].cameras;
  std::sort(both.begin(), both.end());
  EXPECT_EQ(both, (CameraSet{1, 3}));
  EXPECT_LT(selections[1].measures.missing, trials->MeasuresOf({0, 2}, policy).missing);
  EXPECT_GT(selections[1].measures.occupied, 0);
  EXPECT_EQ(selections[1].measures.tested, 6 * 40);
}

TEST_F(TrialsTest, SameSeedGivesTheSameMeasuresAndAnotherSeedOthers) {
  places_.candidates = {CandidateAt("a", {6, 0, 1}, {0, 0, 1}),
                        CandidateAt("b", {0, 6, 2}, {0, 0, 1})};
  const auto measure = [&] {
    const absl::StatusOr<Trials> trials = Make();
    const Measures m = trials.value().MeasuresOf({0, 1}, {.preset = Preset::kPaper});
    return std::vector<int64_t>{m.tested, m.occupied, m.missing, m.additional};
  };
  const std::vector<int64_t> first = measure();
  EXPECT_EQ(measure(), first);
  places_.samples.seed = 4;
  EXPECT_NE(measure(), first);
}

TEST_F(TrialsTest, ChosenSetsAreJudgedByAsManyScenesThatAreOthers) {
  places_.candidates = {CandidateAt("a", {6, 0, 1}, {0, 0, 1})};
  const Trials trials = Make().value();
  const Policy policy{.preset = Preset::kPaper};
  const Measures choice = trials.MeasuresOf({0}, policy);
  const Measures fresh = trials.MeasuresOf({0}, policy, Trials::Scenes::kFresh);
  EXPECT_EQ(fresh.tested, choice.tested);
  EXPECT_NE(fresh.occupied, choice.occupied);
}

TEST_F(TrialsTest, StopIsObeyed) {
  places_.candidates = {CandidateAt("a", {6, 0, 1}, {0, 0, 1})};
  const auto trials = Trials::Make(
      robot_, *grid_, [](const Configuration& q) { return q; }, places_,
      [](uint64_t, uint64_t) { return false; });
  EXPECT_EQ(trials.status().code(), absl::StatusCode::kAborted);
}

}  // namespace
}  // namespace silhouette
