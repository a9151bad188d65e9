// SPDX-License-Identifier: Apache-2.0
// Collision checking: verdicts on configurations, paths and the whole configuration space, from the
// obstacle images of one scene and the robot images of one generation of the database.
//
// A view shows an obstacle if its collision image - the obstacle image inside the test robot image,
// with unknown and error pixels resolved as the policy says - has an obstacle pixel (paper §3.3). A
// configuration is occupied if at least min_views views (policy.h) show one. A view that the scene
// lacks counts as showing one; a configuration is then occupied or unknown, never free.
//
// The sound presets ask instead whether an obstacle could be where the robot would be
// (possible_space.h); a view shows what is possible there. A configuration that they find free has
// no place for an obstacle of the least size, so that it is never hidden_possible.
//
// A robot whose images are drawn is tested at exactly the joint values that are asked about. A
// motion is free if the robot is that is grown by what it moves: no policy frees anything for a
// larger robot image. So a node of an arm (drawn_kind.h) is free if its reach image is, occupied if
// its own image is, and else depends on the wrist. Under the sound presets, which look at the
// robot's body too, all nodes do.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "calib/robot/drawing/drawn_checker.h"
#include "db/mask/configuration_grid.h"
#include "server/collision/collision_images.h"
#include "server/collision/path_verdict.h"
#include "server/collision/policy.h"
#include "server/collision/possible_space.h"
#include "server/collision/robot_image_table.h"
#include "server/collision/stop.h"
#include "server/collision/test_support.h"
#include "server/collision/verdict.h"

namespace silhouette {

// The verdicts of a tile: bit i % 64 of word i / 64 for place i. A place with neither bit is
// unknown or absent from the grid.
struct TileVerdicts {
  std::array<uint64_t, kTileSize / 64> free{};
  std::array<uint64_t, kTileSize / 64> occupied{};

  bool operator==(const TileVerdicts&) const = default;
};

// Refers to a table, to obstacle images and to its support, which must outlive it. May be used by
// any number of threads; checks of joint values do not allocate, but for memory that a thread
// keeps from its first check on.
class CollisionChecker {
 public:
  // Throws std::invalid_argument if there is not one obstacle image per view, if one has not the
  // size of its view's masks, if the policy cannot be, or if `support` lacks what it needs.
  CollisionChecker(const RobotImageTable& table, const ObstacleImages& obstacle_images,
                   const Policy& policy, const TestSupport& support = {});

  // All three: `evidence` is empty, or has one entry per view, which are filled in (all zero, but
  // for missing views, where no robot image could be looked at).

  // A configuration of the grid, or a node: then evidence is of the own image where that is
  // occupied, of the reach image else. A number that no configuration has is outside the grid.
  Verdict Check(ConfigurationNumber number, std::span<ViewEvidence> evidence = {}) const;

  // Any configuration: joint values in the order of the grid. Off the grid, Policy::off_grid says
  // what stands for it; with OffGrid::kCell a view shows what it shows at any corner. A robot that
  // is drawn stands for itself.
  Verdict Check(std::span<const double> q, std::span<ViewEvidence> evidence = {}) const;

  // A verdict holds for `q` alone, or for a path through it, not for all of its grid cell.

  // The path through the waypoints, at least one (else std::invalid_argument), joint values
  // interpolated linearly and without wrapping. Exact: see segment_places.h; but a part of the
  // path in one grid cell is excluded where the box of its joint values touches a forbidden region.
  // Of a drawn robot as CheckMotion has it. `evidence` is filled in only if the path is not free.
  PathVerdict CheckPath(std::span<const Configuration> waypoints,
                        std::span<ViewEvidence> evidence = {},
                        const PathSettings& settings = {}) const;

  // All configurations of a tile of the grid. A captured one is unknown, too, if any joint values
  // nearest to it are forbidden: so a map frees no forbidden place off the grid. Nothing: it was
  // given up.
  TileVerdicts CheckTile(uint64_t tile) const { return *CheckTile(tile, nullptr); }
  std::optional<TileVerdicts> CheckTile(uint64_t tile, const Stop& stop) const;

  int min_views() const { return min_views_; }
  const ConfigurationGrid& grid() const { return table_.grid(); }

  // The test robot images of `q`, one per view: what the verdict looked at. Nothing if a robot
  // image that it takes is not there, cannot be read or drawn, or `q` is outside the grid or
  // forbidden.
  // `growth`: of a drawn robot.
  std::optional<std::vector<Mask>> TestRobotImages(std::span<const double> q,
                                                   Growth growth = {}) const;

 private:
  friend class SpaceChecker;
  friend class CellChecker;
  using Numbers = std::span<const ConfigurationNumber>;

  void PrepareLines(const Policy& policy, const TestSupport& support);
  void CheckSpace(const Policy& policy, const TestSupport& support);
  void TakePrepared(const TestSupport& support);
  std::vector<Mask> ImagesOf(const TestRobot& robot) const;
  // Configurations between two, along each joint.
  struct Between {
    std::span<const double> from{};
    std::span<const double> to{};
  };
  // What a test is asked about: where the test robot may be, and, if it is less, which of that.
  struct Asked {
    Between robot;
    Between places;
  };
  class Cell;
  // Check, for all of a part of a straight line within one grid cell.
  Verdict CheckPart(std::span<const double> q, const Between& part,
                    std::span<ViewEvidence> evidence) const;
  PathVerdict CheckDrawnPath(std::span<const Configuration> waypoints,
                             std::span<ViewEvidence> evidence, const PathSettings& settings) const;
  // Whether something possible meets the robot.
  bool SomethingPossible(const TestRobot& test_robot, const Asked& asked) const;
  // The verdict on a configuration that is present; unknown, too, if its image cannot be read.
  State StateOf(ConfigurationNumber number) const;
  bool Occupied(Numbers corner, const TestRobot& test_robot) const;
  // `part`: of which nothing may be forbidden; empty only if there is no corner.
  Verdict Judge(Numbers corners, const Between& part, std::span<ViewEvidence> evidence) const;
  // The robot as it is drawn at `q`. `growth` holds it all over `part`; `places`: of which nothing
  // may be forbidden.
  Verdict JudgeDrawn(std::span<const double> q, Growth growth, const Between& part,
                     const Between& places, std::span<ViewEvidence> evidence) const;
  Verdict JudgeNode(ConfigurationNumber number, std::span<ViewEvidence> evidence) const;
  // Whether the robot as it is drawn leaves the workspace, if there is one.
  bool LeavesWorkspace(std::span<const double> q, Growth growth) const;
  // The verdict; unknown in place of free if it does.
  Verdict IfInWorkspace(const Verdict& verdict, std::span<const double> q, Growth growth) const;
  // Whether the map has it that the node nearest to `q` is free.
  bool IsFreeByMap(std::span<const double> q) const;
  // As JudgeDrawn, by planes that are prepared; nothing: that does not decide.
  std::optional<Verdict> JudgePrepared(std::span<const double> q, Growth growth) const;
  // `grown`: the test robot is larger than at any place.
  Verdict JudgeTaken(const TestRobot& test_robot, bool grown, const Asked& asked,
                     std::span<ViewEvidence> evidence) const;
  void BeginEvidence(std::span<ViewEvidence> evidence) const;
  // How many of the views, of which `showing` have an obstacle pixel in the intersection image,
  // show an obstacle once the lines are searched; counts on only while it matters.
  int ShowingAlongLines(const TestRobot& test_robot, int showing) const;
  // The words that a view shows an obstacle by; the view is not missing.
  MaskWords ShownBy(int view) const {
    const auto i = static_cast<size_t>(view);
    if (resolved_ != nullptr) return (*resolved_)[i]->words();
    if (!own_resolved_.empty()) return own_resolved_[i]->words();
    return obstacle_images_[i]->obstacle().words();
  }
  // Why the robot images at these corners cannot be used for a part; kNone if they can. `part`:
  // empty: a node, whose state tells what is forbidden.
  Reason Unusable(Numbers corners, const Between& part) const;

  const RobotImageTable& table_;
  const ObstacleImages& obstacle_images_;
  // Set if lines are searched in the intersection images.
  const EpipolarBands* searched_bands_ = nullptr;
  // Set, one or the other, if lines are searched in the obstacle images.
  const CollisionImages* resolved_ = nullptr;
  CollisionImages own_resolved_;
  // Set if the preset is a sound one.
  const PossibleSpace* possible_space_ = nullptr;
  TestSupport::RobotMayTouch robot_may_touch_;
  TestSupport::RobotMayMeet robot_may_meet_;
  bool voxels_decide_ = false;
  std::optional<Eigen::AlignedBox3d> workspace_;
  const DrawnChecker* drawn_ = nullptr;  // set if it decides
  std::function<bool(ConfigurationNumber)> node_is_free_;
  // Whether every view has unknown or error pixels inside any test robot image.
  bool always_hiding_ = false;
  int min_views_ = 1;
  int missing_views_ = 0;
  OffGrid off_grid_ = OffGrid::kCell;
};

}  // namespace silhouette
