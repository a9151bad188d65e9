// SPDX-License-Identifier: Apache-2.0
// The configuration space of one scene, as each test reports it.
#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/picture/sheet.h"
#include "tools/silhouette-experiments/paper/pictures.h"
#include "tools/silhouette-experiments/paper/scenes.h"
#include "tools/silhouette-experiments/paper/sound_bulk.h"
#include "tools/silhouette-experiments/paper/sphere_cell.h"
#include "tools/silhouette-experiments/paper/study.h"
#include "tools/silhouette-experiments/paper/voxel_hull.h"

namespace silhouette::paper {
namespace {

constexpr int kSide = 288;  // of a map, about, in pixels
constexpr Colour kAdditional{230, 159, 0};
constexpr double kManyMissing = 0.02;  // share of the configuration space
constexpr int kVerdictsPictureMostTries = 50;

// A map with the first joint to the right and the second upwards.
class Maps {
 public:
  Maps(int steps, const ConfigurationSet& truth, size_t current)
      : steps_(steps), truth_(truth), current_(current) {}

  CaptionedPicture Of(const std::string& name, const ConfigurationSet& reported) const {
    const double percent = 100.0 / (steps_ * steps_);
    return {Draw(reported),
            absl::StrFormat("%s: +%.1f %%, -%.2f %%", name,
                            percent * static_cast<double>(CountWithout(reported, truth_)),
                            percent * static_cast<double>(CountWithout(truth_, reported)))};
  }
  CaptionedPicture OfTruth() const {
    const double percent = 100.0 / (steps_ * steps_);
    return {Draw(truth_), absl::StrFormat("really: %.1f %% occupied",
                                          percent * static_cast<double>(Count(truth_)))};
  }

 private:
  Picture Draw(const ConfigurationSet& reported) const {
    Picture map = BlankPicture(steps_, steps_);
    for (int a = 0; a < steps_; ++a) {
      for (int b = 0; b < steps_; ++b) {
        const Colour colour = ColourOf(static_cast<size_t>(a * steps_ + b), reported);
        map.at<cv::Vec3b>(steps_ - 1 - b, a) = {colour.blue, colour.green, colour.red};
      }
    }
    const int factor = std::max(1, kSide / steps_);
    Picture picture = Enlarged(map, factor);
    const auto a = static_cast<int>(current_) / steps_;
    const auto b = static_cast<int>(current_) % steps_;
    const cv::Point at(a * factor + factor / 2, (steps_ - 1 - b) * factor + factor / 2);
    cv::circle(picture, at, 6, BgrOf(palette::kPath), cv::FILLED, cv::LINE_AA);
    return picture;
  }
  Colour ColourOf(size_t index, const ConfigurationSet& reported) const {
    const bool really = Contains(truth_, index);
    if (Contains(reported, index)) return really ? palette::kOccupied : kAdditional;
    return really ? palette::kInk : palette::kFree;
  }

  int steps_;
  const ConfigurationSet& truth_;
  size_t current_;
};

}  // namespace

Picture VerdictsPicture(const Settings& settings, Variant variant, const std::string& rig) {
  const ArmTable arms(settings, variant);
  const SphereCell cell(arms, settings.rigs.at(rig), Raster::kTouch);
  const ViewSet all = (ViewSet{1} << cell.views()) - 1;
  BulkTest bulk(cell.lines());
  SphereScene scene;
  size_t current = 0;
  ConfigurationSet truth;
  std::vector<ObstacleImage> images;
  const int tries = std::min(kVerdictsPictureMostTries, settings.random.count);
  for (int number = 0; number < tries; ++number) {
    scene = RandomScene(settings, variant, number);
    current = static_cast<size_t>(scene.current[0] * arms.steps() + scene.current[1]);
    truth = arms.Touching(scene.obstacles);
    images = cell.Look(scene.obstacles, current);
    bulk.Look(images, cell.OnGrid());
    const int64_t missing = CountWithout(truth, bulk.Occupied(Preset::kPaper, all, cell.views()));
    if (missing > kManyMissing * static_cast<double>(arms.size())) break;
  }
  const Maps maps(arms.steps(), truth, current);
  std::vector<CaptionedPicture> pictures = {maps.OfTruth()};
  for (Preset preset : AllPresets()) {
    if (IsSound(preset)) continue;
    const int min_views = MinViewsOf(OwnThreshold(preset), cell.views());
    pictures.push_back(maps.Of(NameOf(preset), bulk.Occupied(preset, all, min_views)));
  }
  const SoundSpace sound(cell, settings.sound);
  const Spheres& robot = arms.At(current);
  const SoundVerdicts verdicts = SoundOnGrid(sound, images, all, sound.BodyOf(robot), robot);
  pictures.push_back(maps.Of(NameOf(Preset::kSoundPlanes), verdicts.planes));
  pictures.push_back(maps.Of(NameOf(Preset::kSound), verdicts.voxels));
  const VoxelCube cube(cell.cameras(), settings.half_width, settings.reconstruction.voxels.back());
  for (RobotOut out : {RobotOut::kHull, RobotOut::kBody}) {
    const VoxelHull hull(cube, images, all, robot, out);
    pictures.push_back(maps.Of(NameOf(out), Touching(hull, arms)));
  }
  return ContactSheet(
      pictures,
      {.title = absl::StrCat("One scene, all configurations (", NameOf(variant), ", rig ", rig,
                             ", ", cell.views(), " cameras): joint 1 to the right, joint 2 up"),
       .columns = 3,
       .legend = {{palette::kFree, "free"},
                  {palette::kOccupied, "occupied"},
                  {kAdditional, "additional (+): reported occupied, really free"},
                  {palette::kInk, "missing (-): reported free, really occupied"},
                  {palette::kPath, "the robot"}}});
}

}  // namespace silhouette::paper
