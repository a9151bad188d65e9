// SPDX-License-Identifier: Apache-2.0
#include "tests/benchmark/synthetic_cell.h"

#include <algorithm>
#include <cmath>
#include <future>
#include <numbers>
#include <random>
#include <stdexcept>
#include <thread>
#include <utility>

namespace silhouette::benchmarks {
namespace {

using Eigen::Vector3d;

struct Link {
  double length = 0;  // metres
  double radius = 0;
};
// From the base to the tool; the first stands still, axis i moves link i + 1.
constexpr std::array<Link, kLinks> kArm = {{{0.34, 0.165},
                                            {0.22, 0.14},
                                            {0.625, 0.10},
                                            {0.15, 0.09},
                                            {0.475, 0.07},
                                            {0.11, 0.055},
                                            {0.16, 0.05}}};

struct Axis {
  bool turns_about_z = false;  // else about y
  double limit = 0;            // degrees, both ways
  double rest = 0;             // degrees: where it stands if it is not in the grid
};
constexpr std::array<Axis, 6> kAxes = {{{true, 160, 0},
                                        {false, 137, 40},
                                        {false, 142, 70},
                                        {true, 180, 0},
                                        {false, 105, 45},
                                        {true, 180, 0}}};

constexpr double kCameraDistance = 4.2;  // metres from the shoulder
const std::array<Vector3d, kViews> kFrom = {Vector3d(1, 0.7, 0.45), Vector3d(-0.8, 0.9, 0.5),
                                            Vector3d(-0.5, -1, 0.4), Vector3d(0.5, -0.4, 1)};

double Radians(double degrees) { return degrees * std::numbers::pi / 180; }

Vector3d Shoulder() { return {0, 0, kArm[0].length + kArm[1].length}; }

// Everything that axis `axis` moves is within this distance of it.
double ReachOf(int axis) {
  double reach = kArm.back().radius;
  for (size_t link = static_cast<size_t>(std::max(axis, 1)) + 1; link < kLinks; ++link) {
    reach += kArm[link].length;
  }
  return reach;
}

std::vector<int> MovingAxes(size_t joints) {
  switch (joints) {
    case 2:
      return {0, 2};
    case 3:
      return {0, 1, 2};
    case 4:
      return {0, 1, 2, 4};
    case 6:
      return {0, 1, 2, 3, 4, 5};
    default:
      throw std::invalid_argument("the arm moves with 2, 3, 4 or 6 joints");
  }
}

using Angles = std::array<double, kAxes.size()>;

// The links with these angles of all axes.
std::array<Capsule, kLinks> ArmAt(const Angles& angles, double radius_scale) {
  std::array<Capsule, kLinks> links;
  Eigen::Matrix3d frame = Eigen::Matrix3d::Identity();
  Vector3d end = Vector3d::Zero();
  for (size_t link = 0; link < kLinks; ++link) {
    if (link > 0) {
      const Vector3d axis = kAxes[link - 1].turns_about_z ? Vector3d::UnitZ() : Vector3d::UnitY();
      frame = frame * Eigen::AngleAxisd(angles[link - 1], axis).toRotationMatrix();
    }
    const Vector3d begin = end;
    end += kArm[link].length * frame.col(2);
    links[link] = {begin, end, radius_scale * kArm[link].radius};
  }
  return links;
}

// How much of an image the links sweep in a step of `axis`, the mean: length times way.
double MeanSweep(int axis, double step) {
  constexpr int kConfigurations = 100;
  std::mt19937_64 random(1);
  double sweep = 0;
  for (int i = 0; i < kConfigurations; ++i) {
    Angles angles;
    for (size_t a = 0; a < kAxes.size(); ++a) {
      const double limit = Radians(kAxes[a].limit);
      angles[a] = std::uniform_real_distribution(-limit, limit)(random);
    }
    const auto here = ArmAt(angles, 1);
    angles[static_cast<size_t>(axis)] += step;
    const auto there = ArmAt(angles, 1);
    for (size_t link = 0; link < kLinks; ++link) {
      const double ways =
          (here[link].from - there[link].from).norm() + (here[link].to - there[link].to).norm();
      sweep += kArm[link].length * ways / 2;
    }
  }
  return sweep / kConfigurations;
}

ConfigurationGrid MakeGrid(const std::vector<int>& axes, const std::vector<int>& steps) {
  std::vector<GridJoint> joints;
  std::vector<double> sweeps;
  for (size_t i = 0; i < axes.size(); ++i) {
    const double limit = Radians(kAxes[static_cast<size_t>(axes[i])].limit);
    joints.push_back({"axis_" + std::to_string(axes[i] + 1), -limit, limit, steps[i]});
    sweeps.push_back(MeanSweep(axes[i], joints.back().step()));
  }
  std::vector<int> edges = ChooseTileEdges(joints, sweeps);
  return ConfigurationGrid(std::move(joints), std::move(edges));
}

std::vector<PinholeView> MakeViews(double half_width, MaskSize size) {
  std::vector<PinholeView> views;
  for (const Vector3d& from : kFrom) {
    views.emplace_back(Shoulder() + kCameraDistance * from.normalized(), Shoulder(), half_width,
                       size);
  }
  return views;
}

// The x in low..high where `grows`, which grows with x, is 0.
double Solve(double low, double high, const std::function<double(double)>& grows) {
  for (int i = 0; i < 30; ++i) {
    const double middle = (low + high) / 2;
    (grows(middle) < 0 ? low : high) = middle;
  }
  return (low + high) / 2;
}

}  // namespace

SyntheticCell::SyntheticCell(const CellSettings& settings)
    : moving_(MovingAxes(settings.steps.size())), grid_(MakeGrid(moving_, settings.steps)) {
  const double reach = ReachOf(1);
  const double narrowest = reach / std::sqrt(kCameraDistance * kCameraDistance - reach * reach);
  views_ = MakeViews(narrowest, settings.mask_size);
  fill_ = MeanFill();
  if (fill_ > settings.fill) {
    views_ = MakeViews(Solve(narrowest, 20 * narrowest,
                             [&](double half_width) {
                               views_ = MakeViews(half_width, settings.mask_size);
                               return settings.fill - MeanFill();
                             }),
                       settings.mask_size);
  } else {
    radius_scale_ = Solve(1, 10, [&](double scale) {
      radius_scale_ = scale;
      return MeanFill() - settings.fill;
    });
  }
  fill_ = MeanFill();
  if (std::abs(fill_ - settings.fill) > 0.1 * settings.fill) {
    throw std::invalid_argument("the arm cannot fill such a share of its views");
  }
}

double SyntheticCell::MeanFill() const {
  constexpr int kConfigurations = 300;
  std::mt19937_64 random(1);
  size_t pixels = 0;
  for (int i = 0; i < kConfigurations; ++i) {
    Configuration q;
    for (const GridJoint& joint : grid_.joints()) {
      q.push_back(std::uniform_real_distribution(joint.lower, joint.upper)(random));
    }
    for (int view = 0; view < kViews; ++view) pixels += RobotImage(view, q).Count();
  }
  return static_cast<double>(pixels) / (1.0 * kConfigurations * kViews * mask_size().pixels());
}

std::array<Capsule, kLinks> SyntheticCell::RobotAt(std::span<const double> q) const {
  Angles angles;
  for (size_t axis = 0; axis < kAxes.size(); ++axis) angles[axis] = Radians(kAxes[axis].rest);
  for (size_t i = 0; i < moving_.size(); ++i) angles[static_cast<size_t>(moving_[i])] = q[i];
  return ArmAt(angles, radius_scale_);
}

Mask SyntheticCell::RobotImage(int view, std::span<const double> q) const {
  return MaskOf(RobotAt(q), views_[static_cast<size_t>(view)]);
}

TileMasks SyntheticCell::RenderTile(uint64_t tile) const {
  TileMasks masks;
  masks.tile_ = tile;
  masks.mask_words_ = mask_size().words();
  for (std::vector<uint64_t>& words : masks.words_) words.resize(kTileSize * masks.mask_words_);
  for (uint64_t place = 0; place < kTileSize; ++place) {
    const std::optional<GridIndex> index = grid_.IndexOf(tile * kTileSize + place);
    if (!index) continue;
    masks.present_[place / 64] |= uint64_t{1} << (place % 64);
    const std::array<Capsule, kLinks> links = RobotAt(grid_.At(*index));
    for (size_t view = 0; view < kViews; ++view) {
      const std::span<uint64_t> words =
          std::span(masks.words_[view]).subspan(place * masks.mask_words_, masks.mask_words_);
      // Links share their joints' balls.
      for (const Capsule& link : links) Draw(link, views_[view], words);
    }
  }
  return masks;
}

void SyntheticCell::ForEachTile(const std::function<void(const TileMasks&)>& take) const {
  const uint64_t ahead = std::max(1u, std::thread::hardware_concurrency());
  std::vector<std::future<TileMasks>> coming(ahead);
  const auto start = [&](uint64_t tile) {
    if (tile >= grid_.tiles()) return;
    coming[tile % ahead] =
        std::async(std::launch::async, [this, tile] { return RenderTile(tile); });
  };
  for (uint64_t tile = 0; tile < ahead; ++tile) start(tile);
  for (uint64_t tile = 0; tile < grid_.tiles(); ++tile) {
    const TileMasks masks = coming[tile % ahead].get();
    start(tile + ahead);
    take(masks);
  }
}

RobotImageTable SyntheticCell::Table() const {
  RobotImageTable::Builder builder(grid_, mask_sizes(), grid_.size());
  ForEachTile([&](const TileMasks& tile) {
    std::vector<Mask> images(kViews);
    for (uint64_t place = 0; place < kTileSize; ++place) {
      if (!tile.present(place)) continue;
      for (int view = 0; view < kViews; ++view) {
        const MaskWords words = tile.mask(view, place);
        images[static_cast<size_t>(view)] =
            Mask::FromWords(mask_size(), {words.begin(), words.end()});
      }
      builder.Add(tile.tile() * kTileSize + place, images);
    }
  });
  return std::move(builder).Build();
}

ObstacleImages SyntheticCell::See(std::span<const Capsule> obstacles,
                                  std::span<const double> q) const {
  ObstacleImages images;
  for (int view = 0; view < kViews; ++view) {
    const Mask robot = RobotImage(view, q);
    const Mask scene = MaskOf(obstacles, views_[static_cast<size_t>(view)]) | robot;
    images.push_back(ObstacleImage::FromScene(scene, robot));
  }
  return images;
}

std::vector<int> StepsOfSize3k() { return {64, 48}; }
std::vector<int> StepsOfSize1M() { return {128, 96, 80}; }
std::vector<int> StepsOfSize10M() { return {64, 60, 56, 48}; }
std::vector<int> StepsOfSize10MWithSixJoints() { return {16, 16, 16, 16, 12, 13}; }

}  // namespace silhouette::benchmarks
