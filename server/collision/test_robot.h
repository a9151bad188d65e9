// The test robot images of one test: in every view the union of the robot images at the corners of
// a grid cell.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "db/mask/configuration_grid.h"
#include "db/mask/mask.h"
#include "server/collision/robot_image_table.h"

namespace silhouette {

// For one thread, test after test: where images are read, they come into memory that is used again.
class TestRobot {
 public:
  // Takes the robot images of these configurations, at most as many as a cell has corners, whose
  // state is kPresent; both must outlive what is done with it. False if one of them cannot be read:
  // nothing can be told then.
  bool Take(const RobotImageTable& table, std::span<const ConfigurationNumber> corners);

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
  // If images are not in memory: the union of those that were read, one view after another.
  std::vector<uint64_t> united_;
  std::vector<uint64_t> read_;
};

}  // namespace silhouette
