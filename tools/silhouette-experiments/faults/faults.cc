// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/faults/faults.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <numbers>
#include <opencv2/core.hpp>
#include <optional>
#include <set>
#include <utility>

#include "calib/robot/triangle_mesh.h"
#include "capture/segmentation/difference.h"
#include "capture/segmentation/image_condition.h"
#include "capture/sim/chance.h"
#include "capture/sim/simulated_cell.h"
#include "common/numbers/numbers.h"
#include "server/live/proof_of_life.h"
#include "server/scene/view_check.h"

namespace silhouette::faults_experiment {
namespace {

using cell_experiment::SimulatedWorkplace;

constexpr double kWalked = 0.65;   // share of the room: not close before a camera
constexpr double kWalk = 1.2;      // metres a second
constexpr int kPoses = 12;         // of the robot
constexpr double kPoseTime = 10;   // seconds in each
constexpr double kTurn = 1;        // degrees, of a camera
constexpr double kRobotError = 8;  // degrees, of the first joint
constexpr double kDegree = std::numbers::pi / 180;

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
    for (int i = 0; i < kPoses; ++i) poses_.push_back(NewPose());
    const auto walkers = Walkers(chance_, settings.people, room_, 60 * settings.minutes);
    cell_->SetObstacles(walkers);
    for (const auto& turned : turned_) turned->SetObstacles(walkers);
  }

  size_t views() const { return references_.size(); }
  const Reference& reference(size_t view) const { return references_[view]; }
  std::span<const Outline> outlines() const { return outlines_; }
  // What the robot covers in all its poses.
  const Mask& base(size_t view) const { return bases_[view]; }
  const Pose& PoseAt(double time) const {
    return poses_[static_cast<size_t>(time / kPoseTime) % poses_.size()];
  }
  Mask MaskOf(const CameraImage& image, size_t view) const {
    return Difference(Pixels(image), references_[view], workplace_.cell().segmentation,
                      workplace_.cell().views[view].mask_size);
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

  // Anywhere in the grid: covers are those of the corners around, as in a scene.
  Pose NewPose() {
    const ConfigurationGrid& grid = workplace_.cell().grid;
    Configuration q;
    for (const GridJoint& joint : grid.joints()) {
      q.push_back(chance_.Uniform(joint.lower + 10 * kDegree, joint.upper - 10 * kDegree));
    }
    Configuration wrong = q;
    wrong[0] += kRobotError * kDegree;
    Pose pose{workplace_.Positions(q), workplace_.Positions(wrong), {}};
    const CellCorners corners = grid.CornersAround(q);
    for (const ConfigurationNumber corner : corners.numbers()) {
      const Images images = Take(0, workplace_.Positions(grid.At(corner)));
      for (size_t view = 0; view < images.size(); ++view) {
        const Mask mask = MaskOf(images[view], view);
        if (bases_.size() == view) bases_.push_back(mask);
        bases_[view] = bases_[view] & mask;
        if (pose.covers.size() == view) {
          pose.covers.push_back({mask, mask});
        } else {
          pose.covers[view] = {pose.covers[view].anywhere | mask, pose.covers[view].certain & mask};
        }
      }
    }
    return pose;
  }

  const SimulatedWorkplace& workplace_;
  const WatchSettings& settings_;
  Chance chance_;
  Room room_;
  std::unique_ptr<SimulatedCell> cell_;
  std::vector<std::unique_ptr<SimulatedCell>> turned_;  // all cameras turned
  std::vector<Reference> references_;
  std::vector<Outline> outlines_;
  std::vector<Pose> poses_;
  std::vector<Mask> bases_;
};

// What a fault makes of the images of a good scene.
struct Fault {
  std::string name;
  std::function<Images(WatchedCell& cell, Images good, double time, size_t view, Chance& chance)>
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

std::vector<Fault> Faults() {
  const auto scaled = [](double factor, double offset, double sigma) {
    return [=](WatchedCell&, Images good, double, size_t, Chance& chance) {
      return Scaled(std::move(good), factor, offset, sigma, chance);
    };
  };
  const auto turned = [](size_t axis) {
    return [=](WatchedCell& cell, Images good, double time, size_t view, Chance&) {
      good[view] = cell.TakeTurned(axis, time, cell.PoseAt(time).positions)[view];
      return good;
    };
  };
  const auto one = [](double factor, double offset, double sigma) {
    return [=](WatchedCell&, Images good, double, size_t view, Chance& chance) {
      good[view] = Scaled({good[view]}, factor, offset, sigma, chance)[0];
      return good;
    };
  };
  return {
      {"light off", scaled(0.02, 0, 1.5)},
      {"light halved", scaled(0.5, 0, 0)},
      {"light doubled", scaled(2, 0, 0)},
      {"all black", scaled(0, 0, 0)},
      {"all saturated", scaled(0, 255, 0)},
      {"a lens covered, dark", one(0, 15, 1.5)},
      {"a lens covered, grey", one(0, 90, 1.5)},
      {"two views exchanged",
       [](WatchedCell&, Images good, double, size_t view, Chance&) {
         std::swap(good[view], good[(view + 1) % good.size()]);
         return good;
       }},
      {"a camera turned by 1 degree, up", turned(0)},
      {"a camera turned by 1 degree, sideways", turned(1)},
      {"a camera turned by 1 degree, about its axis", turned(2)},
      {"a camera turned by 4 degrees, sideways", turned(3)},
      {"robot 8 degrees from where it says",
       [](WatchedCell& cell, Images, double time, size_t, Chance&) {
         return cell.Take(time, cell.PoseAt(time).wrong);
       }},
      {"no robot where it says",
       [](WatchedCell& cell, Images, double time, size_t, Chance&) {
         return cell.Take(time, cell.PoseAt(time + 3 * kPoseTime).positions);
       }},
  };
}

double Microseconds(std::chrono::steady_clock::duration time) {
  return std::chrono::duration<double, std::micro>(time).count();
}

class Watcher {
 public:
  Watcher(const SimulatedWorkplace& workplace, const WatchSettings& settings)
      : cell_(workplace, settings),
        checks_(workplace.cell().server.scene),
        life_(workplace.cell().server.live.life, std::vector<bool>(cell_.views(), true)) {
    for (const ViewSettings& view : workplace.cell().views) names_.push_back(view.name);
    result_.none.name = "nothing";
    for (const Fault& fault : faults_) result_.faults.push_back({.name = fault.name});
  }

  void Good(const Images& images, double time) {
    std::set<std::string> reasons = ReasonsOf(images, time, &result_);
    for (size_t view = 0; view < images.size(); ++view) {
      const auto before = std::chrono::steady_clock::now();
      absl::Status alive = life_.Judge(view, images[view], cell_.reference(view));
      life_times_.push_back(Microseconds(std::chrono::steady_clock::now() - before));
      if (alive.ok()) {
        alive = life_.JudgeMotion(view, cell_.PoseAt(time).covers[view], masks_[view],
                                  cell_.reference(view));
      }
      if (!alive.ok()) reasons.insert("frozen");
    }
    Count(reasons, result_.none);
    result_.alarms += !reasons.empty() && !alarmed_ ? 1 : 0;
    alarmed_ = !reasons.empty();
  }

  void Faulty(size_t fault, const Images& good, double time, size_t view, Chance& chance) {
    const Images images = faults_[fault].images(cell_, good, time, view, chance);
    Count(ReasonsOf(images, time, nullptr), result_.faults[fault]);
  }

  WatchedCell& cell() { return cell_; }
  size_t faults() const { return faults_.size(); }

  WatchResult Result() {
    result_.condition_time = Median(condition_times_);
    result_.life_time = Median(life_times_);
    return result_;
  }

 private:
  static void Count(const std::set<std::string>& reasons, FaultRow& row) {
    ++row.tried;
    row.found += reasons.empty() ? 0 : 1;
    for (const std::string& reason : reasons) ++row.reasons[reason];
  }

  // `extremes`: gets what came near to the limits, if it is not null.
  std::set<std::string> ReasonsOf(const Images& images, double time, WatchResult* extremes) {
    std::set<std::string> reasons;
    masks_.clear();
    for (size_t view = 0; view < images.size(); ++view) {
      masks_.push_back(cell_.MaskOf(images[view], view));
    }
    std::vector<ImageCondition> conditions(images.size());
    std::vector<ViewToCheck> checked;
    for (size_t view = 0; view < images.size(); ++view) {
      const auto before = std::chrono::steady_clock::now();
      conditions[view] = ConditionOf(Pixels(images[view]), cell_.outlines(), view);
      condition_times_.push_back(Microseconds(std::chrono::steady_clock::now() - before));
      checked.push_back({.name = names_[view],
                         .condition = &conditions[view],
                         .foreground = &masks_[view],
                         .robot = &cell_.PoseAt(time).covers[view],
                         .base = &cell_.base(view)});
      const Mask missing = checked.back().robot->certain - masks_[view];
      const auto pixels = static_cast<double>(missing.size().pixels());
      if (static_cast<double>(Core(missing).Count()) > checks_.max_core_error * pixels) {
        reasons.insert(NameOf(Reason::kErrorArea));
      }
      if (extremes != nullptr) Extend(*extremes, checked.back(), missing);
    }
    for (const SceneDefect& defect : CheckViews(checked, names_, checks_.view_check)) {
      reasons.insert(NameOf(defect.reason));
    }
    return reasons;
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
  ProofOfLife life_;
  const std::vector<Fault> faults_ = Faults();
  std::vector<std::string> names_;
  std::vector<Mask> masks_;  // of the newest images
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
    const Images images = watcher.cell().Take(time, watcher.cell().PoseAt(time).positions);
    watcher.Good(images, time);
    // One fault after the other, and none for all views at once.
    const int turn = taken % settings.fault_every;
    if (turn < static_cast<int>(watcher.faults())) {
      watcher.Faulty(static_cast<size_t>(turn), images, time, chance.Index(watcher.cell().views()),
                     chance);
    }
    done(taken + 1);
  }
  WatchResult result = watcher.Result();
  result.scenes = taken;
  result.hours = settings.interval * taken / 3600;
  return result;
}

}  // namespace silhouette::faults_experiment
