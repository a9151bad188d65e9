// SPDX-License-Identifier: Apache-2.0
// All robot images of one generation of a database. A table holds them in memory, per view one
// contiguous block; or it reads them whenever they are needed, from where they are stored, and
// holds but a few bytes for each; or it draws them, on the grid and off it, and holds none. Cannot
// be changed once built; read by any number of threads.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "calib/robot/drawing/drawn_kind.h"
#include "calib/robot/drawing/drawn_robot.h"
#include "db/index/place_set.h"
#include "db/mask/configuration_grid.h"
#include "db/mask/joint_regions.h"
#include "db/mask/mask.h"

namespace silhouette {

// What the table holds for a configuration.
enum class RobotImageState : uint8_t {
  kMissing = 0,  // nothing was captured; also a number that no configuration has
  kPresent,      // also in a region the robot must never enter, if images are captured
  kExcluded,     // in such a region, without a captured image that is usable
  kCorrupt,      // a record that fails its checksum
  kElsewhere,    // captured while a joint outside the grid was not where the cell has it
  kSuspect,      // captured while the cell may have changed
  kEmpty,        // shows the robot in no view: no obstacle could meet it
};

class RobotImageTable {
 public:
  class Builder;

  // Writes the words of a configuration's robot images into `words`, one view after another. False
  // if that cannot be done, or not any more. Called by any number of threads.
  using Reader = std::function<bool(ConfigurationNumber number, std::span<uint64_t> words)>;

  // A table that draws. All that is to be added to the robot, its tolerance among it, is in the
  // radii of its parts. `forbidden`: where the robot must never be. Throws std::invalid_argument if
  // there is no robot, or as RequireDrawnPlaces does; and as AsKind does, for a grid of nodes.
  static RobotImageTable Drawn(ConfigurationGrid grid, std::shared_ptr<const DrawnRobot> robot,
                               JointRegions forbidden = {});

  const ConfigurationGrid& grid() const { return grid_; }
  int views() const { return static_cast<int>(mask_sizes_.size()); }
  std::span<const MaskSize> mask_sizes() const { return mask_sizes_; }

  RobotImageState state(ConfigurationNumber number) const {
    if (number >= slots_.size()) return drawn_ ? DrawnState(number) : RobotImageState::kMissing;
    const uint32_t slot = slots_[number];
    return slot < kFirstMark ? RobotImageState::kPresent
                             : static_cast<RobotImageState>(slot - kFirstMark);
  }

  // Whether robot images are held in memory, and not read or drawn when they are needed.
  bool in_memory() const { return reader_ == nullptr && drawn_ == nullptr; }

  // What is drawn; null for any other table.
  const std::shared_ptr<const DrawnRobot>& drawn() const { return drawn_; }
  // Where the robot must never be.
  const JointRegions& forbidden() const { return forbidden_; }

  // Drawn tables, both:
  // What stands for all joint values between two, along each joint: kPresent, kExcluded where one
  // may be forbidden, or kMissing where one is beyond the grid's or the robot's limits.
  RobotImageState StateBetween(std::span<const double> from, std::span<const double> to) const;
  // Draws the robot at exactly `q`, each part grown by `growth`, into `words`, as Read does. Memory
  // is the thread's. Throws std::invalid_argument if it cannot be drawn.
  void Draw(std::span<const double> q, Growth growth, std::span<uint64_t> words) const;

  // Whether the grid's configurations are nodes of the arm (drawn_kind.h). Their state is that of
  // all joint values whose nearest node they are.
  bool has_nodes() const { return reach_ != nullptr; }
  // What is drawn of nodes. `kind`: kOwn or kReach. Null if there are none.
  const std::shared_ptr<const DrawnRobot>& node_robot(DrawnKind kind) const {
    return kind == DrawnKind::kOwn ? own_ : reach_;
  }
  // Draws a node's image into `words`, as Read does. `kind`: kOwn or kReach. Throws as Draw does.
  void DrawNode(DrawnKind kind, ConfigurationNumber number, std::span<uint64_t> words) const;

  // Words of a configuration's robot images in all views.
  size_t words() const { return words_; }

  // Copies, reads or draws the robot images of a configuration whose state is kPresent into
  // `words`, which has just the room, one view after another. False if that fails: then nothing is
  // known of them. It does not in tables in memory. Nodes have no such image.
  bool Read(ConfigurationNumber number, std::span<uint64_t> words) const;

  // The same as masks, one per view; nothing if they cannot be read. Also of kEmpty: no pixels.
  std::optional<std::vector<Mask>> Images(ConfigurationNumber number) const;

  // The robot image of a configuration whose state is kPresent, in a table in memory.
  MaskWords image(int view, ConfigurationNumber number) const {
    const size_t words = mask_sizes_[static_cast<size_t>(view)].words();
    return {images_[static_cast<size_t>(view)].data() + slots_[number] * words, words};
  }

  // The configurations of a tile of the grid that can stand for all joint values whose nearest they
  // are: their state is kPresent, and none of these values is forbidden. None of a table that
  // draws.
  const PlaceSet& present(uint64_t tile) const { return present_sets_[drawn_ ? 0 : tile]; }

  // Number of configurations in a state; captured ones in a region the robot must never enter count
  // as kExcluded. Where a table draws, all of the grid's are kPresent.
  uint64_t Count(RobotImageState state) const;

  // The pixels that the robot covers in every usable robot image, those in forbidden regions
  // included; no pixel if there is no image. Of a robot that is drawn, those that its fixed parts
  // touch.
  const Mask& permanent(int view) const { return permanent_[static_cast<size_t>(view)]; }
  // The pixels that it covers in any of them. Of a robot that is drawn, all pixels.
  const Mask& covered(int view) const { return covered_[static_cast<size_t>(view)]; }

 private:
  // slots_ has for every number the place of its images in images_ (anything but a mark, where they
  // are not held), or one of these marks.
  static constexpr uint32_t kFirstMark = 0xfffffff0;

  RobotImageTable(ConfigurationGrid grid, std::vector<MaskSize> mask_sizes);
  RobotImageState DrawnState(ConfigurationNumber number) const;
  // Whether any of the joint values whose nearest configuration is `q` is forbidden.
  bool IsForbiddenNear(const Configuration& q) const;
  void DrawRobot(const DrawnRobot& robot, std::span<const double> q, Growth growth,
                 std::span<uint64_t> words) const;
  std::vector<Mask> DrawnFixedParts() const;
  std::vector<Mask> MasksOf(std::span<const uint64_t> words) const;

  ConfigurationGrid grid_;
  std::vector<MaskSize> mask_sizes_;
  size_t words_ = 0;
  Reader reader_;  // null: images are in memory, or drawn
  std::shared_ptr<const DrawnRobot> drawn_;
  std::shared_ptr<const DrawnRobot> own_;    // of nodes
  std::shared_ptr<const DrawnRobot> reach_;  // of nodes
  JointRegions forbidden_;
  std::vector<uint32_t> slots_;
  std::vector<std::vector<uint64_t>> images_;  // per view, if in memory
  std::vector<PlaceSet> present_sets_;         // by tile; a single one if images are drawn
  std::vector<Mask> permanent_;
  std::vector<Mask> covered_;
  std::array<uint64_t, 7> counts_{};  // by state; not of what is missing
};

class RobotImageTable::Builder {
 public:
  // A table in memory. `mask_sizes`: one per view, at least one, all valid. `expected`: about how
  // many images will be added, to reserve memory. `forbidden`: where the robot must never be; its
  // configurations count as kExcluded. Throws std::invalid_argument if this does not hold, if the
  // grid has more than 2^32 - 16 places, or a joint that stands for any value, or lacks one of
  // `forbidden`.
  Builder(ConfigurationGrid grid, std::vector<MaskSize> mask_sizes, uint64_t expected = 0,
          JointRegions forbidden = {});

  // A table that reads by `reader`, which must not be null. What is added is looked at and not
  // kept.
  Builder(ConfigurationGrid grid, std::vector<MaskSize> mask_sizes, Reader reader,
          JointRegions forbidden = {});

  // Each configuration is added once, by one of these. Throws std::invalid_argument for one that is
  // outside the grid or added twice, and for masks that do not fit the views.
  void Add(ConfigurationNumber number, std::span<const Mask> masks);
  // The words of the masks, one view after another.
  void Add(ConfigurationNumber number, std::span<const uint64_t> words);
  // One without a robot image that can be used. `state`: why.
  void AddWithout(ConfigurationNumber number, RobotImageState state);

  // The finished table; the builder is empty afterwards.
  RobotImageTable Build() &&;

 private:
  void HoldNothing(JointRegions forbidden);
  void Forbid();
  void Exclude(ConfigurationNumber number);
  void RequireNew(ConfigurationNumber number) const;

  RobotImageTable table_;
  // The pixels that all, and that any of the images added cover, as they stand in an image.
  std::vector<uint64_t> common_;
  std::vector<uint64_t> covered_;
};

// The test robot images of one test: in every view the union of the robot images at the corners of
// a grid cell, or the robot as it is drawn.
// For one thread, test after test: where images are read, they come into memory that is used again.
class TestRobot {
 public:
  // Takes the robot images of these configurations, at most as many as a cell has corners, whose
  // state is kPresent; both must outlive what is done with it. False if one of them cannot be read:
  // nothing is known then.
  bool Take(const RobotImageTable& table, std::span<const ConfigurationNumber> corners);

  // Takes the robot as the table draws it at `q`, each part grown by `growth`. The table must
  // outlive what is done with it. False where RobotImageTable::Draw throws: nothing is known then.
  bool Draw(const RobotImageTable& table, std::span<const double> q, Growth growth);

  // Takes a node's image, as RobotImageTable::DrawNode draws it.
  void DrawNode(const RobotImageTable& table, DrawnKind kind, ConfigurationNumber number);

  // The test robot image of a view, as it is looked at word by word. Refers to the TestRobot until
  // it takes the next.
  class View {
   public:
    uint64_t operator[](size_t word) const {
      uint64_t bits = images_[0][word];
      for (size_t i = 1; i < count_; ++i) bits |= images_[i][word];
      return bits;
    }

   private:
    friend class TestRobot;
    std::array<const uint64_t*, 1 << kMaxJoints> images_;
    size_t count_ = 1;
  };
  View view(int view) const;

  // The same in one piece, for which `room` is used if need be.
  MaskWords Words(int view, std::span<uint64_t> room) const;

 private:
  const RobotImageTable* table_ = nullptr;
  std::span<const ConfigurationNumber> corners_;
  // If images are not in memory: the union of those read or drawn, one view after another.
  std::vector<uint64_t> united_;
  std::vector<uint64_t> read_;
};

// Why a view cannot show where the robot is, in one sentence; empty: it can. `any`: what the robot
// covers in it in any of `images` captured configurations; `every`: what it covers in each. Such a
// view would decide against every obstacle.
std::string WhyNoMotionShows(const std::string& view, const Mask& any, const Mask& every,
                             uint64_t images);

}  // namespace silhouette
