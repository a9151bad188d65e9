// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/cell/trial.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "common/parallel/parallel.h"
#include "common/picture/picture.h"
#include "db/status/status_macros.h"
#include "server/collision/collision_checker.h"
#include "server/collision/verdict.h"
#include "server/scene/checker.h"
#include "server/scene/make_scene.h"

namespace silhouette::cell_experiment {
namespace {

// Test configurations that a thread takes at a time.
constexpr size_t kAtOnce = 64;
// The frames of scenes come after those of the capture.
constexpr uint64_t kFirstFrame = uint64_t{1} << 32;
// Streams of chance: the scenes' own are their numbers.
constexpr uint64_t kTestStream = uint64_t{1} << 40;

struct Test {
  Configuration configuration;
  Where where;
};

std::vector<Test> TestsOf(const TrialSetting& setting, int number) {
  const ConfigurationGrid& grid = setting.database.grid();
  std::vector<Test> tests;
  for (Configuration& q : PresentConfigurations(setting.database)) {
    tests.push_back({std::move(q), kOnGrid});
  }
  Chance chance(setting.seed, kTestStream + static_cast<uint64_t>(number));
  for (int i = 0; i < setting.off_grid_tests; ++i) {
    tests.push_back({RandomConfiguration(chance, grid, false), kOffGrid});
  }
  return tests;
}

std::vector<JointPosition> JointsOf(const SimulatedWorkplace& workplace, const Configuration& q) {
  std::vector<JointPosition> joints;
  for (size_t j = 0; j < q.size(); ++j) {
    joints.push_back({workplace.cell().grid.joints()[j].name, q[j]});
  }
  for (const FixedJoint& joint : workplace.cell().fixed_joints) {
    joints.push_back({joint.name, joint.position});
  }
  return joints;
}

// What the truth and all policies say of one test configuration.
struct Answer {
  bool touches = false;
  std::vector<Verdict> verdicts;  // by policy
};

}  // namespace

void Tally::Add(const Tally& other) {
  tested += other.tested;
  occupied += other.occupied;
  additional += other.additional;
  missing += other.missing;
  flagged += other.flagged;
}

std::vector<Configuration> PresentConfigurations(const ServedDatabase& database) {
  std::vector<Configuration> present;
  for (ConfigurationNumber i = 0; i < database.grid().number_limit(); ++i) {
    if (database.robot_images().state(i) != RobotImageState::kPresent) continue;
    present.push_back(database.grid().At(i));
  }
  return present;
}

absl::StatusOr<ViewedScene> View(const TrialSetting& setting, RandomScene scene, int number) {
  const SimulatedWorkplace& workplace = setting.workplace;
  SimulatedCell& cell = workplace.simulation();
  cell.SetObstacles(scene.obstacles);
  cell.SetPositions(workplace.Positions(scene.robot));
  cell.SetTime(scene.time);
  cell.SetFrame(kFirstFrame + static_cast<uint64_t>(number));
  std::vector<CameraImage> images = cell.TakeImages(workplace.cameras());
  // Obstacles are described for time 0 and stand still.
  SceneInput input{.joints = JointsOf(workplace, scene.robot), .views = {}};
  for (size_t view = 0; view < images.size(); ++view) {
    const CameraImage& image = images[view];
    const Picture pixels = PictureOfPixels(image.width, image.height, image.channels, image.pixels);
    input.views.push_back({.view = workplace.cell().views[view].name,
                           .captured = std::nullopt,
                           .image = EncodedImage{EncodePng(pixels)}});
  }
  const Moment now = SystemClock();
  ASSIGN_OR_RETURN(Scene made, MakeScene(setting.database, input, workplace.cell().server.scene,
                                         workplace.cell().segmentation, now));
  return ViewedScene{std::move(scene), std::move(images), std::move(made)};
}

std::vector<std::unique_ptr<CollisionChecker>> CheckersOf(const TrialSetting& setting,
                                                          const ViewedScene& viewed) {
  const std::shared_ptr<void> no_owner;
  const Served served{
      .database = std::shared_ptr<const ServedDatabase>(no_owner, &setting.database),
      .scene = SharedScene(no_owner, &viewed.scene),
      .without_scene = Reason::kNone};
  std::vector<std::unique_ptr<CollisionChecker>> policies;
  for (const Policy& policy : setting.policies) {
    policies.push_back(std::make_unique<CollisionChecker>(setting.database.robot_images(),
                                                          viewed.scene.obstacle_images, policy,
                                                          SupportFor(served, policy)));
  }
  return policies;
}

TrialResult Judge(const TrialSetting& setting, const ViewedScene& viewed, int number) {
  TrialResult result;
  result.tallies.resize(setting.policies.size());
  result.blocked = viewed.scene.Blocked();
  if (result.blocked != Reason::kNone) return result;

  const ContactChecker contact(setting.workplace.robot(), viewed.truth.obstacles);
  const Poses obstacles = ObstaclePoses(viewed.truth.obstacles, 0);
  const auto policies = CheckersOf(setting, viewed);
  const std::vector<Test> tests = TestsOf(setting, number);
  std::vector<Answer> answers(tests.size());
  ParallelFor((tests.size() + kAtOnce - 1) / kAtOnce, [&](size_t part) {
    for (size_t i = part * kAtOnce; i < std::min(tests.size(), (part + 1) * kAtOnce); ++i) {
      const Configuration& q = tests[i].configuration;
      answers[i].touches = contact.Touches(setting.workplace.LinkPoses(q), obstacles);
      for (const auto& policy : policies) answers[i].verdicts.push_back(policy->Check(q));
    }
  });
  for (size_t i = 0; i < tests.size(); ++i) {
    const auto& [touches, verdicts] = answers[i];
    MissedConfiguration missed{tests[i].configuration, tests[i].where, {}};
    for (size_t p = 0; p < policies.size(); ++p) {
      const bool free = verdicts[p].free();
      const bool is_missed = touches && free;
      const bool is_flagged = is_missed && verdicts[p].hidden_possible();
      result.tallies[p][tests[i].where].Add({.tested = 1,
                                             .occupied = touches ? 1u : 0u,
                                             .additional = !touches && !free ? 1u : 0u,
                                             .missing = is_missed ? 1u : 0u,
                                             .flagged = is_flagged ? 1u : 0u});
      if (is_missed) missed.policies.push_back(p);
    }
    if (!missed.policies.empty()) result.missed.push_back(std::move(missed));
  }
  return result;
}

absl::Status CheckMinViews(const std::vector<int>& min_views, int views) {
  for (const int threshold : min_views) {
    if (threshold < 1 || threshold > views) {
      return InvalidArgument("min_views is ", threshold, ", and the cell has ", views,
                             " views; state 1 to ", views);
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<Policy>> PoliciesFor(const std::vector<std::string>& presets,
                                                const std::vector<int>& min_views,
                                                const Policy& of_cell,
                                                const ServedDatabase& database) {
  const int views = database.views();
  Policy policy = of_cell;
  policy.preset = Preset::kUncalibrated;
  const int least = MinViews(policy, views);
  std::vector<Policy> policies;
  for (const Preset preset : AllPresets()) {
    const bool named = std::ranges::count(presets, NameOf(preset)) > 0;
    if (!presets.empty() && !named) continue;
    if (absl::Status status = database.CanServe({.preset = preset}); !status.ok()) {
      if (named) return status;
      continue;
    }
    std::vector<int> thresholds = min_views;
    if (IsSound(preset) || (min_views.empty() && preset == Preset::kPaper)) {
      thresholds = {views};
    } else if (min_views.empty()) {
      thresholds = {least};
      // Without a calibration `paper` differs from `uncalibrated` in nothing else.
      if (IsCalibrated(preset) && least < views) thresholds.push_back(views);
    }
    for (const int threshold : thresholds) {
      policies.push_back({.preset = preset,
                          .min_views = threshold,
                          .max_occluded_views = of_cell.max_occluded_views});
    }
  }
  return policies;
}

}  // namespace silhouette::cell_experiment
