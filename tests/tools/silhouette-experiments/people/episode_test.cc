// SPDX-License-Identifier: Apache-2.0
// Episodes in a small cell, with drawn robot images.
#include "tools/silhouette-experiments/people/episode.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <memory>
#include <numbers>
#include <vector>

#include "calib/robot/drawing/motion_check.h"
#include "tests/capture/session/program_cell.h"
#include "tests/folders.h"
#include "tools/silhouette-experiments/people/figures.h"
#include "tools/silhouette-experiments/people/method.h"
#include "tools/silhouette-experiments/people/motion.h"
#include "tools/silhouette-experiments/people/person.h"
#include "tools/silhouette-experiments/people/study.h"
#include "tools/silhouette-experiments/people/truth.h"

namespace silhouette::people_experiment {
namespace {

constexpr double kRate = 10;  // images a second

class PeopleTest : public testing::Test {
 protected:
  PeopleTest() {
    auto loaded = SimulatedWorkplace::Load(files_.cell());
    EXPECT_TRUE(loaded.ok()) << loaded.status();
    workplace_ = std::make_unique<SimulatedWorkplace>(*std::move(loaded));
    auto database = workplace_->OpenUncaptured(files_.database());
    EXPECT_TRUE(database.ok()) << database.status();
    cell_experiment::ServeSettings serve;
    serve.drawn = PartSettings();
    auto served = workplace_->Serve(**database, serve);
    EXPECT_TRUE(served.ok()) << served.status();
    auto stage = Stage::Make(*workplace_, *served, kRate);
    EXPECT_TRUE(stage.ok()) << stage.status();
    stage_ = std::make_unique<Stage>(*std::move(stage));
  }

  Counts Run(const std::string& method, int episode) const {
    auto counts = RunEpisode(*stage_, settings_, episode, method);
    EXPECT_TRUE(counts.ok()) << counts.status();
    return counts.ok() ? *counts : Counts();
  }
  std::vector<EpisodeResult> RunAll(const Study& study) const {
    auto results = RunStudy(
        *stage_, study, [](size_t, size_t) {}, [] { return false; });
    EXPECT_TRUE(results.ok()) << results.status();
    return results.ok() ? *results : std::vector<EpisodeResult>();
  }
  static std::string Text(std::vector<EpisodeResult> results) {
    std::string text;
    for (EpisodeResult& result : results) {
      result.counts.processor_seconds = 0;
      text += result.method + result.counts.ToJson().dump() + "\n";
    }
    return text;
  }

  ProgramCell files_;
  std::unique_ptr<SimulatedWorkplace> workplace_;
  std::unique_ptr<Stage> stage_;
  EpisodeSettings settings_{.seconds = 15, .seed = 5};
};

TEST_F(PeopleTest, TheOracleTouchesNobodyWhileItMovesAndWorks) {
  Counts all;
  for (int episode = 0; episode < 3; ++episode) all.Add(Run("oracle", episode));
  EXPECT_EQ(all.contacts_moving, 0);
  EXPECT_GT(all.people_seconds, 0);
  EXPECT_GT(all.cycles, 0);
}

TEST(PeopleAndSilhouette, WorkTogetherAndKeepTheProtectiveDistances) {
  constexpr double kLeastObstacle = 0.3;
  const auto workplace =
      SimulatedWorkplace::Load(SourceFolder() + "/capture/sim/cells/people/cell.yaml");
  ASSERT_TRUE(workplace.ok()) << workplace.status();
  const SpeedRule rule = DefaultRule(ReachOf(*workplace), kRate);
  const double around = rule.reach + rule.ProtectiveDistances().back();
  cell_experiment::ServeSettings serve;
  serve.drawn = PartSettings();
  serve.least_obstacle = kLeastObstacle;
  serve.separation =
      SeparationCell{.settings = rule.separation,
                     .zone = Eigen::AlignedBox3d(Eigen::Vector3d(-around, -around, 0),
                                                 Eigen::Vector3d(around, around, 2)),
                     .voxel_edge = std::nullopt,
                     .unseen_is_empty = true};
  const auto database = workplace->OpenUncaptured(FreshFolder() / "db");
  ASSERT_TRUE(database.ok()) << database.status();
  const auto served = workplace->Serve(**database, serve);
  ASSERT_TRUE(served.ok()) << served.status();
  const auto stage = Stage::Make(*workplace, *served, kRate);
  ASSERT_TRUE(stage.ok()) << stage.status();
  EXPECT_DOUBLE_EQ(stage->rule().leave_from, 2 * kLeastObstacle);
  const auto counts = RunEpisode(*stage, {.seconds = 12, .seed = 1}, 0, "silhouette");
  ASSERT_TRUE(counts.ok()) << counts.status();
  EXPECT_GT(counts->people_seconds, 0);
  EXPECT_GT(counts->cycles, 0);
  EXPECT_EQ(counts->contacts_moving, 0);
  EXPECT_LT(counts->too_fast, 0.02 * counts->moving);
}

// People at many places around the robot: who stands there, and who walks there to the robot.
TEST_F(PeopleTest, TheRobotLeavesWhoStandsBesideItAndWaitsForWhoWalksToIt) {
  const double floor = workplace_->simulation().settings().room.lower.z();
  PathFollower robot(
      stage_->stations()[0],
      [&](auto from, auto to) { return FastestMovement(stage_->robot(), from, to); },
      stage_->rule().acceleration);
  robot.Follow({stage_->stations()[0], stage_->stations()[1]});
  Truth truth(*workplace_, stage_->robot(), 1);
  const auto leaves = [&](const SpeedRule& rule, double angle, double radius, double speed) {
    const auto method = MakeMethod("oracle", rule);
    Decision decision;
    for (double until = 0.2; until > -1e-6; until -= rule.period) {
      const double now = radius + speed * until;
      const Person person({{.position = {now * std::cos(angle), now * std::sin(angle)}}}, floor);
      truth.Set({&person, 1}, std::vector<double>{0});
      decision = method->Decide({.time = 1 - until, .robot = robot, .truth = truth});
    }
    return decision.leaves;
  };
  const SpeedRule& rule = stage_->rule();
  int left = 0;
  for (double angle = -std::numbers::pi; angle < std::numbers::pi; angle += 0.33) {
    for (double radius = 0.75; radius < 1.3; radius += 0.1) {
      if (!leaves(rule, angle, radius, 0)) continue;
      ++left;
      EXPECT_FALSE(leaves(rule, angle, radius, 1.6)) << angle << ", " << radius << " m";
    }
  }
  EXPECT_GT(left, 0);
}

TEST_F(PeopleTest, NoPieceOfAWayIsFasterThanTheMovementSaysAndItsFastestIsAsFast) {
  const DrawnRobot& arm = stage_->robot();
  constexpr int kPieces = 500;
  Configuration from = stage_->stations()[0];
  Configuration to = stage_->stations()[1];
  const double movement = FastestMovement(arm, from, to);
  EXPECT_LT(movement, GreatestDisplacement(arm, from, to));
  std::vector<Eigen::Isometry3d> before;
  std::vector<Eigen::Isometry3d> poses;
  arm.chain().Pose(from, before);
  double fastest = 0;
  for (int piece = 1; piece <= kPieces; ++piece) {
    Configuration q = from;
    for (size_t j = 0; j < q.size(); ++j) {
      q[j] = std::lerp(from[j], to[j], static_cast<double>(piece) / kPieces);
    }
    arm.chain().Pose(q, poses);
    fastest = std::max(fastest, DisplacementBetween(arm, before, poses));
    before.swap(poses);
  }
  EXPECT_NEAR(fastest * kPieces, movement, 0.02 * movement);
}

// An arm of six joints in a cell that states no grid, and people around it, near and farther away.
TEST(PeopleWithoutAGrid, WaysKeepTheirDistanceAndTheWayOutIsShort) {
  auto workplace =
      SimulatedWorkplace::Load(SourceFolder() + "/capture/sim/cells/six_axes/cell.yaml").value();
  const DrawnRobot arm =
      TrueRobot(workplace, std::vector<MaskSize>(workplace.cell().views.size(), {64, 64})).value();
  const JointSpace space{.grid = workplace.cell().grid, .limits_only = true};
  const SpeedRule rule = DefaultRule(1.5, kRate);
  const double least = rule.ProtectiveDistances().front();
  const auto movement = [&](auto from, auto to) { return FastestMovement(arm, from, to); };
  const Configuration start = {-1, -0.3, 1.2, 0, 0.5, 0};
  const Configuration goal = {1, -0.3, 1.2, 0, 0.5, 0};
  const PathFollower robot(start, movement, rule.acceleration);
  Truth truth(workplace, arm, 1);
  const auto distance = [&](const Configuration& q) { return truth.Distance(q, 2); };
  int around = 0;
  int out = 0;
  for (const double angle : {-2.0, -1.0, 0.0, 1.0}) {
    for (const double radius : {0.8, 1.2}) {
      const Person person({{.position = {radius * std::cos(angle), radius * std::sin(angle)}}}, 0);
      truth.Set({&person, 1}, std::vector<double>{0});
      const auto way =
          MakeMethod("oracle", rule)->Plan({.robot = robot, .truth = truth}, space, goal);
      if (way.empty()) continue;
      EXPECT_EQ(way.front(), start);
      if (distance(start) < least) {
        ++out;
        EXPECT_GT(distance(way.back()), distance(start)) << angle;
        for (size_t i = 1; i < way.size(); ++i) EXPECT_LT(movement(way[i - 1], way[i]), 0.3);
      } else if (way.size() > 2) {
        ++around;
        EXPECT_EQ(way.back(), goal);
        for (size_t i = 1; i < way.size(); ++i) {
          Configuration middle = way[i];
          for (size_t j = 0; j < middle.size(); ++j) middle[j] = (way[i - 1][j] + way[i][j]) / 2;
          EXPECT_GE(distance(way[i]), least) << angle;
          EXPECT_GE(distance(middle), least) << angle;
        }
      }
    }
  }
  EXPECT_GT(around, 0);
  EXPECT_GT(out, 0);
}

// The cell's own model lacks a cable, a loop and a hose of the simulated arm.
TEST(PeopleWithoutAGrid, DrawnImagesShowAllThatThereIsOfTheRobot) {
  const auto workplace =
      SimulatedWorkplace::Load(SourceFolder() + "/capture/sim/cells/six_axes/cell.yaml").value();
  const ProgramCell files;
  const auto database = workplace.OpenUncaptured(files.database()).value();
  cell_experiment::ServeSettings serve;
  serve.drawn = PartSettings();
  const auto served = workplace.Serve(*database, serve).value();
  const DrawnRobot arm = TrueRobot(workplace, served->robot_images().mask_sizes()).value();
  for (const Configuration& q :
       {Configuration{-1, -0.3, 1.2, 0, 0.5, 0}, {1, 0.5, -0.4, 1, 0.7, 2}}) {
    const std::vector<Mask> robot = arm.Touched(q);
    const std::vector<Mask> drawn = served->robot_images().drawn()->Touched(q);
    for (size_t view = 0; view < robot.size(); ++view) {
      EXPECT_FALSE(robot[view].Empty());
      EXPECT_TRUE((robot[view] - drawn[view]).Empty()) << "view " << view;
    }
  }
}

TEST_F(PeopleTest, TheCurtainIsToldToStandAsSoonAsSomebodyIsInside) {
  Counts all;
  for (int episode = 0; episode < 3; ++episode) all.Add(Run("light_curtain", episode));
  EXPECT_EQ(all.contacts_moving, 0);
  EXPECT_GT(all.standing, 0.5 * all.people_seconds);
  for (const double reaction : all.reactions)
    EXPECT_LE(reaction, 1 / kRate + 1e-9) << "one decision";
}

TEST_F(PeopleTest, TheSameSeedGivesTheSameResultAndAnotherDoesNot) {
  settings_.seconds = 6;
  const auto text = [&](const Counts& counts) { return Text({{0, "", counts}}); };
  const std::string first = text(Run("uncalibrated", 1));
  EXPECT_EQ(text(Run("uncalibrated", 1)), first);
  EXPECT_NE(text(Run("uncalibrated", 2)), first);
}

TEST_F(PeopleTest, TheSameSeedGivesTheSameRenderedEpisode) {
  settings_.seconds = 3;
  settings_.rendered = true;
  const Counts first = Run("uncalibrated", 1);
  EXPECT_EQ(Text({{0, "", Run("uncalibrated", 1)}}), Text({{0, "", first}}));
  EXPECT_EQ(first.scenes, 3 * kRate) << "one a decision, also while the robot picks";
  EXPECT_EQ(first.unusable, 0);
}

TEST_F(PeopleTest, APersonBeforeTheCamerasIsSeenAndNobodyElse) {
  const Person person({{.position = {0.9, 0.3}, .direction = 3, .reach = 0.8}}, 0);
  Poses there;
  person.AppendPoses(0, there);
  Poses away = there;
  for (Eigen::Isometry3d& pose : away) pose.translation().z() -= 100;
  RenderedCell cell(*workplace_, stage_->database(), 1, 7);
  const auto look = [&](const Poses& parts, double seconds) {
    const absl::Duration running = absl::Seconds(seconds);
    return cell.Look(stage_->stations().front(), parts, {absl::UnixEpoch() + running, running})
        .value();
  };
  const Sight empty = look(away, 0);
  const Sight seen = look(there, 0.1);
  for (const Sight* sight : {&empty, &seen}) {
    ASSERT_NE(sight->scene, nullptr);
    EXPECT_EQ(sight->images.size(), 2u);
    for (const SceneDefect& defect : sight->scene->defects) ADD_FAILURE() << defect.message;
  }
  for (size_t view = 0; view < 2; ++view) {
    EXPECT_EQ(empty.scene->obstacle_images[view]->obstacle().Count(), 0u);
    EXPECT_GT(seen.scene->obstacle_images[view]->obstacle().Count(), 20u);
  }
}

TEST_F(PeopleTest, AStudyThatWasStoppedGoesOnToTheSameResult) {
  settings_.seconds = 4;
  Study study{.episode = settings_,
              .episodes = 3,
              .methods = {"light_curtain", "uncalibrated"},
              .file = "",
              .basis = "small"};
  const std::string unbroken = Text(RunAll(study));
  study.file = files_ / "episodes.jsonl";
  size_t done = 0;
  const auto stopped = RunStudy(
      *stage_, study, [&](size_t count, size_t) { done = count; }, [&] { return done >= 2; });
  EXPECT_EQ(stopped.status().code(), absl::StatusCode::kCancelled);
  std::ofstream(study.file, std::ios::app) << R"({"episode":2,"method":"unca)";
  EXPECT_EQ(Text(RunAll(study)), unbroken);
  EXPECT_EQ(Text(RunAll(study)), unbroken) << "read from the file alone";

  ++study.episode.seed;
  EXPECT_EQ(RunStudy(
                *stage_, study, [](size_t, size_t) {}, [] { return false; })
                .status()
                .code(),
            absl::StatusCode::kFailedPrecondition);
}

TEST(PeopleFigures, RatiosOfWorkStateTheirStandardErrorOverPairedEpisodes) {
  std::vector<EpisodeResult> results;
  const std::vector<std::string> methods = {"oracle", "silhouette"};
  const auto add = [&](int episode, double oracle, double silhouette) {
    results.push_back({episode, "oracle", {.episodes = 1, .seconds = 60, .cycles = oracle}});
    results.push_back(
        {episode, "silhouette", {.episodes = 1, .seconds = 60, .cycles = silhouette}});
  };
  add(0, 10, 9);
  EXPECT_FALSE(FiguresOf(results, methods)[1].to_oracle->standard_error);
  add(1, 20, 16);
  add(2, 30, 23);
  const MethodFigures silhouette = FiguresOf(results, methods)[1];
  EXPECT_FALSE(silhouette.to_curtain);
  EXPECT_DOUBLE_EQ(silhouette.to_oracle->ratio, 0.8);
  // Residuals of 1, 0 and -1 cycles.
  EXPECT_NEAR(*silhouette.to_oracle->standard_error, std::sqrt(2 * 3 / 2.0) / 60, 1e-12);
  const auto same = FiguresOf(results, methods)[0].to_oracle;
  EXPECT_EQ(same->ratio, 1);
  EXPECT_EQ(*same->standard_error, 0);
}

// Each would replace the file that the other appends to.
TEST_F(PeopleTest, NoTwoStudiesWriteToOneFolder) {
  settings_.seconds = 2;
  const Study study{.episode = settings_,
                    .episodes = 1,
                    .methods = {"light_curtain"},
                    .file = files_ / "episodes.jsonl",
                    .basis = ""};
  const auto go_on = [] { return false; };
  absl::Status second;
  const auto first = RunStudy(
      *stage_, study,
      [&](size_t, size_t) {
        second = RunStudy(
                     *stage_, study, [](size_t, size_t) {}, go_on)
                     .status();
      },
      go_on);
  EXPECT_TRUE(first.ok()) << first.status();
  EXPECT_EQ(second.code(), absl::StatusCode::kFailedPrecondition) << second;
  EXPECT_EQ(RunAll(study).size(), 1u) << "free again";
}

TEST_F(PeopleTest, EpisodeStopsAtItsNextDecision) {
  int asked = 0;
  const auto counts =
      RunEpisode(*stage_, settings_, 0, "light_curtain", [&] { return ++asked == 3; });
  EXPECT_EQ(counts.status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(asked, 3);
}

TEST_F(PeopleTest, JsonNamesTheMethodsAndTheirFigures) {
  settings_.seconds = 2;
  const std::vector<std::string> methods = {"light_curtain", "oracle"};
  const auto results =
      RunAll({.episode = settings_, .episodes = 2, .methods = methods, .file = "", .basis = ""});
  const nlohmann::ordered_json json = JsonOf(FiguresOf(results, methods));
  ASSERT_EQ(json["methods"].size(), 2u);
  EXPECT_EQ(json["methods"][0]["name"], "light_curtain");
  for (const auto& method : json["methods"]) {
    for (const char* key : {"name", "cycles_per_hour", "contacts_moving", "contacts", "episodes"}) {
      EXPECT_TRUE(method.contains(key)) << key;
    }
    EXPECT_EQ(method["episodes"], 2);
  }
}

TEST_F(PeopleTest, MasksShowEveryPointOfPeopleAndRobot) {
  Chance chance(4);
  const Person person({{.position = {0.9, 0.3}, .direction = 3, .reach = 0.8, .carries = true}}, 0);
  const std::vector<PlacedShape> parts = person.PartsAt(0);
  const Configuration q = stage_->stations().front();
  TrueMasks drawer(stage_->robot(), nullptr, {.missed = 0, .added = 0});
  const std::vector<Mask> masks = drawer.Draw(q, parts, chance);
  const Calibration calibration = workplace_->TrueCalibration();
  for (size_t view = 0; view < masks.size(); ++view) {
    const MaskSize size = masks[view].size();
    const CameraModel camera = calibration.cameras[view].ScaledTo(size.width, size.height);
    int seen = 0;
    for (int i = 0; i < 2000; ++i) {
      const PlacedShape& part = parts[chance.Index(parts.size())];
      const Eigen::Vector3d share(chance.Uniform(-1, 1), chance.Uniform(-1, 1),
                                  chance.Uniform(-1, 1));
      const Eigen::Vector3d point =
          part.world_from_shape *
          (part.shape.half.cwiseProduct(share) + part.shape.radius * chance.Direction());
      const auto pixel = camera.Project(point);
      if (!pixel) continue;
      const int x = static_cast<int>(std::floor(pixel->x() + 0.5));
      const int y = static_cast<int>(std::floor(pixel->y() + 0.5));
      if (x < 0 || y < 0 || x >= size.width || y >= size.height) continue;
      ++seen;
      ASSERT_TRUE(masks[view].at(x, y)) << "view " << view << ", " << x << " " << y;
    }
    EXPECT_GT(seen, 100);
  }
}

}  // namespace
}  // namespace silhouette::people_experiment
