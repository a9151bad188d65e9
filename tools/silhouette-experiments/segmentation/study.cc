// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/segmentation/study.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "calib/robot/triangle_mesh.h"
#include "capture/segmentation/difference.h"
#include "capture/segmentation/down_sampling.h"
#include "capture/sim/chance.h"
#include "capture/sim/simulated_cell.h"
#include "capture/sim/yaml_values.h"

namespace silhouette::segmentation_experiment {
namespace {

using cell_experiment::SimulatedWorkplace;

constexpr double kSpread = 600;  // seconds over which the scenes lie, for drift

cv::Mat MatOf(const CameraImage& image) {
  const int type = image.channels == 1 ? CV_8UC1 : CV_8UC3;
  return cv::Mat(image.height, image.width, type, const_cast<uint8_t*>(image.pixels.data()))
      .clone();
}

// 255 where one of `kinds` is seen.
cv::Mat Where(const std::vector<Seen>& seen, cv::Size size, std::initializer_list<Seen> kinds) {
  cv::Mat found(size, CV_8UC1);
  for (size_t i = 0; i < seen.size(); ++i) {
    const bool is = std::find(kinds.begin(), kinds.end(), seen[i]) != kinds.end();
    found.data[i] = is ? 255 : 0;
  }
  return found;
}

cv::Mat Grown(const cv::Mat& image) {
  cv::Mat grown;
  cv::dilate(image, grown, cv::getStructuringElement(cv::MORPH_RECT, {3, 3}));
  return grown;
}

// A mask as an image of 255 and 0.
cv::Mat ImageOf(const Mask& mask) {
  cv::Mat image(mask.height(), mask.width(), CV_8UC1);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) image.at<uint8_t>(y, x) = mask.at(x, y) ? 255 : 0;
  }
  return image;
}

// What a view really shows, in camera pixels or in those of the mask.
struct Truth {
  cv::Mat obstacle;
  cv::Mat body;  // robot or obstacle
  cv::Mat shadow;

  // With bodies on all sides.
  cv::Mat Core() const {
    cv::Mat core;
    cv::erode(body, core, cv::getStructuringElement(cv::MORPH_RECT, {3, 3}));
    return core & obstacle;
  }
  cv::Mat Empty() const { return ~(Grown(body) | Grown(shadow)); }
  cv::Mat ShadowAlone() const { return shadow & ~Grown(body); }
};

Truth TruthOf(const std::vector<Seen>& seen, cv::Size size) {
  return {.obstacle = Where(seen, size, {Seen::kObstacle}),
          .body = Where(seen, size, {Seen::kObstacle, Seen::kRobot, Seen::kBoard}),
          .shadow = Where(seen, size, {Seen::kShadow})};
}

Truth InMask(const Truth& truth, MaskSize size) {
  return {.obstacle = ImageOf(DownSample(truth.obstacle, size, 0)),
          .body = ImageOf(DownSample(truth.body, size, 0)),
          .shadow = ImageOf(DownSample(truth.shadow, size, 0))};
}

int64_t Both(const cv::Mat& a, const cv::Mat& b) { return cv::countNonZero(a & b); }

void Count(const Truth& pixels, const Truth& mask_truth, const cv::Mat& foreground,
           const cv::Mat& mask, Figures& figures) {
  figures.obstacle_pixels += cv::countNonZero(pixels.Core());
  figures.found_pixels += Both(pixels.Core(), foreground);
  figures.empty_pixels += cv::countNonZero(pixels.Empty());
  figures.false_pixels += Both(pixels.Empty(), foreground);
  figures.obstacle_mask += cv::countNonZero(mask_truth.Core());
  figures.found_mask += Both(mask_truth.Core(), mask);
  figures.empty_mask += cv::countNonZero(mask_truth.Empty());
  figures.false_mask += Both(mask_truth.Empty(), mask);
  figures.shadow_mask += cv::countNonZero(mask_truth.ShadowAlone());
  figures.shadow_foreground += Both(mask_truth.ShadowAlone(), mask);
  figures.all_mask += mask.rows * mask.cols;
}

// What obstacles throw back; `room`: the room does.
double Brightness(Chance& chance, Obstacles kind, double room) {
  constexpr double kPlainly = 0.06;
  double brightness = chance.Uniform(0.02, 0.9);
  while (kind == Obstacles::kPlain && std::abs(brightness - room) < kPlainly) {
    brightness = chance.Uniform(0.02, 0.9);
  }
  return brightness;
}

Obstacle RandomObstacle(Chance& chance, Obstacles kind, double room) {
  Obstacle obstacle;
  const bool person = chance.Uniform() < 0.5;
  const double x = chance.Uniform(-1.6, 1.6);
  const double y = chance.Uniform(-1.6, 1.6);
  if (person) {
    obstacle.mesh = CapsuleMesh(chance.Uniform(0.15, 0.25), chance.Uniform(1.0, 1.4));
    obstacle.world_from_obstacle.translation() = Eigen::Vector3d(x, y, 0.85);
  } else {
    obstacle.mesh =
        BoxMesh({chance.Uniform(0.1, 0.6), chance.Uniform(0.1, 0.6), chance.Uniform(0.1, 0.6)});
    obstacle.world_from_obstacle.translation() = Eigen::Vector3d(x, y, chance.Uniform(0.3, 1.6));
    obstacle.world_from_obstacle.linear() = RotationOf(3 * chance.Direction()).toRotationMatrix();
  }
  const Eigen::Vector3d colour(chance.Uniform(0.1, 1), chance.Uniform(0.1, 1),
                               chance.Uniform(0.1, 1));
  obstacle.tint = TintOf(colour);
  obstacle.brightness = Brightness(chance, kind, room);
  return obstacle;
}

// The cell under a condition, and the references of its cameras.
class Photographed {
 public:
  Photographed(const SimulatedWorkplace& workplace, const Condition& condition,
               const StudySettings& settings)
      : workplace_(workplace), settings_(settings) {
    SimulationSettings simulation = workplace.simulation().settings();
    simulation.boards.clear();
    // What is seen in the light's own colour: a little yellow.
    if (settings.colour) simulation.room.tint = TintOf({0.5, 0.48, 0.42});
    for (SimulatedCamera& camera : simulation.cameras) camera.colour = settings.colour;
    condition.change(simulation);
    room_ = simulation.room.brightness;
    cell_ = std::make_unique<SimulatedCell>(workplace.robot(), simulation);
    cell_->SetRobotPresent(false);
    std::vector<std::vector<cv::Mat>> images(workplace.cameras().size());
    for (int i = 0; i < settings.reference_images; ++i) {
      const auto set = cell_->TakeImages(workplace.cameras());
      for (size_t v = 0; v < set.size(); ++v) images[v].push_back(MatOf(set[v]));
    }
    for (const auto& view : images) references_.push_back(Reference::FromImages(view));
    cell_->SetRobotPresent(true);
  }

  struct View {
    cv::Mat image;
    Truth truth;
  };
  std::vector<View> Scene(int number) {
    Chance chance(settings_.seed * 1'000'003 + static_cast<uint64_t>(number));
    Configuration robot;
    for (const GridJoint& joint : workplace_.cell().grid.joints()) {
      robot.push_back(chance.Uniform(joint.lower, joint.upper));
    }
    cell_->SetPositions(workplace_.Positions(robot));
    std::vector<Obstacle> obstacles;
    const size_t count = 1 + chance.Index(4);
    for (size_t i = 0; i < count; ++i) {
      obstacles.push_back(RandomObstacle(chance, settings_.obstacles, room_));
    }
    cell_->SetObstacles(std::move(obstacles));
    cell_->SetTime(kSpread * number / std::max(settings_.scenes, 1));
    const auto truths = cell_->TrueImages(workplace_.cameras());
    const auto images = cell_->TakeImages(workplace_.cameras());
    std::vector<View> views;
    for (size_t v = 0; v < images.size(); ++v) {
      const cv::Mat image = MatOf(images[v]);
      views.push_back({image, TruthOf(truths[v], image.size())});
    }
    return views;
  }

  const Reference& reference(size_t view) const { return references_[view]; }

 private:
  const SimulatedWorkplace& workplace_;
  const StudySettings& settings_;
  double room_ = 0;
  std::unique_ptr<SimulatedCell> cell_;
  std::vector<Reference> references_;
};

void Paint(Picture& picture, const cv::Mat& where, const cv::Vec3b& colour) {
  picture.setTo(cv::Scalar(colour[0], colour[1], colour[2]), where);
}

}  // namespace

std::vector<Condition> Conditions() {
  return {
      {"as the cell is", [](SimulationSettings&) {}},
      {"noise 3", [](SimulationSettings& s) { s.noise_sigma = 3; }},
      {"drift 10 %", [](SimulationSettings& s) { s.drift_amplitude = 0.1; }},
      {"flicker 3 %", [](SimulationSettings& s) { s.flicker_amplitude = 0.03; }},
      {"uneven flicker 1 %",
       [](SimulationSettings& s) { s.flicker_amplitude = s.flicker_slope = 0.01; }},
      {"unsteady pixels", [](SimulationSettings& s) { s.unsteady_share = 0.002; }},
      {"saturated", [](SimulationSettings& s) { s.exposure = 2.7; }},
      {"hard shadows", [](SimulationSettings& s) { s.light.shadow = 0.9; }},
      {"no texture", [](SimulationSettings& s) { s.room.texture = 0; }},
  };
}

std::vector<Method> Methods() {
  return {{"default", {}},
          {"coarse", {.faint_difference = 3, .texture_difference = 0, .faint_side = 5}},
          {"default, shadows: ignore", {.shadows = Shadows::kIgnore}}};
}

std::vector<Figures> Measure(const SimulatedWorkplace& workplace, const Condition& condition,
                             std::span<const Method> methods, const StudySettings& settings,
                             const std::function<bool()>& stop) {
  Photographed cell(workplace, condition, settings);
  std::vector<Figures> figures(methods.size());
  for (int scene = 0; scene < settings.scenes && !stop(); ++scene) {
    const auto views = cell.Scene(scene);
    for (size_t v = 0; v < views.size(); ++v) {
      const MaskSize size = workplace.cell().views[v].mask_size;
      const Truth mask_truth = InMask(views[v].truth, size);
      for (size_t m = 0; m < methods.size(); ++m) {
        const cv::Mat foreground =
            Foreground(views[v].image, cell.reference(v), methods[m].settings);
        const cv::Mat mask = ImageOf(DownSample(foreground, size, methods[m].settings.min_cover));
        Count(views[v].truth, mask_truth, foreground, mask, figures[m]);
      }
    }
  }
  return figures;
}

Picture PictureOfScene(const SimulatedWorkplace& workplace, const Condition& condition,
                       std::span<const Method> methods, const StudySettings& settings) {
  Photographed cell(workplace, condition, settings);
  const auto views = cell.Scene(0);
  Picture image = views[0].image;
  if (image.channels() == 1) cv::cvtColor(image, image, cv::COLOR_GRAY2BGR);
  std::vector<Picture> row{image};
  for (const Method& method : methods) {
    const cv::Mat foreground = Foreground(views[0].image, cell.reference(0), method.settings);
    const Truth& truth = views[0].truth;
    Picture picture(foreground.size(), CV_8UC3, cv::Scalar(255, 255, 255));
    Paint(picture, foreground & truth.body, {90, 60, 40});
    Paint(picture, foreground & truth.shadow, {190, 170, 150});
    Paint(picture, foreground & ~(truth.body | truth.shadow), {60, 140, 240});
    Paint(picture, ~foreground & truth.body, {50, 30, 220});
    row.push_back(picture);
  }
  Picture picture;
  cv::hconcat(row, picture);
  return picture;
}

}  // namespace silhouette::segmentation_experiment
