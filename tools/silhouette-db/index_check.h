// The collision index against the robot images that it should hold.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "db/store/collision_index.h"

namespace silhouette {

// Is given all records in the order of their numbers, rebuilds the tiles from them, and
// compares.
class IndexCheck {
 public:
  // `index` must outlive it. The records are those of its snapshot.
  explicit IndexCheck(const CollisionIndex& index);

  // The next record; an error status stands for one that cannot be read.
  void Take(ConfigurationNumber number, const absl::StatusOr<RobotImage>& image);
  // There are no more.
  void Finish();

  // A sentence per tile whose index is not what its robot images give.
  const std::vector<std::string>& faults() const { return faults_; }

 private:
  void CompareTile();

  const CollisionIndex& index_;
  TileIndexBuilder builder_;
  std::optional<uint64_t> tile_;
  bool readable_ = true;  // all records of the tile
  std::vector<std::string> faults_;
};

}  // namespace silhouette
