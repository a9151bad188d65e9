#include "server/collision/test_robot.h"

namespace silhouette {

bool TestRobot::Take(const RobotImageTable& table, std::span<const ConfigurationNumber> corners) {
  table_ = &table;
  corners_ = corners;
  if (table.in_memory()) return true;
  united_.resize(table.words());
  if (!table.Read(corners.front(), united_)) return false;
  read_.resize(table.words());
  for (const ConfigurationNumber corner : corners.subspan(1)) {
    if (!table.Read(corner, read_)) return false;
    for (size_t i = 0; i < united_.size(); ++i) united_[i] |= read_[i];
  }
  return true;
}

TestRobot::View TestRobot::view(int view) const {
  View result;
  if (!table_->in_memory()) {
    size_t before = 0;
    for (const MaskSize size : table_->mask_sizes().first(static_cast<size_t>(view))) {
      before += size.words();
    }
    result.images_[0] = united_.data() + before;
    return result;
  }
  result.count_ = corners_.size();
  for (size_t i = 0; i < corners_.size(); ++i) {
    result.images_[i] = table_->image(view, corners_[i]).data();
  }
  return result;
}

MaskWords TestRobot::Words(int view, std::span<uint64_t> room) const {
  const View robot = this->view(view);
  const size_t count = table_->mask_sizes()[static_cast<size_t>(view)].words();
  if (robot.count_ == 1) return {robot.images_[0], count};
  for (size_t i = 0; i < count; ++i) room[i] = robot[i];
  return room.first(count);
}

}  // namespace silhouette
