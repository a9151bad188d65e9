// SPDX-License-Identifier: Apache-2.0
// A small cell for the tests of the server: three views, a bounded joint "a" (0 to 4), a continuous
// joint "b" (8 steps of a turn) and a fixed joint "lift" at 0.5.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <memory>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "capture/segmentation/reference.h"
#include "db/store/collision_index.h"
#include "db/store/robot_image_format.h"
#include "db/store/store.h"
#include "server/scene/configuration_space.h"
#include "server/scene/make_scene.h"
#include "server/scene/served_database.h"
#include "tests/test_folder.h"

namespace silhouette {

inline constexpr double kStepOfB = std::numbers::pi / 4;

inline const std::vector<std::string> kViewNames = {"left", "right", "top"};
inline const std::vector<MaskSize> kViewSizes = {{16, 12}, {16, 12}, {10, 10}};
// Camera pixels per mask pixel.
inline constexpr int kScale = 4;

// It as a cell file, with camera images of the masks' sizes.
inline constexpr char kServerTestCellFile[] = R"(name: server test
robot:
  joints:
    - {name: a, lower: 0, upper: 4}
    - {name: b, lower: -180 deg, continuous: true}
  fixed: {lift: 0.5}
grid:
  steps: {a: 5, b: 8}
views:
  - {name: left, mask_size: [16, 12]}
  - {name: right, mask_size: [16, 12]}
  - {name: top, mask_size: [10, 10]}
)";

inline storage::v1::CellDescription ServerTestCell() {
  storage::v1::CellDescription cell;
  cell.set_name("server test");
  storage::v1::GridJoint& a = *cell.add_grid_joints();
  a.set_name("a");
  a.set_upper(4);
  a.set_steps(5);
  storage::v1::GridJoint& b = *cell.add_grid_joints();
  b.set_name("b");
  b.set_lower(-std::numbers::pi);
  b.set_upper(std::numbers::pi);
  b.set_steps(8);
  b.set_continuous(true);
  storage::v1::FixedJoint& lift = *cell.add_fixed_joints();
  lift.set_name("lift");
  lift.set_position(0.5);
  for (size_t i = 0; i < kViewNames.size(); ++i) {
    storage::v1::View& view = *cell.add_views();
    view.set_name(kViewNames[i]);
    view.set_image_width(kViewSizes[i].width * kScale);
    view.set_image_height(kViewSizes[i].height * kScale);
    view.set_mask_width(kViewSizes[i].width);
    view.set_mask_height(kViewSizes[i].height);
  }
  return cell;
}

// The joint values of grid point (a, b).
inline Configuration At(int a, int b) { return {1.0 * a, -std::numbers::pi + b * kStepOfB}; }

// A post two pixels wide that goes to the right with `a` and grows with `b`, on a foot that is
// always there: the bottom row.
inline Mask RobotMask(int view, int a, int b) {
  const MaskSize size = kViewSizes[view];
  return Mask::FromPredicate(size, [=](int x, int y) {
    return y == size.height - 1 || (x / 2 == a && y >= size.height - 2 - b / 2);
  });
}

// A block of 2x2 pixels on the post's way, where joint a is at `a`; never on the foot.
inline Mask Block(int view, int a) {
  const MaskSize size = kViewSizes[view];
  return Mask::FromPredicate(size, [=](int x, int y) {
    return x / 2 == a && y >= size.height - 3 && y < size.height - 1;
  });
}

// As Block, higher up: one pixel around it is not on the foot.
inline Mask HighBlock(int view, int a) {
  const MaskSize size = kViewSizes[view];
  return Mask::FromPredicate(size, [=](int x, int y) {
    return x / 2 == a && y >= size.height - 5 && y < size.height - 3;
  });
}

struct TestDatabase {
  std::vector<std::pair<int, int>> missing = {};
  std::vector<std::pair<int, int>> excluded = {};
  std::vector<std::pair<int, int>> corrupt = {};
  bool references = false;
  bool index = false;
  storage::v1::CellDescription cell = ServerTestCell();
  std::optional<storage::v1::Calibration> calibration = std::nullopt;
};

// Matrices after which a point is in the same row of "left" and "right", and two rows higher in
// "top": RobotMask fits them.
inline storage::v1::Calibration TestCalibration() {
  storage::v1::Calibration calibration;
  for (const auto& [a, b, lower] : {std::tuple(0, 1, 0), {1, 2, -2}, {0, 2, -2}}) {
    storage::v1::FundamentalMatrix& matrix = *calibration.add_fundamental_matrices();
    matrix.set_view_a(a);
    matrix.set_view_b(b);
    for (const double value : {0, 0, 0, 0, 0, -1, 0, 1, lower}) matrix.add_f(value);
  }
  return calibration;
}

inline RobotImage TestRobotImage(const ConfigurationGrid& grid, int a, int b) {
  RobotImage image;
  image.number = grid.NumberOf({a, b});
  for (int view = 0; view < 3; ++view) image.masks.push_back(RobotMask(view, a, b));
  return image;
}

// What a camera sees: grey texture, and dark where `foreground` is.
inline cv::Mat CameraPicture(int view, const Mask& foreground) {
  const MaskSize size = kViewSizes[view];
  cv::Mat image(size.height * kScale, size.width * kScale, CV_8UC1);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const bool set = foreground.at(x / kScale, y / kScale);
      image.at<uint8_t>(y, x) = static_cast<uint8_t>(set ? 20 : 120 + (x * 7 + y * 13) % 60);
    }
  }
  return image;
}

inline std::string PngOf(const cv::Mat& image) {
  std::vector<uint8_t> bytes;
  cv::imencode(".png", image, bytes);
  return {bytes.begin(), bytes.end()};
}

inline storage::v1::References TestReferences() {
  storage::v1::References references;
  for (int view = 0; view < 3; ++view) {
    const std::vector<cv::Mat> images(4, CameraPicture(view, Mask(kViewSizes[view])));
    const Reference reference = Reference::FromImages(images);
    storage::v1::Reference& stored = *references.add_views();
    stored.set_mean_png(reference.MeanPng());
    stored.set_noise_png(reference.NoisePng());
    stored.set_images(4);
  }
  return references;
}

// Flips a bit in every copy of the record in the database's file.
inline void DamageRecord(const std::string& path, const RobotImage& image) {
  const std::string file = path + "/data.mdb";
  std::ifstream in(file, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  in.close();
  const std::string value = EncodeRobotImage(image);
  size_t damaged = 0;
  for (size_t at = bytes.find(value); at != std::string::npos; at = bytes.find(value, at + 1)) {
    bytes[at + value.size() / 2] ^= 1;
    ++damaged;
  }
  ASSERT_GT(damaged, 0u);
  std::ofstream(file, std::ios::binary) << bytes;
}

inline void BuildIndex(const std::string& path) {
  const auto database = Database::Open(path, Database::Access::kWrite);
  ASSERT_TRUE(database.ok()) << database.status();
  const auto report = BuildCollisionIndex(**database);
  ASSERT_TRUE(report.ok()) << report.status();
}

// Zeroes the pages of the first tile of the collision index in the database's file, but for the
// first of them, as a failing disk does: the tile says then that no robot image touches anything.
inline void ZeroIndex(const Database& database) {
  std::string held;
  {
    const auto index = CollisionIndex::Open(*database.Read());
    ASSERT_TRUE(index.ok()) << index.status();
    const std::span<const std::byte> bytes = (*index)->Bytes(0);
    held.assign(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  }
  ASSERT_GT(held.size(), 8192u);
  std::fstream file(database.path() + "/data.mdb", std::ios::in | std::ios::out | std::ios::binary);
  const std::string content{std::istreambuf_iterator<char>(file), {}};
  const size_t at = content.find(held);
  ASSERT_NE(at, std::string::npos);
  file.seekp(static_cast<std::streamoff>(at + 4096)) << std::string(held.size() - 4096, '\0');
}

inline void MakeDatabase(const std::string& path, const TestDatabase& test = {}) {
  const auto among = [](const auto& list, int a, int b) {
    return std::find(list.begin(), list.end(), std::pair(a, b)) != list.end();
  };
  const ConfigurationGrid grid = *GridOf(test.cell);
  {
    const auto database = Database::Create(path, test.cell);
    ASSERT_TRUE(database.ok()) << database.status();
    auto writer = (*database)->Write("test");
    ASSERT_TRUE(writer.ok()) << writer.status();
    for (int a = 0; a < 5; ++a) {
      for (int b = 0; b < 8; ++b) {
        if (among(test.missing, a, b)) continue;
        RobotImage image = TestRobotImage(grid, a, b);
        image.excluded = among(test.excluded, a, b);
        if (image.excluded) image.masks.clear();
        ASSERT_TRUE(writer->Put(image).ok());
      }
    }
    ASSERT_TRUE(writer->Commit().ok());
    if (test.references) {
      ASSERT_TRUE((*database)->SetReferences(TestReferences(), "test").ok());
    }
    if (test.calibration) {
      ASSERT_TRUE((*database)->SetCalibration(*test.calibration, "test").ok());
    }
  }
  if (test.index) BuildIndex(path);
  for (const auto& [a, b] : test.corrupt) DamageRecord(path, TestRobotImage(grid, a, b));
}

// By default epipolar lines are as the calibration says, without margin.
inline std::shared_ptr<const ServedDatabase> LoadDatabase(
    const std::string& path, const CalibrationSettings& settings = {.margin = 0},
    const TreatmentSettings& treatments = {}, const LoadSettings& load = {}) {
  const auto database = Database::Open(path, Database::Access::kRead);
  EXPECT_TRUE(database.ok()) << database.status();
  auto served = ServedDatabase::Load(**database, settings, treatments, std::nullopt, load);
  EXPECT_TRUE(served.ok()) << served.status();
  return *std::move(served);
}

inline std::shared_ptr<const ServedDatabase> NewDatabase(
    const TestDatabase& test = {}, const CalibrationSettings& settings = {.margin = 0},
    const TreatmentSettings& treatments = {}) {
  const std::filesystem::path folder = FreshFolder();
  MakeDatabase(folder / "db", test);
  return LoadDatabase(folder / "db", settings, treatments);
}

// The same margin for all views, and a workspace of one cubic metre.
inline TreatmentSettings WithMargins(const Margin& margin) {
  return {
      .views = std::vector<ViewTreatmentSettings>(3, {.margin = margin, .ignored = std::nullopt}),
      .workspace = Eigen::AlignedBox3d(Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(1, 1, 1))};
}

inline TreatmentSettings Ignoring(int view, const Mask& pixels) {
  TreatmentSettings settings = WithMargins({});
  settings.views[static_cast<size_t>(view)].ignored = pixels;
  return settings;
}

inline std::vector<JointPosition> JointsAt(const Configuration& q) {
  return {{"a", q[0]}, {"b", q[1]}, {"lift", 0.5}};
}

// The tiles of the configuration space, all of them.
inline std::vector<TileVerdicts> CheckAllTiles(const Served& served, const Policy& policy) {
  const ConfigurationSpace space(served, policy);
  std::vector<TileVerdicts> tiles;
  for (uint64_t tile = 0; tile < space.tiles(); ++tile) tiles.push_back(space.tile(tile));
  return tiles;
}

// All views see the robot at grid point (a, b), and nothing else.
inline SceneInput EmptyCellScene(int a = 0, int b = 0) {
  SceneInput input;
  input.joints = JointsAt(At(a, b));
  for (int view = 0; view < 3; ++view) {
    input.views.push_back({kViewNames[view], std::nullopt, SceneMask{RobotMask(view, a, b)}});
  }
  return input;
}

// As EmptyCellScene, with blocks on the way of joint a at `block` in the first `views` views.
inline SceneInput SceneWithBlock(int block, int views = 3, int a = 0, int b = 0) {
  SceneInput input = EmptyCellScene(a, b);
  for (int view = 0; view < views; ++view) {
    input.views[view].image = SceneMask{RobotMask(view, a, b) | Block(view, block)};
  }
  return input;
}

inline SceneInput SceneWithHighBlock(int block) {
  SceneInput input = EmptyCellScene();
  for (int view = 0; view < 3; ++view) {
    input.views[view].image = SceneMask{RobotMask(view, 0, 0) | HighBlock(view, block)};
  }
  return input;
}

}  // namespace silhouette
