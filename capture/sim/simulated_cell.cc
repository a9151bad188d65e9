// SPDX-License-Identifier: Apache-2.0
#include "capture/sim/simulated_cell.h"

#include <algorithm>
#include <chrono>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "capture/sim/image_sensor.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

using SteadyClock = std::chrono::steady_clock;

std::vector<double> RestPositions(const RobotModel& robot) {
  std::vector<double> positions;
  for (const RobotJoint& joint : robot.joints()) {
    positions.push_back(std::clamp(0.0, joint.lower, joint.upper));
  }
  return positions;
}

// Index of the link of that name.
std::optional<size_t> LinkIndex(const RobotModel& robot, const std::string& name) {
  const auto link = std::ranges::find(robot.links(), name, &RobotLink::name);
  if (link == robot.links().end()) return std::nullopt;
  return static_cast<size_t>(link - robot.links().begin());
}

// Writes the levels of a row: grey, or blue, green and red.
void WriteLevels(const Renderer::Row& row, int channels, float* levels) {
  if (channels == 1) {
    std::ranges::copy(row.levels, levels);
    return;
  }
  for (size_t x = 0; x < row.levels.size(); ++x) {
    for (const Eigen::Index colour : {2, 1, 0}) *levels++ = row.levels[x] * row.tints[x][colour];
  }
}

}  // namespace

SimulatedCell::SimulatedCell(RobotModel robot, SimulationSettings settings)
    : robot_(std::move(robot)),
      settings_(std::move(settings)),
      sensor_(settings_),
      renderer_(settings_, BodyPartsOf(robot_)),
      positions_(RestPositions(robot_)),
      holds_(settings_.boards.size()) {
  for (const SimulatedBoard& board : settings_.boards) {
    if (board.link.empty() || LinkIndex(robot_, board.link)) continue;
    throw std::invalid_argument(absl::StrCat(
        "the board '", board.board.description().name, "' is on the link '", board.link,
        "', which the robot does not have; its links are ",
        absl::StrJoin(robot_.links(), ", ", [](std::string* out, const RobotLink& link) {
          absl::StrAppend(out, link.name);
        })));
  }
}

absl::StatusOr<std::shared_ptr<SimulatedCell>> SimulatedCell::Load(const std::string& simulation,
                                                                   const RobotModel& bare,
                                                                   const std::string& variant) {
  ASSIGN_OR_RETURN(SimulationSettings settings, LoadSimulation(simulation));
  absl::StatusOr<RobotModel> robot = Carrying(bare, settings.parts, variant);
  if (!robot.ok()) {
    return absl::InvalidArgumentError(absl::StrCat(simulation, ": ", robot.status().message()));
  }
  try {
    return std::make_shared<SimulatedCell>(*std::move(robot), std::move(settings));
  } catch (const std::invalid_argument& error) {
    return absl::InvalidArgumentError(absl::StrCat(simulation, ": ", error.what()));
  }
}

std::vector<double> SimulatedCell::positions() const {
  const std::lock_guard lock(mutex_);
  return positions_;
}

void SimulatedCell::SetPositions(std::span<const double> positions) {
  if (positions.size() != robot_.joints().size()) {
    throw std::invalid_argument(
        absl::StrCat("the robot has ", robot_.joints().size(), " joints, not ", positions.size()));
  }
  const std::lock_guard lock(mutex_);
  positions_.assign(positions.begin(), positions.end());
}

void SimulatedCell::SetRobotPresent(bool present) {
  const std::lock_guard lock(mutex_);
  robot_present_ = present;
}

void SimulatedCell::SetObstacles(std::vector<Obstacle> obstacles) {
  const std::lock_guard renderer_lock(renderer_mutex_);
  const std::lock_guard lock(mutex_);
  obstacles_ = std::move(obstacles);
  renderer_.SetObstacles(ObstacleParts(obstacles_));
}

void SimulatedCell::ShowAllBoards(bool show) {
  const std::lock_guard lock(mutex_);
  all_boards_ = show;
}

void SimulatedCell::HoldBoard(const std::string& name,
                              const std::optional<Eigen::Isometry3d>& world_from_board) {
  for (size_t b = 0; b < settings_.boards.size(); ++b) {
    if (settings_.boards[b].board.description().name != name) continue;
    const std::lock_guard lock(mutex_);
    holds_[b] = {.held = true, .pose = world_from_board};
    return;
  }
  throw std::invalid_argument(absl::StrCat("the simulation has no board '", name, "'"));
}

std::vector<std::optional<Eigen::Isometry3d>> SimulatedCell::BoardPoses() const {
  const std::lock_guard lock(mutex_);
  return BoardPosesWith(robot_.LinkPoses(positions_));
}

std::vector<std::optional<Eigen::Isometry3d>> SimulatedCell::BoardPosesWith(
    const Poses& links) const {
  std::vector<std::optional<Eigen::Isometry3d>> poses;
  for (size_t b = 0; b < holds_.size(); ++b) {
    const SimulatedBoard& board = settings_.boards[b];
    if (holds_[b].held) {
      poses.push_back(holds_[b].pose);
    } else if (!board.pose || (!board.always && !all_boards_)) {
      poses.push_back(std::nullopt);
    } else if (board.link.empty()) {
      poses.push_back(board.pose);
    } else if (robot_present_) {
      poses.push_back(links[LinkIndex(robot_, board.link).value()] * *board.pose);
    } else {
      poses.push_back(std::nullopt);
    }
  }
  return poses;
}

double SimulatedCell::time() const {
  const std::lock_guard lock(mutex_);
  return Now();
}

double SimulatedCell::Now() const {
  if (!real_time_) return time_;
  return time_ + std::chrono::duration<double>(SteadyClock::now() - *real_time_).count();
}

void SimulatedCell::RunInRealTime() {
  const std::lock_guard lock(mutex_);
  real_time_ = SteadyClock::now();
}

void SimulatedCell::SetTime(double seconds) {
  const std::lock_guard lock(mutex_);
  time_ = seconds;
  if (real_time_) real_time_ = SteadyClock::now();
}

void SimulatedCell::SetFrame(uint64_t frame) {
  const std::lock_guard lock(mutex_);
  frame_ = frame;
}

SimulatedCell::Instant SimulatedCell::InstantNow(bool go_on) {
  const std::lock_guard lock(mutex_);
  Instant instant{.captured = absl::Now(),
                  .time = Now(),
                  .frame = frame_,
                  .robot = robot_.LinkPoses(positions_),
                  .robot_present = robot_present_,
                  .boards = {},
                  .obstacles = {}};
  instant.boards = BoardPosesWith(instant.robot);
  instant.obstacles = ObstaclePoses(obstacles_, instant.time);
  if (go_on) {
    ++frame_;
    if (!real_time_) time_ += settings_.frame_interval;
  }
  return instant;
}

void SimulatedCell::Render(std::span<const size_t> cameras, const Instant& instant,
                           const Renderer::RowSink& sink) {
  renderer_.Render(cameras, instant.robot_present ? &instant.robot : nullptr, instant.boards,
                   instant.obstacles, sink);
}

std::vector<CameraImage> SimulatedCell::TakeImages(std::span<const size_t> cameras) {
  const std::lock_guard lock(renderer_mutex_);
  const Instant instant = InstantNow(/*go_on=*/true);
  std::vector<CameraImage> by_camera(settings_.cameras.size());
  std::vector<ImageSensor::Gain> gains(settings_.cameras.size());
  std::vector<cv::Mat> light(settings_.cameras.size());  // that reaches the sensor, grey levels
  for (size_t camera : cameras) {
    const CameraIntrinsics& intrinsics = settings_.cameras[camera].model.intrinsics();
    CameraImage& image = by_camera[camera];
    image.width = intrinsics.width;
    image.height = intrinsics.height;
    image.channels = settings_.cameras[camera].colour ? 3 : 1;
    image.captured = instant.captured;
    light[camera].create(image.height, image.width, CV_32FC(image.channels));
    image.pixels.resize(light[camera].total() * static_cast<size_t>(image.channels));
    gains[camera] = sensor_.GainAt(instant.time, instant.frame, camera);
  }
  const auto expose = [&](size_t camera, int y) {
    CameraImage& image = by_camera[camera];
    const auto channels = static_cast<size_t>(image.channels);
    const size_t values = static_cast<size_t>(image.width) * channels;
    sensor_.Expose({light[camera].ptr<float>(y), values}, gains[camera],
                   {.frame = instant.frame, .camera = camera, .y = y},
                   std::span(image.pixels).subspan(static_cast<size_t>(y) * values, values),
                   channels);
  };
  // With blur a row needs its neighbours.
  const bool blurred = settings_.blur > 0;
  Render(cameras, instant, [&](size_t camera, int y, const Renderer::Row& row) {
    WriteLevels(row, by_camera[camera].channels, light[camera].ptr<float>(y));
    if (!blurred) expose(camera, y);
  });
  for (size_t camera : cameras) {
    if (!blurred) break;
    Blur(light[camera], settings_.blur);
    for (int y = 0; y < light[camera].rows; ++y) expose(camera, y);
  }
  std::vector<CameraImage> images;
  for (size_t camera : cameras) images.push_back(by_camera[camera]);
  return images;
}

std::vector<std::vector<Seen>> SimulatedCell::TrueImages(std::span<const size_t> cameras) {
  const std::lock_guard lock(renderer_mutex_);
  std::vector<std::vector<Seen>> by_camera(settings_.cameras.size());
  for (size_t camera : cameras) {
    const CameraIntrinsics& intrinsics = settings_.cameras[camera].model.intrinsics();
    by_camera[camera].resize(static_cast<size_t>(intrinsics.width) *
                             static_cast<size_t>(intrinsics.height));
  }
  Render(cameras, InstantNow(/*go_on=*/false), [&](size_t camera, int y, const Renderer::Row& row) {
    std::copy(row.seen.begin(), row.seen.end(),
              by_camera[camera].begin() + static_cast<ptrdiff_t>(y) * std::ssize(row.seen));
  });
  std::vector<std::vector<Seen>> images;
  for (size_t camera : cameras) images.push_back(by_camera[camera]);
  return images;
}

}  // namespace silhouette
