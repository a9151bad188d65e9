// SPDX-License-Identifier: Apache-2.0
// CompareModel: whether a drawn robot holds what cameras captured of the true one, and by how much
// its links must grow to do so.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "calib/robot/drawing/drawn_robot.h"
#include "db/mask/configuration_grid.h"
#include "db/mask/mask.h"

namespace silhouette {

struct ComparisonSettings {
  // Links grow in such steps, metres: as fine as the default tolerance of the model.
  double growth_step = 0.005;
  // By no more than this, metres: it covers cables and hoses. What is farther from the model
  // belongs into it.
  double most_growth = 0.1;
  // Captured areas that no growth reaches are noise if they are apart from all else and have no
  // more pixels than this, and such pixels are no more than `most_noise` of what a view captured.
  // Anything else there is part of the robot, or should not be in the cell.
  size_t most_noise_pixels = 2;
  double most_noise = 0.002;
  // Share of the pixels that certainly show the robot by its model, but were not captured: of a
  // view, where dark or glossy parts may be missed, and of a link, which may not be there.
  double most_uncaptured = 0.03;
  double most_uncaptured_of_link = 0.2;
  // Mean shift of a view's captured masks against the drawn ones, pixels. What robots carry pulls
  // masks to one side or another, 0.1 pixels in the mean; a camera that turned shifts all masks to
  // the same. As much as the default of the calibration's margin.
  double most_shift = 0.25;
  // Share of the masks held out with a captured pixel that the growth found by the others lacks.
  // The growth of few configurations is made greater until it is so (ModelComparison::further).
  double most_held_out = 0.02;
  // Share of a joint's range, and of no more than a turn, that the samples must span, or they say
  // too little of its axis (UnmovedJoints). A shoulder that may turn all round spans less than
  // half a turn above a floor, and less than that in a small sample. 0: neither this is asked, nor
  // which way joints turn (UndirectedJoints).
  double least_moved = 0.3;
  // Fewer configurations say too little of a link: half of them are held out.
  size_t least_configurations = 30;
};

// The steps from 0 to most_growth. Throws std::invalid_argument if they are not 1 to 200.
int GrowthSteps(const ComparisonSettings& settings);

// Settings as the database keeps them: `key: value` a line.
std::string Describe(const ComparisonSettings& settings);

// 0 of nothing.
double ShareOf(uint64_t part, uint64_t whole);

struct ModelSample {
  std::vector<double> q;       // as measured, by joint of the drawn robot
  std::vector<Mask> captured;  // by view
};

struct ComparedView {
  uint64_t captured = 0;    // pixels, of all masks
  uint64_t missing = 0;     // of them, not drawn without growth
  uint64_t missing_by = 0;  // masks with such a pixel
  uint64_t unreached = 0;   // of them, that no permitted growth reaches, noise left out
  uint64_t noise = 0;
  uint64_t certain = 0;     // pixels that certainly show the robot by its model
  uint64_t uncaptured = 0;  // of them, not captured
  // Of the certain pixels, those that no mask of the view captured: something stands before the
  // robot, or it is in the reference images. They are not among `certain`.
  uint64_t hidden = 0;
  // Of captured masks against drawn ones, mask pixels to the right and down; and its mean amount.
  Eigen::Vector2d mean_shift = Eigen::Vector2d::Zero();
  double mean_amount = 0;
};

struct ComparedLink {
  double growth = 0;  // metres
  // Pixels that certainly show this link by the model, and no other.
  uint64_t certain = 0;
  uint64_t uncaptured = 0;
};

// A mask that shows what is wrong.
struct WorstMask {
  size_t sample = 0;
  size_t view = 0;
  uint64_t missing = 0;     // pixels, without growth
  uint64_t uncaptured = 0;  // hidden ones left out
};

struct ModelComparison {
  std::vector<ComparedView> views;
  std::vector<ComparedLink> links;  // by link of the model
  // Of the masks held out, by the growth that the others need, and `further`.
  uint64_t held_out_masks = 0;
  uint64_t held_out_missing = 0;  // with a missing pixel that growth could reach
  uint64_t held_out_pixels = 0;   // such pixels
  // Metres in the growth of all links that grow, kMostFurther at the most, as too few masks are
  // held out to find it without.
  double further = 0;
  // How many configurations should need nothing further; 0: these do.
  size_t enough = 0;
  // What the growth of all adds: its pixels as a share of those drawn without.
  double additional = 0;
  std::vector<WorstMask> worst;  // most pixels first
  // Why the model is refused, a sentence each; empty: it is not.
  std::vector<std::string> faults;

  std::vector<double> LinkGrowth() const;
};

// Metres. More than what captured masks fray by, at few pixels of the camera for one of the mask,
// is no matter of few configurations.
constexpr double kMostFurther = 0.01;

// `joints`: the ranges in which the robot is to be drawn, by its joint. `link_names` by link of the
// model, `view_names` by view. `progress`: called with masks done, of
// two for each mask. Half of the samples (every other one) are held out; the growth that is
// returned holds all of them, but noise and what is not reached. Throws std::invalid_argument if a
// sample has not the joints and views of the robot.
ModelComparison CompareModel(
    const DrawnRobot& bare, std::span<const GridJoint> joints,
    std::span<const std::string> link_names, std::span<const std::string> view_names,
    std::span<const ModelSample> samples, const ComparisonSettings& settings,
    const std::function<void(uint64_t done)>& progress = [](uint64_t) {});

}  // namespace silhouette
