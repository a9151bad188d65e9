// SPDX-License-Identifier: Apache-2.0
// Cells and robot images for the tests of db/.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "db/store/store.h"
#include "tests/test_folder.h"

namespace silhouette {

// Two grid joints, one fixed joint, views "left" of 64x64 and "top" of 33x20.
inline storage::v1::CellDescription TestCell(int first_steps = 20, int second_steps = 30) {
  storage::v1::CellDescription cell;
  cell.set_name("test cell");
  int place = 0;
  for (int steps : {first_steps, second_steps}) {
    storage::v1::GridJoint* joint = cell.add_grid_joints();
    joint->set_name(absl::StrCat("axis_", ++place));
    joint->set_lower(-1);
    joint->set_upper(1.5);
    joint->set_steps(steps);
  }
  storage::v1::FixedJoint* fixed = cell.add_fixed_joints();
  fixed->set_name("axis_3");
  fixed->set_position(0.25);
  storage::v1::View* left = cell.add_views();
  left->set_name("left");
  left->set_image_width(640);
  left->set_image_height(480);
  left->set_mask_width(64);
  left->set_mask_height(64);
  storage::v1::View* top = cell.add_views();
  top->set_name("top");
  top->set_mask_width(33);
  top->set_mask_height(20);
  cell.set_segmentation("min_blob_pixels: 12\nnoise_factor: 6\n");
  return cell;
}

// TestCell(6, 5) as a cell file.
inline constexpr char kTestCellFile[] = R"(name: test cell
robot:
  joints:
    - {name: axis_1, lower: -1, upper: 1.5}
    - {name: axis_2, lower: -1, upper: 1.5}
  fixed: {axis_3: 0.25}
grid:
  steps: {axis_1: 6, axis_2: 5}
views:
  - {name: left, image_size: [640, 480], mask_size: [64, 64]}
  - {name: top, mask_size: [33, 20]}
)";

inline std::vector<ConfigurationNumber> AllNumbers(const ConfigurationGrid& grid) {
  std::vector<ConfigurationNumber> numbers;
  for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
    if (grid.Contains(number)) numbers.push_back(number);
  }
  return numbers;
}

// A box somewhere in the image; with `noisy`, every pixel at random, which does not compress.
inline Mask RandomMask(MaskSize size, std::mt19937_64& random, bool noisy = false) {
  const auto below = [&](int limit) { return static_cast<int>(random() % uint64_t(limit)); };
  const int left = below(size.width);
  const int top = below(size.height);
  const int right = left + below(size.width);
  const int bottom = top + below(size.height);
  return Mask::FromPredicate(size, [&](int x, int y) {
    if (noisy) return random() % 2 == 0;
    return left <= x && x <= right && top <= y && y <= bottom;
  });
}

// A robot image that depends on `seed` and the number only.
inline RobotImage TestImage(const Database& database, ConfigurationNumber number,
                            uint64_t seed = 0) {
  std::mt19937_64 random(seed * 1'000'003 + number);
  RobotImage image;
  image.number = number;
  image.captured = absl::FromUnixNanos(static_cast<int64_t>(random() >> 2));
  image.excluded = random() % 10 == 0;
  if (!image.excluded) {
    const bool noisy = random() % 10 == 0;
    for (MaskSize size : database.mask_sizes()) {
      image.masks.push_back(RandomMask(size, random, noisy));
    }
  }
  const size_t joints =
      static_cast<size_t>(database.grid().dimensions() + database.cell().fixed_joints_size());
  std::normal_distribution<double> normal;
  if (random() % 4 != 0) {
    for (size_t j = 0; j < joints; ++j) image.commanded.push_back(normal(random));
    image.measured = database.grid().At(number);
    for (double& position : image.measured) position += 1e-4 * normal(random);
    image.measured.resize(joints);
    for (int j = 0; j < database.cell().fixed_joints_size(); ++j) {
      image.measured[static_cast<size_t>(database.grid().dimensions() + j)] =
          database.cell().fixed_joints(j).position();
    }
  }
  return image;
}

// All records without what differs from session to session: the times.
inline std::map<ConfigurationNumber, RobotImage> ContentWithoutTimes(const Database& database) {
  std::map<ConfigurationNumber, RobotImage> content;
  const auto snapshot = database.Read();
  EXPECT_TRUE(snapshot.ok()) << snapshot.status();
  const absl::Status status = snapshot->ForEach([&](ConfigurationNumber number, auto image) {
    EXPECT_TRUE(image.ok()) << image.status();
    image->captured = absl::UnixEpoch();
    content[number] = *image;
    return true;
  });
  EXPECT_TRUE(status.ok()) << status;
  return content;
}

}  // namespace silhouette
