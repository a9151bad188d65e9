// SPDX-License-Identifier: Apache-2.0
// A cell for the tests of capture: a robot that jumps, cameras that draw it, and hooks to make
// either fail.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "capture/session/capture_session.h"
#include "capture/session/reference_images.h"
#include "db/store/store.h"
#include "tests/db/store/test_cell.h"

namespace silhouette {

inline CaptureSettings QuickSettings() {
  CaptureSettings settings;
  settings.settle = absl::ZeroDuration();
  settings.settle_timeout = absl::ZeroDuration();
  settings.still_images = 1;
  settings.reference_images = 3;
  settings.sentinels.count = 0;
  settings.first_look.configurations = 0;
  settings.retry = absl::ZeroDuration();
  settings.keep_free = 0;
  return settings;
}

// Grid joints "turn" and "lift", joint "wrist" fixed; views "front" and "top".
inline storage::v1::CellDescription FakeDescription(int turns = 6, int lifts = 5,
                                                    const SegmentationSettings& segmentation = {}) {
  storage::v1::CellDescription cell;
  cell.set_name("fake cell");
  const auto add_joint = [&](const std::string& name, double lower, double upper, int steps) {
    storage::v1::GridJoint& joint = *cell.add_grid_joints();
    joint.set_name(name);
    joint.set_lower(lower);
    joint.set_upper(upper);
    joint.set_steps(steps);
  };
  add_joint("turn", -1, 1, turns);
  add_joint("lift", 0, 0.5, lifts);
  storage::v1::FixedJoint& fixed = *cell.add_fixed_joints();
  fixed.set_name("wrist");
  fixed.set_position(0.25);
  const auto add_view = [&](const std::string& name, int width, int height, int mask) {
    storage::v1::View& view = *cell.add_views();
    view.set_name(name);
    view.set_image_width(width);
    view.set_image_height(height);
    view.set_mask_width(mask);
    view.set_mask_height(mask);
  };
  add_view("front", 80, 60, 16);
  add_view("top", 64, 64, 20);
  cell.set_segmentation(Describe(segmentation));
  return cell;
}

// The joints are in another order than in the database: wrist, lift, turn.
class FakeRobot : public Robot {
 public:
  const std::vector<std::string>& joints() const override { return names; }

  absl::Status MoveTo(std::span<const double> positions) override {
    if (positions.size() != names.size()) return absl::InvalidArgumentError("wrong joint count");
    const std::vector<double> goal(positions.begin(), positions.end());
    moves.push_back(goal);
    if (on_move) {
      if (absl::Status status = on_move(moves.size()); !status.ok()) return status;
    }
    at = goal;
    return absl::OkStatus();
  }
  absl::StatusOr<RobotState> State() override {
    RobotState state{.positions = at, .moving = moving};
    if (on_state) {
      if (absl::Status status = on_state(state); !status.ok()) return status;
    }
    return state;
  }
  absl::Status Stop() override {
    ++stops;
    return on_stop ? on_stop() : absl::OkStatus();
  }

  std::vector<std::string> names = {"wrist", "lift", "turn"};
  std::vector<double> at = {0, 0, 0};
  bool moving = false;
  std::vector<std::vector<double>> moves;  // all that were commanded
  int stops = 0;
  std::function<absl::Status(size_t move)> on_move;  // counts from 1
  std::function<absl::Status(RobotState&)> on_state;
  std::function<absl::Status()> on_stop;
};

// The grey level of the cell behind the robot.
inline uint8_t FakeBackground(size_t x, size_t y) {
  uint64_t mixed = (x * 0x9E3779B97F4A7C15u) ^ (y * 0xC2B2AE3D27D4EB4Fu);
  mixed = (mixed ^ (mixed >> 29)) * 0xBF58476D1CE4E5B9u;
  return static_cast<uint8_t>(60 + (mixed >> 40) % 40);
}

// Draws the robot as a box whose place depends on the joints. "top" comes before "front".
class FakeRig : public CameraRig {
 public:
  explicit FakeRig(const FakeRobot& robot) : robot_(robot) {}

  const std::vector<std::string>& views() const override { return names; }

  absl::StatusOr<std::vector<CameraImage>> Grab() override {
    ++grabs;
    std::vector<CameraImage> images = {Draw(64, 64, 0), Draw(80, 60, 1)};
    if (on_grab) {
      if (absl::Status status = on_grab(grabs, images); !status.ok()) return status;
    }
    return images;
  }

  std::vector<std::string> names = {"top", "front"};
  bool robot_present = true;
  size_t grabs = 0;
  std::function<absl::Status(size_t grab, std::vector<CameraImage>&)> on_grab;  // counts from 1

 private:
  CameraImage Draw(int width, int height, int view) const {
    CameraImage image{.width = width, .height = height, .channels = 1, .pixels = {}};
    image.captured = absl::Now();
    const int left = static_cast<int>((robot_.at[2] + 1.3) * 20);
    const int top = static_cast<int>(robot_.at[1] * 50) + 5 * view;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const bool robot = robot_present && x >= left && x < left + 9 && y >= top && y < top + 20;
        image.pixels.push_back(
            robot ? 220 : FakeBackground(static_cast<size_t>(x), static_cast<size_t>(y)));
      }
    }
    return image;
  }

  const FakeRobot& robot_;
};

// A database in a folder of its own, and the devices of its cell.
class FakeCell {
 public:
  explicit FakeCell(storage::v1::CellDescription description = FakeDescription(),
                    CaptureSettings capture_settings = QuickSettings(),
                    const std::string& path = "", SegmentationSettings of_masks = {})
      : settings(std::move(capture_settings)),
        segmentation(of_masks),
        path_(path.empty() ? (folder_ / "db").string() : path) {
    auto created = Database::Create(path_, description);
    EXPECT_TRUE(created.ok()) << created.status();
    database = *std::move(created);
    travel.emplace(database->grid(), settings.forbidden_regions);
  }

  void TakeReferences() {
    rig.robot_present = false;
    auto cameras = CellCameras::Create(database->cell(), rig, {});
    ASSERT_TRUE(cameras.ok()) << cameras.status();
    const auto references = silhouette::TakeReferences(*cameras, 3);
    ASSERT_TRUE(references.ok()) << references.status();
    ASSERT_TRUE(database->SetReferences(*references, "test").ok());
    rig.robot_present = true;
    rig.grabs = 0;
  }

  absl::StatusOr<CaptureSession> Session() {
    return CaptureSession::Create(*database, *travel, robot, rig, settings, segmentation, expected);
  }

  absl::StatusOr<CapturePlan> Plan(const CaptureSelection& selection = {}) {
    const auto records = ReadRecords(*database);
    if (!records.ok()) return records.status();
    return PlanCapture(database->cell(), *travel, *records, settings, selection);
  }

  // Plans and captures; with a failure in either, that is the report's status.
  CaptureReport Capture(const CaptureSelection& selection = {},
                        const CaptureObserver& observer = {}) {
    CaptureReport report;
    const auto plan = Plan(selection);
    report.status = plan.status();
    if (!plan.ok()) return report;
    auto session = Session();
    report.status = session.status();
    if (!session.ok()) return report;
    return session->Run(*plan, "test", observer);
  }

  std::map<ConfigurationNumber, RobotImage> Content() const {
    return ContentWithoutTimes(*database);
  }

  // Grid joints of all commanded positions: turn, lift.
  std::vector<Configuration> Commanded() const {
    std::vector<Configuration> commanded;
    for (const std::vector<double>& move : robot.moves) commanded.push_back({move[2], move[1]});
    return commanded;
  }

  std::optional<DrawnRobot> expected;
  CaptureSettings settings;
  SegmentationSettings segmentation;
  std::unique_ptr<Database> database;
  std::optional<Travel> travel;
  FakeRobot robot;
  FakeRig rig{robot};

 private:
  const std::filesystem::path folder_ = FreshFolder();
  std::string path_;
};

inline ForbiddenRegion Region(const std::string& name, std::vector<ForbiddenRegion::Range> ranges) {
  return {.name = name, .ranges = std::move(ranges)};
}

}  // namespace silhouette
