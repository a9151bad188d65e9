// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/people/episode.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/str_format.h"
#include "db/status/status_macros.h"
#include "server/scene/make_scene.h"

namespace silhouette::people_experiment {
namespace {

// Of truth.
constexpr int kTicksOfDecision = 2;
// Of picking or placing, seconds.
constexpr double kDwell = 0.5;
// Between two plans.
constexpr int kDecisionsOfPlan = 3;
// Where the stations are, as shares of the joints' ranges.
constexpr double kFirstStation = 0.25;
constexpr double kSecondStation = 0.75;
constexpr double kOtherJoints = 0.4;

double ThreadSeconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// A number of a stream of chance: unrelated ones for all arguments.
uint64_t StreamOf(uint64_t seed, uint64_t episode, uint64_t use) {
  uint64_t mixed = seed * 0x9E3779B97F4A7C15 + episode * 0xBF58476D1CE4E5B9 + use;
  for (int i = 0; i < 2; ++i) {
    mixed = (mixed ^ mixed >> 31) * 0x94D049BB133111EB;
  }
  return mixed ^ mixed >> 29;
}

class Episode {
 public:
  Episode(const Stage& stage, const EpisodeSettings& settings, int episode, Method& method,
          Video* video)
      : stage_(stage),
        settings_(settings),
        method_(method),
        video_(video),
        people_(PeopleOf(stage, settings, episode)),
        times_(people_.size(), 0),
        truth_(stage.workplace(), stage.robot(), people_.size()),
        masks_(stage.robot(),
               stage.database()->robot_images().drawn() == nullptr
                   ? &stage.database()->robot_images()
                   : nullptr,
               settings.errors),
        chance_(StreamOf(settings.seed, static_cast<uint64_t>(episode), 2)),
        robot_(
            stage.stations().front(),
            [this](auto from, auto to) { return FastestMovement(stage_.robot(), from, to); },
            stage.rule().acceleration),
        tick_(stage.rule().period / kTicksOfDecision) {
    if (!settings.rendered || (!method.preset() && video == nullptr)) return;
    rendered_.emplace(stage.workplace(), stage.database(), people_.size(),
                      StreamOf(settings.seed, static_cast<uint64_t>(episode), 3));
  }

  absl::StatusOr<Counts> Run(const Stop& stop) {
    const double began = ThreadSeconds();
    counts_.episodes = 1;
    const auto ticks = static_cast<int64_t>(std::round(settings_.seconds / tick_));
    for (int64_t tick = 0; tick < ticks; ++tick) {
      now_ = tick_ * static_cast<double>(tick);
      truth_.Set(people_, times_);
      if (tick % kTicksOfDecision == 0) {
        if (Stopped(stop)) return absl::CancelledError("stopped; the same command goes on");
        RETURN_IF_ERROR(Decide());
        if (video_ != nullptr) Film();
      }
      Count();
      Move();
    }
    NoteReaction();
    counts_.processor_seconds = ThreadSeconds() - began;
    return counts_;
  }

 private:
  static std::vector<Person> PeopleOf(const Stage& stage, const EpisodeSettings& settings,
                                      int episode) {
    Chance chance(StreamOf(settings.seed, static_cast<uint64_t>(episode), 1));
    return RandomPeople(chance,
                        {.seconds = settings.seconds,
                         .fence = stage.rule().Fence(),
                         .floor = stage.workplace().simulation().settings().room.lower.z()});
  }

  Moment MomentAt(double seconds) const {
    return {absl::UnixEpoch() + absl::Seconds(seconds), absl::Seconds(seconds)};
  }

  absl::StatusOr<SharedScene> Look() {
    ++counts_.scenes;
    ASSIGN_OR_RETURN(SharedScene scene, rendered_ ? LookThroughCameras() : LookAtMasks());
    std::set<std::string> defects;
    if (scene == nullptr) {
      defects.insert("no scene");
    } else {
      for (const SceneDefect& defect : scene->defects) defects.insert(NameOf(defect.reason));
    }
    if (!defects.empty()) ++counts_.unusable;
    for (const std::string& defect : defects) ++counts_.defects[defect];
    return scene;
  }

  absl::StatusOr<SharedScene> LookThroughCameras() {
    Poses parts;
    for (size_t i = 0; i < people_.size(); ++i) people_[i].AppendPoses(times_[i], parts);
    ASSIGN_OR_RETURN(sight_, rendered_->Look(robot_.at(), parts, MomentAt(now_)));
    return sight_.scene;
  }

  absl::StatusOr<SharedScene> LookAtMasks() {
    const Cell& cell = stage_.workplace().cell();
    const Moment moment = MomentAt(now_);
    SceneInput input;
    for (size_t j = 0; j < robot_.at().size(); ++j) {
      input.joints.push_back({cell.grid.joints()[j].name, robot_.at()[j]});
    }
    for (const FixedJoint& joint : cell.fixed_joints) {
      input.joints.push_back({joint.name, joint.position});
    }
    const std::vector<Mask> masks = masks_.Draw(robot_.at(), truth_.parts(), chance_);
    for (size_t view = 0; view < masks.size(); ++view) {
      input.views.push_back({.view = stage_.database()->view_name(static_cast<int>(view)),
                             .captured = moment,
                             .image = SceneMask{.mask = masks[view]}});
    }
    ASSIGN_OR_RETURN(Scene scene, MakeScene(*stage_.database(), input, cell.server.scene,
                                            cell.segmentation, moment));
    return std::make_shared<const Scene>(std::move(scene));
  }

  Situation Now(const Checker* checker) {
    const SpeedRule& rule = stage_.rule();
    return {.time = now_,
            .robot = robot_,
            .truth = truth_,
            .checker = checker,
            .inside_fence = AnyInside(people_, times_, rule.Fence()),
            .inside_inner_fence = AnyInside(people_, times_, rule.InnerFence())};
  }

  const Configuration& Goal() const { return stage_.stations()[goal_]; }

  absl::Status Decide() {
    const SharedScene scene = std::exchange(seen_, nullptr);
    decision_ = {};
    // While it picks or places until after the next decision, only cameras go on.
    const double period = stage_.rule().period;
    if (rendered_ || (method_.preset() && now_ + 2 * period > dwells_until_)) {
      ASSIGN_OR_RETURN(seen_, Look());
    }
    if (now_ < dwells_until_) return absl::OkStatus();
    std::optional<Checker> checker;
    if (scene && method_.preset()) {
      Policy policy = stage_.workplace().cell().policy;
      policy.preset = *method_.preset();
      if (policy.preset == Preset::kPaper) policy.min_views.reset();
      checker.emplace(
          Served{.database = stage_.database(), .scene = scene, .without_scene = Reason::kNone},
          policy, stage_.workplace().cell().server.scene, MomentAt(now_));
    }
    const Situation situation = Now(checker ? &*checker : nullptr);
    const bool arrived_short = robot_.left() == 0;
    if (!arrived_short) decision_ = method_.Decide(situation);
    const bool blocked = arrived_short || decision_.speed == 0;
    since_plan_ += 1;
    const bool can_plan = !method_.preset() || checker;
    if (!blocked || !robot_.stands() || !can_plan || since_plan_ < kDecisionsOfPlan) {
      return absl::OkStatus();
    }
    std::vector<Configuration> way = method_.Plan(situation, stage_.joint_space(), Goal());
    since_plan_ = 0;
    if (way.size() < 2) return absl::OkStatus();
    robot_.Follow(std::move(way));
    decision_ = method_.Decide(situation);
    return absl::OkStatus();
  }

  bool AtGoal() const { return robot_.MovementOf(robot_.at(), Goal()) < kSamePlace; }

  // Robot and people, until the next tick.
  void Move() {
    const bool moved = !robot_.stands();
    robot_.Advance(tick_, decision_.speed);
    if (now_ >= dwells_until_ && robot_.stands() && AtGoal()) {
      counts_.cycles += 0.5;
      goal_ = (goal_ + 1) % stage_.stations().size();
      dwells_until_ = now_ + kDwell;
      since_plan_ = kDecisionsOfPlan;
    } else if (moved && robot_.stands()) {
      ++counts_.stops;
    }
    for (size_t i = 0; i < people_.size(); ++i) {
      if (!settings_.people_stop || MayStep(i)) times_[i] += tick_;
    }
  }

  bool MayStep(size_t person) {
    Truth then(stage_.workplace(), stage_.robot(), 0);
    const std::vector<double> next = {times_[person] + tick_};
    then.Set({&people_[person], 1}, next);
    return then.AtLeast(robot_.at()) > kPeopleStop;
  }

  void Count() {
    counts_.seconds += tick_;
    const Situation now = Now(nullptr);
    if (now.inside_fence) counts_.people_seconds += tick_;
    const bool moving = !robot_.stands();
    const bool touches = truth_.Touches(robot_.at());
    if (touches && !touches_) {
      ++counts_.contacts;
      moved_in_contact_ = false;
    }
    if (touches && moving && !std::exchange(moved_in_contact_, true)) ++counts_.contacts_moving;
    touches_ = touches;
    if (!moving) {
      NoteReaction();
      if (now_ >= dwells_until_) counts_.standing += tick_;
      return;
    }
    counts_.moving += tick_;
    const double distance = truth_.Distance(robot_.at(), kFarthest);
    const auto bin = static_cast<size_t>(distance / Counts::kBin);
    counts_.distances[std::min(bin, Counts::kBins - 1)] += tick_;
    counts_.least_over_stopping =
        std::min(counts_.least_over_stopping, distance - robot_.StoppingDistance());
    if (decision_.leaves) counts_.leaving += tick_;
    const bool too_fast = decision_.speed > method_.AllowedInTruth(now) &&
                          !(decision_.leaves && method_.LeadsAwayInTruth(now));
    if (too_fast) {
      counts_.too_fast += tick_;
      reaction_ += tick_;
    } else {
      NoteReaction();
    }
  }

  void Film() {
    const auto& levels = stage_.rule().separation.levels;
    const auto level = std::ranges::find(levels, decision_.speed, &SpeedLevel::speed);
    std::string allowed = level == levels.end() ? "stop" : level->name;
    if (decision_.leaves) allowed = "leaves";
    if (now_ < dwells_until_) allowed = "at a station";
    const double distance = truth_.Distance(robot_.at(), kFarthest);
    video_->Add(
        sight_, absl::StrFormat("%.1f s   speed level: %s", now_, allowed),
        absl::StrFormat("robot %.2f m/s   people %s%.2f m away", robot_.speed(),
                        distance < kFarthest ? "" : "more than ", std::min(distance, kFarthest)));
  }

  void NoteReaction() {
    if (reaction_ > 0) counts_.reactions.push_back(reaction_);
    reaction_ = 0;
  }

  // Metres.
  static constexpr double kSamePlace = 0.001;
  static constexpr double kFarthest = Counts::kBin * static_cast<double>(Counts::kBins);

  const Stage& stage_;
  const EpisodeSettings& settings_;
  Method& method_;
  Video* const video_;
  const std::vector<Person> people_;
  std::vector<double> times_;  // of their scripts
  Truth truth_;
  TrueMasks masks_;
  std::optional<RenderedCell> rendered_;
  Sight sight_;  // the newest of rendered_
  Chance chance_;
  PathFollower robot_;
  const double tick_;  // seconds
  Counts counts_;
  double now_ = 0;
  SharedScene seen_;  // for the next decision
  Decision decision_;
  size_t goal_ = 1;
  double dwells_until_ = 0;
  int since_plan_ = kDecisionsOfPlan;
  bool touches_ = false;
  bool moved_in_contact_ = false;
  double reaction_ = 0;
};

}  // namespace

double ReachOf(const SimulatedWorkplace& workplace) {
  const std::vector<BodyPart> parts = BodyPartsOf(workplace.robot());
  double reach = 0;
  const auto look_at = [&](const Configuration& q) {
    const Poses poses = workplace.LinkPoses(q);
    for (const BodyPart& part : parts) {
      for (const Eigen::Vector3d& vertex : part.mesh.vertices) {
        reach = std::max(reach, (poses[part.frame] * vertex).head<2>().norm());
      }
    }
  };
  const ConfigurationGrid& grid = workplace.cell().grid;
  if (!StatesAGrid(workplace.cell())) {
    constexpr int kRandomPlaces = 10'000;
    Chance chance(1);
    for (int i = 0; i < kRandomPlaces; ++i) {
      Configuration q;
      for (const GridJoint& joint : grid.joints()) {
        q.push_back(chance.Uniform(joint.lower, joint.upper));
      }
      look_at(q);
    }
    return reach;
  }
  // The first joint turns the arm about the base's axis at most, or it counts as the others.
  constexpr ConfigurationNumber kPlaces = 2000;
  const ConfigurationNumber step = std::max<ConfigurationNumber>(1, grid.number_limit() / kPlaces);
  for (ConfigurationNumber number = 0; number < grid.number_limit(); number += step) {
    if (grid.Contains(number)) look_at(grid.At(number));
  }
  return reach;
}

Stage::Stage(const SimulatedWorkplace& workplace, std::shared_ptr<const ServedDatabase> database,
             DrawnRobot robot, SpeedRule rule)
    : workplace_(&workplace),
      database_(std::move(database)),
      robot_(std::move(robot)),
      rule_(std::move(rule)) {
  for (const double share : {kFirstStation, kSecondStation}) {
    Configuration station;
    for (const GridJoint& joint : database_->grid().joints()) {
      const double place = station.empty() ? share : kOtherJoints;
      station.push_back(joint.lower + place * (joint.upper - joint.lower));
    }
    stations_.push_back(std::move(station));
  }
}

JointSpace Stage::joint_space() const {
  return {.grid = database_->grid(), .limits_only = !StatesAGrid(workplace_->cell())};
}

absl::StatusOr<Stage> Stage::Make(const SimulatedWorkplace& workplace,
                                  std::shared_ptr<const ServedDatabase> database, double rate) {
  ASSIGN_OR_RETURN(DrawnRobot robot, TrueRobot(workplace, database->robot_images().mask_sizes()));
  SpeedRule rule = DefaultRule(ReachOf(workplace), rate);
  if (database->separation() != nullptr) rule.leave_from = database->separation()->leave_from();
  return Stage(workplace, std::move(database), std::move(robot), std::move(rule));
}

absl::StatusOr<Counts> RunEpisode(const Stage& stage, const EpisodeSettings& settings, int episode,
                                  const std::string& method, const Stop& stop, Video* video) {
  const std::unique_ptr<Method> chosen = MakeMethod(method, stage.rule());
  return Episode(stage, settings, episode, *chosen, video).Run(stop);
}

}  // namespace silhouette::people_experiment
