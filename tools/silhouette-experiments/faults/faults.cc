// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/faults/faults.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iterator>
#include <list>
#include <map>
#include <memory>
#include <numbers>
#include <opencv2/core.hpp>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "calib/robot/triangle_mesh.h"
#include "capture/segmentation/deviating_pixels.h"
#include "capture/segmentation/difference.h"
#include "capture/segmentation/image_condition.h"
#include "capture/sim/chance.h"
#include "capture/sim/simulated_cell.h"
#include "common/numbers/numbers.h"
#include "db/mask/interpolation.h"
#include "server/live/proof_of_life.h"
#include "server/scene/view_check.h"

namespace silhouette::faults_experiment {
namespace {

using cell_experiment::SimulatedWorkplace;

constexpr double kWalked = 0.65;   // share of the room: not close before a camera
constexpr double kWalk = 1.2;      // metres a second
constexpr int kPoses = 12;         // of the robot, in turn
constexpr double kPoseTime = 10;   // seconds to and in each
constexpr double kRobotSpeed = 1;  // radians a second, of the joint that moves farthest
constexpr double kTurn = 1;        // degrees, of a camera
constexpr double kRobotError = 8;  // degrees, of the first joint
// How a camera freezes where the robot leaves a pose (Watcher::Freeze).
constexpr const char* kFreezes[] = {"still image with noise, until the robot stands again",
                                    "loop with people, until the robot stands again"};
constexpr double kLoop = 37;  // seconds by which the loop is late
constexpr char kFrozen[] = "frozen";
constexpr char kExchanged[] = "two views exchanged";
constexpr double kDegree = std::numbers::pi / 180;
// How far poses keep from the joints' limits: degrees, but at most a share of a joint's range.
constexpr double kFromLimits = 10;
constexpr double kMostFromLimits = 0.05;

using Images = std::vector<CameraImage>;

cv::Mat Pixels(const CameraImage& image) {
  return {image.height, image.width, image.channels == 1 ? CV_8UC1 : CV_8UC3,
          const_cast<uint8_t*>(image.pixels.data())};
}

// People of all sizes, clothes and ways, who never stop.
std::vector<Obstacle> Walkers(Chance& chance, int people, const Room& room, double duration) {
  std::vector<Obstacle> walkers;
  for (int i = 0; i < people; ++i) {
    Obstacle person;
    const double length = chance.Uniform(1.0, 1.4);
    person.name = "person";
    person.mesh = CapsuleMesh(chance.Uniform(0.17, 0.27), length);
    person.brightness = chance.Uniform(0.02, 0.95);
    double time = 0;
    const auto place = [&] {
      return Eigen::Vector3d(chance.Uniform(kWalked * room.lower.x(), kWalked * room.upper.x()),
                             chance.Uniform(kWalked * room.lower.y(), kWalked * room.upper.y()),
                             0.9);
    };
    person.waypoints.push_back({0, place()});
    while (time < duration) {
      const Eigen::Vector3d next = place();
      time += std::max(0.5, (next - person.waypoints.back().position).norm() / kWalk);
      person.waypoints.push_back({time, next});
    }
    walkers.push_back(std::move(person));
  }
  return walkers;
}

struct Pose {
  bool leaves = false;  // the robot has just begun to move
  std::vector<double> positions;
  std::vector<double> wrong;  // kRobotError away
  std::vector<RobotCover> covers;
};

// The cell, its references, and where the robot stands in turn.
class WatchedCell {
 public:
  WatchedCell(const SimulatedWorkplace& workplace, const WatchSettings& settings)
      : workplace_(workplace), settings_(settings), chance_(settings.seed) {
    SimulationSettings simulation = workplace.simulation().settings();
    simulation.boards.clear();
    simulation.drift_amplitude = 0.05;
    simulation.flicker_amplitude = 0.005;
    cell_ = std::make_unique<SimulatedCell>(workplace.robot(), simulation);
    without_people_ = std::make_unique<SimulatedCell>(workplace.robot(), simulation);
    room_ = simulation.room;
    const Eigen::Vector3d turns[] = {Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(),
                                     Eigen::Vector3d::UnitZ(), 4 * Eigen::Vector3d::UnitY()};
    for (const Eigen::Vector3d& turn : turns) {
      SimulationSettings turned = simulation;
      const Eigen::Isometry3d turn_by(
          Eigen::AngleAxisd(turn.norm() * kTurn * kDegree, turn.normalized()));
      for (SimulatedCamera& camera : turned.cameras) {
        camera.model =
            CameraModel(camera.model.intrinsics(), turn_by * camera.model.camera_from_world());
      }
      turned_.push_back(std::make_unique<SimulatedCell>(workplace.robot(), turned));
    }
    TakeReferences();
    const ConfigurationGrid& grid = workplace.cell().grid;
    for (int i = 0; i < kPoses; ++i) {
      Configuration& stand = stands_.emplace_back();
      for (const GridJoint& joint : grid.joints()) {
        const double away =
            std::min(kFromLimits * kDegree, kMostFromLimits * (joint.upper - joint.lower));
        stand.push_back(chance_.Uniform(joint.lower + away, joint.upper - away));
      }
      for (const ConfigurationNumber corner : grid.CornersAround(stand).numbers()) MasksAt(corner);
    }
    const auto walkers = Walkers(chance_, settings.people, room_, 60 * settings.minutes);
    cell_->SetObstacles(walkers);
    for (const auto& turned : turned_) turned->SetObstacles(walkers);
  }

  size_t views() const { return references_.size(); }
  const Reference& reference(size_t view) const { return references_[view]; }
  std::span<const Outline> outlines() const { return outlines_; }
  // What the robot covers wherever it was.
  const Mask& base(size_t view) const { return bases_[view]; }
  // On the straight way from one stand to the next, or there. Covers are those of the corners
  // around, as in a scene.
  Pose PoseAt(double time) {
    const auto turn = static_cast<size_t>(time / kPoseTime);
    const Configuration& from = stands_[turn % stands_.size()];
    const Configuration& to = stands_[(turn + 1) % stands_.size()];
    double way = 0;
    for (size_t i = 0; i < to.size(); ++i) way = std::max(way, std::abs(to[i] - from[i]));
    const double moved = kRobotSpeed * (time - static_cast<double>(turn) * kPoseTime);
    const Configuration q = moved < way ? Interpolated(from, to, moved / way) : to;
    Configuration wrong = q;
    wrong[0] += kRobotError * kDegree;
    Pose pose{turn != last_turn_, workplace_.Positions(q), workplace_.Positions(wrong), {}};
    last_turn_ = turn;
    const CellCorners corners = workplace_.cell().grid.CornersAround(q);
    for (const ConfigurationNumber corner : corners.numbers()) {
      const std::vector<Mask>& masks = MasksAt(corner);
      for (size_t view = 0; view < masks.size(); ++view) {
        if (pose.covers.size() == view) pose.covers.push_back({masks[view], masks[view]});
        RobotCover& cover = pose.covers[view];
        cover = {cover.anywhere | masks[view], cover.certain & masks[view]};
      }
    }
    return pose;
  }
  // Where the robot has come to at the end of a turn, some turns later.
  std::vector<double> StandAfter(double time, size_t turns) const {
    const auto turn = static_cast<size_t>(time / kPoseTime);
    return workplace_.Positions(stands_[(turn + turns) % stands_.size()]);
  }
  cv::Mat ForegroundOf(const CameraImage& image, size_t view) const {
    return GradedForeground(Pixels(image), references_[view], workplace_.cell().segmentation);
  }
  Mask MaskOf(const cv::Mat& foreground, size_t view) const {
    return Graded(foreground, workplace_.cell().views[view].mask_size,
                  workplace_.cell().segmentation.min_cover)
        .all;
  }
  Mask MaskOf(const CameraImage& image, size_t view) const {
    return MaskOf(ForegroundOf(image, view), view);
  }

  Images Take(double time, std::span<const double> robot) { return TakeWith(*cell_, time, robot); }
  Images TakeTurned(size_t axis, double time, std::span<const double> robot) {
    return TakeWith(*turned_[axis], time, robot);
  }

 private:
  Images TakeWith(SimulatedCell& cell, double time, std::span<const double> robot) const {
    cell.SetTime(time);
    cell.SetPositions(robot);
    return cell.TakeImages(workplace_.cameras());
  }

  void TakeReferences() {
    cell_->SetRobotPresent(false);
    std::vector<Images> sets;
    for (int i = 0; i < settings_.reference_images; ++i) {
      sets.push_back(cell_->TakeImages(workplace_.cameras()));
    }
    for (size_t view = 0; view < workplace_.cameras().size(); ++view) {
      std::vector<cv::Mat> pictures;
      for (const Images& set : sets) pictures.push_back(Pixels(set[view]));
      references_.push_back(Reference::FromImages(pictures));
      outlines_.emplace_back(references_.back());
    }
    cell_->SetRobotPresent(true);
  }

  // The robot image of a configuration.
  const std::vector<Mask>& MasksAt(ConfigurationNumber number) {
    const auto [at, added] = masks_.try_emplace(number);
    if (!added) return at->second;
    const Configuration q = workplace_.cell().grid.At(number);
    const Images images = TakeWith(*without_people_, 0, workplace_.Positions(q));
    for (size_t view = 0; view < images.size(); ++view) {
      at->second.push_back(MaskOf(images[view], view));
      if (bases_.size() == view) bases_.push_back(at->second.back());
      bases_[view] = bases_[view] & at->second.back();
    }
    return at->second;
  }

  const SimulatedWorkplace& workplace_;
  const WatchSettings& settings_;
  Chance chance_;
  Room room_;
  std::unique_ptr<SimulatedCell> cell_;
  std::unique_ptr<SimulatedCell> without_people_;
  std::vector<std::unique_ptr<SimulatedCell>> turned_;  // all cameras turned
  std::vector<Reference> references_;
  std::vector<Outline> outlines_;
  std::vector<Configuration> stands_;
  size_t last_turn_ = 0;
  std::map<ConfigurationNumber, std::vector<Mask>> masks_;  // of robot images
  std::vector<Mask> bases_;
};

// What a fault makes of the images of a good scene.
struct Fault {
  std::string name;
  std::function<Images(WatchedCell& cell, Images good, double time, const Pose& pose, size_t view,
                       Chance& chance)>
      images;
};

Images Scaled(Images images, double factor, double offset, double sigma, Chance& chance) {
  for (CameraImage& image : images) {
    for (uint8_t& level : image.pixels) {
      level = cv::saturate_cast<uint8_t>(factor * level + offset +
                                         (sigma > 0 ? sigma * chance.Normal() : 0));
    }
  }
  return images;
}

// Those that `views` views can have.
std::vector<Fault> Faults(size_t views) {
  const auto scaled = [](double factor, double offset, double sigma) {
    return [=](WatchedCell&, Images good, double, const Pose&, size_t, Chance& chance) {
      return Scaled(std::move(good), factor, offset, sigma, chance);
    };
  };
  const auto turned = [](size_t axis) {
    return
        [=](WatchedCell& cell, Images good, double time, const Pose& pose, size_t view, Chance&) {
          good[view] = cell.TakeTurned(axis, time, pose.positions)[view];
          return good;
        };
  };
  const auto one = [](double factor, double offset, double sigma) {
    return [=](WatchedCell&, Images good, double, const Pose&, size_t view, Chance& chance) {
      good[view] = Scaled({good[view]}, factor, offset, sigma, chance)[0];
      return good;
    };
  };
  std::vector<Fault> faults = {
      {"light off", scaled(0.02, 0, 1.5)},
      {"light halved", scaled(0.5, 0, 0)},
      {"light doubled", scaled(2, 0, 0)},
      {"all black", scaled(0, 0, 0)},
      {"all saturated", scaled(0, 255, 0)},
      {"a lens covered, dark", one(0, 15, 1.5)},
      {"a lens covered, grey", one(0, 90, 1.5)},
      {kExchanged,
       [](WatchedCell&, Images good, double, const Pose&, size_t view, Chance&) {
         std::swap(good[view], good[(view + 1) % good.size()]);
         return good;
       }},
      {"a camera turned by 1 degree, up", turned(0)},
      {"a camera turned by 1 degree, sideways", turned(1)},
      {"a camera turned by 1 degree, about its axis", turned(2)},
      {"a camera turned by 4 degrees, sideways", turned(3)},
      {"robot 8 degrees from where it says",
       [](WatchedCell& cell, Images, double time, const Pose& pose, size_t, Chance&) {
         return cell.Take(time, pose.wrong);
       }},
      {"no robot where it says", [](WatchedCell& cell, Images, double time, const Pose&, size_t,
                                    Chance&) { return cell.Take(time, cell.StandAfter(time, 4)); }},
  };
  if (views == 1) {
    std::erase_if(faults, [](const Fault& fault) { return fault.name == kExchanged; });
  }
  return faults;
}

double Microseconds(std::chrono::steady_clock::duration time) {
  return std::chrono::duration<double, std::micro>(time).count();
}

class Watcher {
 public:
  Watcher(const SimulatedWorkplace& workplace, const WatchSettings& settings)
      : cell_(workplace, settings),
        checks_(workplace.cell().server.scene),
        life_settings_(workplace.cell().server.live.life),
        life_(life_settings_, std::vector<bool>(cell_.views(), true)) {
    for (const ViewSettings& view : workplace.cell().views) names_.push_back(view.name);
    result_.none.name = "nothing";
    for (const Fault& fault : faults_) result_.faults.push_back({.name = fault.name});
    for (const char* name : kFreezes) result_.faults.push_back({.name = name});
  }

  // A scene without a fault; then, if it is a fault's turn, with it in the view `view`.
  void Scene(double time, std::optional<size_t> fault, size_t view, Chance& chance) {
    const Pose pose = cell_.PoseAt(time);
    const Images images = cell_.Take(time, pose.positions);
    Good(images, time, pose);
    if (pose.leaves && last_) Freeze();
    Frozen(time, pose, chance);
    last_ = Last{time, pose, images};
    if (!fault) return;
    const Images faulty = faults_[*fault].images(cell_, images, time, pose, view, chance);
    Count(ReasonsOf(faulty, pose, nullptr), result_.faults[*fault]);
  }

  size_t views() const { return cell_.views(); }
  // Those of single scenes.
  size_t faults() const { return faults_.size(); }

  WatchResult Result() {
    result_.condition_time = Median(condition_times_);
    result_.life_time = Median(life_times_);
    return result_;
  }

 private:
  struct Last {
    double time = 0;
    Pose pose;
    Images images;
  };
  // Passes for a live one.
  struct FrozenCamera {
    size_t way = 0;
    size_t view = 0;
    Last from;
    ProofOfLife life;
  };

  bool Lives(FrozenCamera& frozen, const CameraImage& image, const Pose& pose) const {
    const Reference& reference = cell_.reference(frozen.view);
    return frozen.life.Judge(0, image, reference).ok() &&
           frozen.life
               .JudgeMotion(0, pose.covers[frozen.view], cell_.MaskOf(image, frozen.view),
                            reference)
               .ok();
  }

  static void Count(const std::set<std::string>& reasons, FaultRow& row) {
    ++row.tried;
    row.found += reasons.empty() ? 0 : 1;
    for (const std::string& reason : reasons) ++row.reasons[reason];
  }

  void Good(const Images& images, double time, const Pose& pose) {
    std::set<std::string> reasons = ReasonsOf(images, pose, &result_);
    for (size_t view = 0; view < images.size(); ++view) {
      const auto before = std::chrono::steady_clock::now();
      absl::Status alive = life_.Judge(view, images[view], cell_.reference(view));
      life_times_.push_back(Microseconds(std::chrono::steady_clock::now() - before));
      if (alive.ok()) {
        alive = life_.JudgeMotion(view, pose.covers[view], masks_[view], cell_.reference(view));
      }
      if (alive.ok()) continue;
      reasons.insert(kFrozen);
      messages_.push_back(absl::StrCat("view '", names_[view], "': ", alive.message()));
    }
    Count(reasons, result_.none);
    if (!reasons.empty() && !alarmed_) {
      result_.alarms.push_back(absl::StrFormat("%.1f s: %s", time, absl::StrJoin(messages_, "; ")));
    }
    alarmed_ = !reasons.empty();
  }

  // `extremes`: gets what came near to the limits, if it is not null.
  std::set<std::string> ReasonsOf(const Images& images, const Pose& pose, WatchResult* extremes) {
    std::set<std::string> reasons;
    messages_.clear();
    masks_.clear();
    std::vector<cv::Mat> foregrounds;
    for (size_t view = 0; view < images.size(); ++view) {
      foregrounds.push_back(cell_.ForegroundOf(images[view], view));
      masks_.push_back(cell_.MaskOf(foregrounds.back(), view));
    }
    std::vector<ImageCondition> conditions(images.size());
    std::vector<ViewToCheck> checked;
    for (size_t view = 0; view < images.size(); ++view) {
      const auto before = std::chrono::steady_clock::now();
      conditions[view] =
          ConditionOf(Pixels(images[view]), foregrounds[view] > kShadow, cell_.outlines(), view);
      condition_times_.push_back(Microseconds(std::chrono::steady_clock::now() - before));
      checked.push_back({.name = names_[view],
                         .condition = &conditions[view],
                         .foreground = &masks_[view],
                         .robot = &pose.covers[view],
                         .base = &cell_.base(view)});
      const Mask missing = checked.back().robot->certain - masks_[view];
      const auto pixels = static_cast<double>(missing.size().pixels());
      if (static_cast<double>(Core(missing).Count()) > checks_.max_core_error * pixels) {
        reasons.insert(NameOf(Reason::kErrorArea));
        messages_.push_back(absl::StrCat("view '", names_[view], "': error area"));
      }
      if (extremes != nullptr) Extend(*extremes, checked.back(), missing);
    }
    for (const SceneDefect& defect : CheckViews(checked, names_, checks_.view_check)) {
      reasons.insert(NameOf(defect.reason));
      messages_.push_back(defect.message);
    }
    return reasons;
  }

  // The robot leaves where it stood in the last scene. Every camera freezes there, in every way.
  void Freeze() {
    frozen_.clear();
    for (size_t way = 0; way < std::size(kFreezes); ++way) {
      result_.faults[faults_.size() + way].tried += static_cast<int>(cell_.views());
      for (size_t view = 0; view < cell_.views(); ++view) {
        frozen_.push_back({way, view, *last_, ProofOfLife(life_settings_, {true})});
        (void)Lives(frozen_.back(), last_->images[view], last_->pose);
      }
    }
  }

  // What the frozen cameras that pass for live ones show now, and whether they still do.
  void Frozen(double time, const Pose& pose, Chance& chance) {
    if (frozen_.empty() || pose.leaves) return;
    if (pose.positions == last_->pose.positions) return frozen_.clear();
    const Images loop = cell_.Take(time + kLoop, frozen_.front().from.pose.positions);
    std::erase_if(frozen_, [&](FrozenCamera& frozen) {
      CameraImage image = loop[frozen.view];
      if (frozen.way == 0) image = Scaled({frozen.from.images[frozen.view]}, 1, 0, 1.5, chance)[0];
      image.captured = absl::UnixEpoch() + absl::Seconds(time);
      if (Lives(frozen, image, pose)) return false;
      FaultRow& row = result_.faults[faults_.size() + frozen.way];
      ++row.found;
      ++row.reasons[kFrozen];
      row.after.push_back(time - frozen.from.time);
      return true;
    });
  }

  static void Extend(WatchResult& extremes, const ViewToCheck& view, const Mask& missing) {
    const ImageCondition& condition = *view.condition;
    extremes.least_gain = std::min(extremes.least_gain, condition.gain);
    extremes.greatest_gain = std::max(extremes.greatest_gain, condition.gain);
    extremes.least_structure = std::min(extremes.least_structure, condition.structure.value_or(1));
    extremes.greatest_shift = std::max(extremes.greatest_shift, condition.shift);
    const auto share = [](const Mask& part, const Mask& whole) {
      return static_cast<double>(part.Count()) /
             static_cast<double>(std::max<size_t>(1, whole.Count()));
    };
    extremes.greatest_foreground =
        std::max(extremes.greatest_foreground,
                 share(*view.foreground - view.robot->anywhere, ~Mask(missing.size())));
    extremes.greatest_robot_missing =
        std::max(extremes.greatest_robot_missing,
                 share(missing - *view.base, view.robot->certain - *view.base));
  }

  WatchedCell cell_;
  const SceneSettings checks_;
  const LifeSettings life_settings_;
  ProofOfLife life_;
  const std::vector<Fault> faults_ = Faults(cell_.views());
  std::vector<std::string> names_;
  std::vector<Mask> masks_;            // of the newest images
  std::vector<std::string> messages_;  // of their defects
  std::optional<Last> last_;           // scene without a fault
  std::list<FrozenCamera> frozen_;
  std::vector<double> condition_times_;
  std::vector<double> life_times_;
  WatchResult result_;
  bool alarmed_ = false;  // by the newest scene without a fault
};

}  // namespace

int ScenesOf(const WatchSettings& settings) {
  return static_cast<int>(60 * settings.minutes / settings.interval);
}

WatchResult Watch(const SimulatedWorkplace& workplace, const WatchSettings& settings,
                  const std::function<bool()>& stop, const std::function<void(int)>& done) {
  Watcher watcher(workplace, settings);
  Chance chance(settings.seed + 1);
  const int scenes = ScenesOf(settings);
  int taken = 0;
  for (; taken < scenes && !stop(); ++taken) {
    const double time = settings.interval * taken;
    // One fault after the other, and none for all views at once.
    const auto turn = static_cast<size_t>(taken % settings.fault_every);
    watcher.Scene(time, turn < watcher.faults() ? std::optional(turn) : std::nullopt,
                  chance.Index(watcher.views()), chance);
    done(taken + 1);
  }
  WatchResult result = watcher.Result();
  result.scenes = taken;
  result.hours = settings.interval * taken / 3600;
  return result;
}

}  // namespace silhouette::faults_experiment
