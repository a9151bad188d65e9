// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/paper/study.h"

#include <algorithm>
#include <atomic>
#include <memory>
#include <stdexcept>

#include "common/parallel/parallel.h"
#include "tools/silhouette-experiments/paper/bulk_checker.h"
#include "tools/silhouette-experiments/paper/bulk_sound_checker.h"
#include "tools/silhouette-experiments/paper/sphere_cell.h"

namespace silhouette::paper {
namespace {

constexpr size_t kThresholds = 2;

// All that one robot is measured with, whatever the cameras: scenes, and the truth about them.
struct RobotScenes {
  RobotScenes(const Settings& settings, Variant variant) : arms(settings, variant) {
    parked = arms.Nearest(settings.parked);
    figure7 = settings.figure7;
    figure7_truth = arms.Touching(figure7);
    for (size_t i = 0; i < arms.size(); ++i) {
      if (!Contains(figure7_truth, i)) free.push_back(i);
    }
  }

  void AddRandom(const Settings& settings) {
    for (int i = 0; i < settings.random.count; ++i) {
      random.push_back(RandomScene(settings, arms, i));
      truth.push_back(arms.Touching(random.back().obstacles));
      off_grid_truth.push_back(
          arms.TouchingOffGrid(random.back().obstacles, random.back().offsets));
    }
  }

  ArmTable arms;
  Spheres figure7;
  size_t parked = 0;
  ConfigurationSet figure7_truth;
  std::vector<size_t> free;  // in Figure 7's scene
  std::vector<SphereScene> random;
  std::vector<ConfigurationSet> truth;
  std::vector<ConfigurationSet> off_grid_truth;
};

// By preset, threshold and number of views.
class Tallies {
 public:
  explicit Tallies(int views)
      : views_(static_cast<size_t>(views)),
        tallies_(AllPresets().size() * kThresholds * static_cast<size_t>(views)) {}

  Tally& At(Preset preset, Threshold threshold, int views) {
    const auto p = static_cast<size_t>(preset);
    const auto t = static_cast<size_t>(threshold);
    return tallies_[(p * kThresholds + t) * views_ + static_cast<size_t>(views) - 1];
  }
  void Merge(const Tallies& other) {
    for (size_t i = 0; i < tallies_.size(); ++i) tallies_[i].Merge(other.tallies_[i]);
  }

 private:
  size_t views_;
  std::vector<Tally> tallies_;
};

// A scene to be measured in a cell.
struct Part {
  Experiment experiment;
  size_t number;  // of the scene
};

std::vector<Part> PartsOf(const Selection& selection, const RobotScenes& scenes) {
  std::vector<Part> parts;
  for (Experiment experiment : selection.experiments) {
    size_t count = scenes.random.size();
    if (experiment == Experiment::kFigure7) count = 1;
    if (experiment == Experiment::kFigure7Occluded) count = scenes.free.size();
    for (size_t i = 0; i < count; ++i) parts.push_back({experiment, i});
  }
  return parts;
}

// Obstacle images, the robot meanwhile, images to test and the truth of one scene.
struct Trial {
  std::vector<ObstacleImage> images;
  Spheres robot;
  std::span<const TransposedImages> tests;
  ConfigurationWords truth;
};

Trial TrialOf(const SphereCell& cell, const RobotScenes& scenes, const Part& part) {
  const size_t i = part.number;
  if (part.experiment == Experiment::kFigure7) {
    return {cell.Look(scenes.figure7, scenes.parked), cell.arms().At(scenes.parked), cell.OnGrid(),
            scenes.figure7_truth};
  }
  if (part.experiment == Experiment::kFigure7Occluded) {
    return {cell.Look(scenes.figure7, scenes.free[i]), cell.arms().At(scenes.free[i]),
            cell.OnGrid(), scenes.figure7_truth};
  }
  const SphereScene& scene = scenes.random[i];
  if (part.experiment == Experiment::kCurrentOffGrid) {
    return {cell.LookOffGrid(scene.obstacles, scene.current_off_grid),
            cell.arms().AtJoints(scene.current_off_grid), cell.OnGrid(), scenes.truth[i]};
  }
  std::vector<ObstacleImage> images = cell.Look(scene.obstacles, scene.current);
  if (part.experiment == Experiment::kRandom) {
    return {std::move(images), cell.arms().At(scene.current), cell.OnGrid(), scenes.truth[i]};
  }
  return {std::move(images), cell.arms().At(scene.current), cell.InCells(),
          scenes.off_grid_truth[i]};
}

// Whether the sound presets look at a scene.
bool IsForSound(const SoundSettings& sound, const RobotScenes& scenes, const Part& part) {
  switch (part.experiment) {
    case Experiment::kFigure7:
    case Experiment::kRandom:
      return true;
    case Experiment::kFigure7Occluded: {
      const auto chosen = static_cast<size_t>(sound.occluded_scenes);
      const size_t all = scenes.free.size();
      if (chosen == 0 || chosen >= all) return true;
      return (part.number + 1) * chosen / all != part.number * chosen / all;
    }
    case Experiment::kCurrentOffGrid:
    case Experiment::kTestOffGrid:
      return sound.off_grid_scenes == 0 || part.number < static_cast<size_t>(sound.off_grid_scenes);
  }
  return false;
}

void RequireParkedAside(const SphereCell& cell, const RobotScenes& scenes) {
  for (int view = 0; view < cell.views(); ++view) {
    const Mask hidden = cell.ImageIn(view, scenes.figure7) & cell.RobotImages(view)[scenes.parked];
    if (!hidden.Empty()) {
      throw std::invalid_argument("the robot, parked, occludes obstacles of 'figure7' in camera " +
                                  std::to_string(view + 1) + "; park it elsewhere");
    }
  }
}

// Measures scenes of one cell; one for each thread.
class Measurer {
 public:
  // `sound`: nothing if no sound preset is selected.
  Measurer(const SphereCell& cell, const SoundSpace* sound, const RobotScenes& scenes,
           const SoundSettings& sound_settings, const Selection& selection)
      : cell_(cell),
        sound_(sound),
        scenes_(scenes),
        sound_settings_(sound_settings),
        presets_(selection.presets),
        bulk_(cell.lines()),
        tallies_(kExperiments, Tallies(cell.views())) {}

  void Measure(const Part& part) {
    const Trial trial = TrialOf(cell_, scenes_, part);
    MeasureImages(part, trial);
    if (sound_ != nullptr && IsForSound(sound_settings_, scenes_, part)) MeasureSound(part, trial);
  }

  void Merge(const Measurer& other) {
    for (size_t i = 0; i < tallies_.size(); ++i) tallies_[i].Merge(other.tallies_[i]);
  }

  Tallies& TalliesOf(Experiment experiment) { return tallies_[static_cast<size_t>(experiment)]; }

 private:
  void MeasureImages(const Part& part, const Trial& trial) {
    bulk_.Look(trial.images, trial.tests);
    for (ViewSet views = 1; views < ViewSet{1} << cell_.views(); ++views) {
      const int count = std::popcount(views);
      for (Preset preset : presets_) {
        if (IsSound(preset)) continue;
        for (Threshold threshold : {Threshold::kAll, Threshold::kAllButOne}) {
          Add(part, preset, threshold, count, trial.truth,
              bulk_.Occupied(preset, views, MinViewsOf(threshold, count)));
        }
      }
    }
  }

  // All views must show what is possible: with fewer the presets would only block more.
  void MeasureSound(const Part& part, const Trial& trial) {
    const BodyDistance body = BodyOf(trial.robot);
    for (ViewSet views = 1; views < ViewSet{1} << cell_.views(); ++views) {
      const bool in_cells = part.experiment == Experiment::kTestOffGrid;
      const SoundVerdicts verdicts =
          CheckSound(*sound_, trial.images, views, body, in_cells ? nullptr : &trial.robot);
      for (Preset preset : presets_) {
        if (!IsSound(preset)) continue;
        Add(part, preset, Threshold::kAll, std::popcount(views), trial.truth,
            preset == Preset::kSound ? verdicts.voxels : verdicts.planes);
      }
    }
  }

  void Add(const Part& part, Preset preset, Threshold threshold, int views,
           ConfigurationWords truth, ConfigurationWords reported) {
    TalliesOf(part.experiment).At(preset, threshold, views).Add(truth, reported);
  }

  const SphereCell& cell_;
  const SoundSpace* sound_;
  const RobotScenes& scenes_;
  const SoundSettings& sound_settings_;
  const std::vector<Preset>& presets_;
  BulkChecker bulk_;
  std::vector<Tallies> tallies_;  // by experiment
};

void AddRows(std::vector<Row>& rows, Row row, Tallies& tallies, const Selection& selection,
             int views) {
  for (Preset preset : selection.presets) {
    for (Threshold threshold : {Threshold::kAll, Threshold::kAllButOne}) {
      for (int count = 1; count <= views; ++count) {
        const Tally& tally = tallies.At(preset, threshold, count);
        if (tally.occupied.samples == 0) continue;
        row.method = NameOf(preset);
        row.threshold = threshold;
        row.Take(tally, count, views);
        rows.push_back(row);
      }
    }
  }
}

}  // namespace

void Row::Take(const Tally& tally, int count, int of) {
  static_cast<Tally&>(*this) = tally;
  views = count;
  camera_sets = static_cast<int>(SetsOf(count, of).size());
  scenes = tally.occupied.samples / camera_sets;
}

std::string NameOf(Experiment experiment) {
  switch (experiment) {
    case Experiment::kFigure7:
      return "figure7";
    case Experiment::kFigure7Occluded:
      return "figure7_occluded";
    case Experiment::kRandom:
      return "random";
    case Experiment::kCurrentOffGrid:
      return "current_off_grid";
    case Experiment::kTestOffGrid:
      return "test_off_grid";
  }
  return "";
}

const std::vector<Experiment>& AllExperiments() {
  static const std::vector<Experiment> all = {Experiment::kFigure7, Experiment::kFigure7Occluded,
                                              Experiment::kRandom, Experiment::kCurrentOffGrid,
                                              Experiment::kTestOffGrid};
  return all;
}

std::string NameOf(Threshold threshold) { return threshold == Threshold::kAll ? "n" : "n-1"; }

Threshold OwnThreshold(Preset preset) {
  return preset == Preset::kUncalibrated ? Threshold::kAllButOne : Threshold::kAll;
}

bool AllDone(size_t count, int threads, const std::function<void(int, size_t)>& work,
             const std::function<bool(uint64_t)>& on_progress) {
  std::atomic<size_t> next{0};
  std::atomic<uint64_t> done{0};
  std::atomic<bool> stop{false};
  const auto workers = static_cast<size_t>(threads);
  const auto work_off = [&](size_t worker) {
    for (size_t i = next++; i < count && !stop; i = next++) {
      work(static_cast<int>(worker), i);
      const uint64_t now = ++done;
      if (worker == 0 && !on_progress(now)) stop = true;
    }
  };
  ParallelFor(workers, work_off, workers);
  return on_progress(done) && !stop;
}

int MinViewsOf(Threshold threshold, int views) {
  return threshold == Threshold::kAll ? views : std::max(1, views - 1);
}

std::vector<Row> Measure(const Settings& settings, const Selection& selection, int threads,
                         const OnProgress& on_progress) {
  std::vector<RobotScenes> robots;
  uint64_t total = 0;
  const uint64_t cells = selection.rigs.size() * selection.rasters.size();
  for (Variant variant : selection.variants) {
    robots.emplace_back(settings, variant);
    robots.back().AddRandom(settings);
    total += cells * PartsOf(selection, robots.back()).size();
  }
  const bool any_sound = std::any_of(selection.presets.begin(), selection.presets.end(), IsSound);
  std::vector<Row> rows;
  uint64_t before = 0;
  for (const RobotScenes& robot : robots) {
    const std::vector<Part> parts = PartsOf(selection, robot);
    for (const std::string& rig : selection.rigs) {
      for (Raster raster : selection.rasters) {
        const SphereCell cell(robot.arms, settings.rigs.at(rig), raster);
        RequireParkedAside(cell, robot);
        std::optional<SoundSpace> sound;
        if (any_sound) sound.emplace(cell, settings.sound);
        const auto measurer = Measured(
            [&] {
              return std::make_unique<Measurer>(cell, sound ? &*sound : nullptr, robot,
                                                settings.sound, selection);
            },
            parts, threads, [&](uint64_t at) { return on_progress(before + at, total); });
        if (!measurer) return rows;
        before += parts.size();
        for (Experiment experiment : selection.experiments) {
          Row row;
          row.experiment = NameOf(experiment);
          row.variant = robot.arms.variant();
          row.rig = rig;
          row.raster = raster;
          row.configurations = static_cast<int64_t>(robot.arms.size());
          AddRows(rows, row, measurer->TalliesOf(experiment), selection, cell.views());
        }
      }
    }
  }
  return rows;
}

}  // namespace silhouette::paper
