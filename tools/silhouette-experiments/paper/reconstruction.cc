// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/paper/reconstruction.h"

#include <time.h>

#include <algorithm>
#include <bit>
#include <memory>

#include "common/numbers/numbers.h"
#include "server/collision/collision_checker.h"
#include "tools/silhouette-experiments/paper/sphere_cell.h"
#include "tools/silhouette-experiments/paper/voxel_hull.h"

namespace silhouette::paper {
namespace {

// Processor time of this thread: what else the machine has to do does not count.
double Seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

ViewSet AllViews(const SphereCell& cell) { return (ViewSet{1} << cell.views()) - 1; }

// One way to test: with a hull in `cube`, or, where that is none, image-based with `preset`.
struct Method {
  std::string name;
  const VoxelCube* cube = nullptr;
  RobotOut out = RobotOut::kBody;
  Preset preset = Preset::kPaper;
};

// The obstacles, where the robot is meanwhile, and the truth.
struct SceneToCompare {
  Spheres obstacles;
  size_t current = 0;
  ConfigurationSet truth;
};

// What a method said about one scene, and how long it took.
struct Answer {
  ConfigurationSet occupied;
  MethodTimes times;
};

// A cell with all that either way of testing has before any scene is there.
class Bench {
 public:
  Bench(const ArmTable& arms, const Settings& settings, const std::string& rig,
        const std::vector<Preset>& presets)
      : cell_(arms, settings.rigs.at(rig), Raster::kTouch), grid_(ArmGrid(arms.steps())) {
    for (int edge : settings.reconstruction.voxels) {
      cubes_.push_back(std::make_unique<VoxelCube>(cell_.cameras(), settings.half_width, edge));
      for (RobotOut out : AllRobotOut()) {
        methods_.push_back({.name = NameOf(out), .cube = cubes_.back().get(), .out = out});
      }
    }
    for (Preset preset : presets) methods_.push_back({.name = NameOf(preset), .preset = preset});
    std::vector<MaskSize> sizes;
    for (const ParallelCamera& camera : cell_.cameras()) sizes.push_back(camera.mask_size());
    RobotImageTable::Builder builder(grid_, sizes, arms.size());
    for (size_t i = 0; i < arms.size(); ++i) {
      std::vector<Mask> masks;
      for (int view = 0; view < cell_.views(); ++view) masks.push_back(cell_.RobotImages(view)[i]);
      numbers_.push_back(NumberOf(i));
      builder.Add(numbers_.back(), masks);
    }
    table_.emplace(std::move(builder).Build());
  }

  const SphereCell& cell() const { return cell_; }
  const std::vector<Method>& methods() const { return methods_; }

  std::vector<Mask> SceneImages(const SceneToCompare& scene) const {
    std::vector<Mask> images;
    for (int view = 0; view < cell_.views(); ++view) {
      images.push_back(cell_.ImageIn(view, scene.obstacles) | RobotImage(view, scene));
    }
    return images;
  }
  std::vector<ObstacleImage> ObstacleImagesOf(const std::vector<Mask>& scene_images,
                                              const SceneToCompare& scene) const {
    std::vector<ObstacleImage> images;
    for (int view = 0; view < cell_.views(); ++view) {
      images.push_back(ObstacleImage::FromScene(scene_images[static_cast<size_t>(view)],
                                                RobotImage(view, scene)));
    }
    return images;
  }

  // With all cameras, timed from the scene images on.
  Answer Ask(const Method& method, const std::vector<Mask>& scene_images,
             const SceneToCompare& scene) const {
    return method.cube != nullptr ? AskHull(method, scene_images, scene)
                                  : AskImages(method, scene_images, scene);
  }

 private:
  const Mask& RobotImage(int view, const SceneToCompare& scene) const {
    return cell_.RobotImages(view)[scene.current];
  }
  ConfigurationNumber NumberOf(size_t index) const {
    const auto steps = static_cast<size_t>(cell_.arms().steps());
    return grid_.NumberOf({static_cast<int>(index / steps), static_cast<int>(index % steps)});
  }

  Answer AskHull(const Method& method, const std::vector<Mask>& scene_images,
                 const SceneToCompare& scene) const {
    const double start = Seconds();
    const std::vector<ObstacleImage> images = ObstacleImagesOf(scene_images, scene);
    const VoxelHull hull(*method.cube, images, AllViews(cell_), cell_.arms().At(scene.current),
                         method.out);
    const double prepared = Seconds();
    Answer answer{Touching(hull, cell_.arms()), {.prepare_seconds = prepared - start}};
    answer.times.space_seconds = Seconds() - prepared;
    answer.times.check_seconds =
        answer.times.space_seconds / static_cast<double>(cell_.arms().size());
    return answer;
  }

  Answer AskImages(const Method& method, const std::vector<Mask>& scene_images,
                   const SceneToCompare& scene) const {
    const double start = Seconds();
    const std::vector<ObstacleImage> images = ObstacleImagesOf(scene_images, scene);
    const ObstacleImages given(images.begin(), images.end());
    const CollisionChecker test(*table_, given,
                                {.preset = method.preset, .min_views = cell_.views()},
                                {.bands = &cell_.bands()});
    const double prepared = Seconds();
    std::vector<TileVerdicts> tiles;
    for (uint64_t tile = 0; tile < grid_.tiles(); ++tile) tiles.push_back(test.CheckTile(tile));
    const double tested = Seconds();
    Answer answer{ConfigurationSet(WordsFor(cell_.arms().size()), 0),
                  {.prepare_seconds = prepared - start, .space_seconds = tested - prepared}};
    const double begin = Seconds();
    for (size_t i = 0; i < numbers_.size(); ++i) {
      if (test.Check(numbers_[i]).state() == State::kOccupied) Insert(answer.occupied, i);
    }
    answer.times.check_seconds = (Seconds() - begin) / static_cast<double>(numbers_.size());
    for (size_t i = 0; i < numbers_.size(); ++i) {
      const uint64_t place = numbers_[i] % kTileSize;
      const TileVerdicts& verdicts = tiles[numbers_[i] / kTileSize];
      const bool occupied = (verdicts.occupied[place / 64] >> (place % 64) & 1) != 0;
      if (occupied != Contains(answer.occupied, i)) {
        throw std::logic_error("a tile's verdict is not that of the configuration");
      }
    }
    return answer;
  }

  SphereCell cell_;
  ConfigurationGrid grid_;
  std::vector<std::unique_ptr<VoxelCube>> cubes_;
  std::vector<Method> methods_;
  std::vector<ConfigurationNumber> numbers_;
  std::optional<RobotImageTable> table_;
};

// What was found by one thread.
class Comparison {
 public:
  explicit Comparison(const Bench& bench)
      : bench_(bench),
        bulk_(bench.cell().lines()),
        tallies_(bench.methods().size(),
                 std::vector<Tally>(static_cast<size_t>(bench.cell().views()))),
        times_(bench.methods().size()),
        disagreements_(bench.methods().size()) {}

  void Measure(const SceneToCompare& scene) {
    const SphereCell& cell = bench_.cell();
    const std::vector<Mask> scene_images = bench_.SceneImages(scene);
    const std::vector<ObstacleImage> images = bench_.ObstacleImagesOf(scene_images, scene);
    bulk_.Look(images, cell.OnGrid());
    for (size_t m = 0; m < tallies_.size(); ++m) {
      const Method& method = bench_.methods()[m];
      const Answer answer = bench_.Ask(method, scene_images, scene);
      times_[m].push_back(answer.times);
      Count(m, cell.views(), answer.occupied, scene.truth);
      if (method.cube == nullptr) {
        const ConfigurationSet at_once =
            bulk_.Occupied(method.preset, AllViews(cell), cell.views());
        disagreements_[m] +=
            CountWithout(at_once, answer.occupied) + CountWithout(answer.occupied, at_once);
      }
      for (ViewSet views = 1; views < AllViews(cell); ++views) {
        const int count = std::popcount(views);
        if (method.cube == nullptr) {
          Count(m, count, bulk_.Occupied(method.preset, views, count), scene.truth);
        } else {
          const VoxelHull hull(*method.cube, images, views, cell.arms().At(scene.current),
                               method.out);
          Count(m, count, Touching(hull, cell.arms()), scene.truth);
        }
      }
    }
  }

  void Merge(const Comparison& other) {
    for (size_t m = 0; m < tallies_.size(); ++m) {
      for (size_t i = 0; i < tallies_[m].size(); ++i) tallies_[m][i].Merge(other.tallies_[m][i]);
      times_[m].insert(times_[m].end(), other.times_[m].begin(), other.times_[m].end());
      disagreements_[m] += other.disagreements_[m];
    }
  }

  void AddRows(const std::string& experiment, const std::string& rig,
               std::vector<Row>& rows) const {
    Row row;
    row.experiment = experiment;
    row.variant = bench_.cell().arms().variant();
    row.rig = rig;
    row.raster = Raster::kTouch;
    row.configurations = static_cast<int64_t>(bench_.cell().arms().size());
    const int views = bench_.cell().views();
    for (size_t m = 0; m < tallies_.size(); ++m) {
      const Method& method = bench_.methods()[m];
      row.method = method.name;
      row.voxels = method.cube == nullptr ? 0 : method.cube->edge();
      for (int count = 1; count <= views; ++count) {
        const Tally& tally = tallies_[m][static_cast<size_t>(count) - 1];
        row.Take(tally, count, views);
        row.times = count == views ? std::optional(TimesOf(m)) : std::nullopt;
        row.disagreements = count == views ? disagreements_[m] : 0;
        rows.push_back(row);
      }
    }
  }

 private:
  void Count(size_t method, int views, const ConfigurationSet& occupied,
             const ConfigurationSet& truth) {
    tallies_[method][static_cast<size_t>(views) - 1].Add(truth, occupied);
  }
  MethodTimes TimesOf(size_t method) const {
    const auto median = [&](double MethodTimes::*time) {
      std::vector<double> values;
      for (const MethodTimes& each : times_[method]) values.push_back(each.*time);
      return Median(std::move(values));
    };
    return {median(&MethodTimes::prepare_seconds), median(&MethodTimes::space_seconds),
            median(&MethodTimes::check_seconds)};
  }

  const Bench& bench_;
  BulkChecker bulk_;
  std::vector<std::vector<Tally>> tallies_;      // by method and number of views
  std::vector<std::vector<MethodTimes>> times_;  // by method, per scene
  std::vector<int64_t> disagreements_;
};

struct ScenesToCompare {
  std::string experiment;
  std::vector<SceneToCompare> scenes;
};

std::vector<ScenesToCompare> ScenesOf(const Settings& settings, const ArmTable& arms) {
  const SceneToCompare figure7{settings.figure7, arms.Nearest(settings.parked),
                               arms.Touching(settings.figure7)};
  ScenesToCompare random{"reconstruction", {}};
  const int count = std::min(settings.reconstruction.scenes, settings.random.count);
  for (int number = 0; number < count; ++number) {
    const SphereScene scene = RandomScene(settings, arms, number);
    random.scenes.push_back({scene.obstacles, scene.current, arms.Touching(scene.obstacles)});
  }
  return {{"reconstruction_figure7", {figure7}}, random};
}

}  // namespace

std::vector<Row> CompareWithReconstruction(const Settings& settings, const Selection& selection,
                                           int threads, const OnProgress& on_progress) {
  std::vector<Preset> presets;
  for (Preset preset : selection.presets) {
    if (!IsSound(preset)) presets.push_back(preset);
  }
  std::vector<Row> rows;
  uint64_t before = 0;
  for (Variant variant : selection.variants) {
    const ArmTable arms(settings, variant);
    const std::vector<ScenesToCompare> experiments = ScenesOf(settings, arms);
    uint64_t per_robot = 0;
    for (const ScenesToCompare& each : experiments) {
      per_robot += selection.rigs.size() * each.scenes.size();
    }
    const uint64_t total = selection.variants.size() * per_robot;
    for (const std::string& rig : selection.rigs) {
      const Bench bench(arms, settings, rig, presets);
      for (const ScenesToCompare& each : experiments) {
        const auto found =
            Measured([&] { return std::make_unique<Comparison>(bench); }, each.scenes, threads,
                     [&](uint64_t at) { return on_progress(before + at, total); });
        if (!found) return rows;
        before += each.scenes.size();
        found->AddRows(each.experiment, rig, rows);
      }
    }
  }
  return rows;
}

}  // namespace silhouette::paper
