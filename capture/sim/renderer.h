// SPDX-License-Identifier: Apache-2.0
// Renderer: what the cameras of the simulated cell see, before the sensor. Lambert shading, one
// directed light with shadows, one ray through every pixel's centre; pixels that show boards of
// tags are averaged over their area.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "capture/sim/background.h"
#include "capture/sim/board_tracer.h"
#include "capture/sim/body_part.h"
#include "capture/sim/ray_scene.h"
#include "capture/sim/simulation.h"

namespace silhouette {

// What a pixel shows.
enum class Seen : uint8_t {
  kRoom,
  kShadow,  // on the floor
  kRobot,
  kBoard,
  kObstacle,
};

// Not thread-safe.
class Renderer {
 public:
  // Throws std::runtime_error if the ray tracer does not start.
  Renderer(const SimulationSettings& settings, std::span<const BodyPart> robot);

  // Replaces all obstacles.
  void SetObstacles(std::span<const BodyPart> obstacles);

  // A rendered row. Without boards one ray through the pixel's centre decides what it shows.
  struct Row {
    std::span<const float> levels;  // grey levels, 0..255 and beyond
    std::span<const Seen> seen;
    std::span<const Eigen::Vector3f> tints;  // red, green, blue, as multiples of the grey level
  };
  // Takes a row of a camera, given by its index.
  using RowSink = std::function<void(size_t camera, int y, const Row& row)>;

  // Renders the images of `cameras` (indices of settings.cameras), with both cores where there are
  // two. `sink` is called once for every row, from several threads, in no order.
  // `robot`: poses of the links, nullptr: the robot is not in the cell. `boards`: the poses of
  // settings.boards, nothing: it is not in the cell. `obstacles`: their poses.
  void Render(std::span<const size_t> cameras, const Poses* robot,
              std::span<const std::optional<Eigen::Isometry3d>> boards, const Poses& obstacles,
              const RowSink& sink);

 private:
  // Pixels [left, right) x [top, bottom) that may be touched.
  struct Rectangle {
    int left = 0;
    int right = 0;
    int top = 0;
    int bottom = 0;
    bool shadow = false;  // by a shadow on the floor; else by the part itself
    bool board = false;   // by a board itself
  };
  // Per thread, reused from row to row.
  struct RowWork;

  void Place(size_t first, std::span<const size_t> frames, const Poses* poses);
  std::vector<Rectangle> TouchedRectangles(size_t camera) const;
  void RenderRow(size_t camera, int y, std::span<const Rectangle> rectangles, RowWork& work) const;
  void TraceBodies(size_t camera, int y, RowWork& work) const;
  void TraceShadows(RowWork& work) const;
  void TraceBoards(size_t camera, int y, std::span<const Rectangle> rectangles,
                   RowWork& work) const;

  Seen KindOf(size_t part) const;
  size_t first_board() const { return robot_frames_.size(); }
  size_t first_obstacle() const { return first_board() + settings_.boards.size(); }

  const SimulationSettings settings_;
  std::vector<Background> backgrounds_;  // by camera
  BoardTracer boards_;
  RayScene scene_;                    // the robot's parts, then the boards, then the obstacles
  std::vector<size_t> robot_frames_;  // by part
  std::vector<size_t> obstacle_frames_;
};

}  // namespace silhouette
