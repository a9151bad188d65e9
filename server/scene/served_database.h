// One generation of a database, in memory: what scenes are made with and verdicts rest on.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/segmentation/reference.h"
#include "db/store.h"
#include "server/collision/robot_image_table.h"

namespace silhouette {

// Cannot be changed once loaded; used by any number of threads.
class ServedDatabase {
 public:
  // Reads all robot images and the reference images. A record that fails its checksum is marked
  // corrupt, so that nothing that takes it is ever free. DataLoss: the database cannot be read as a
  // whole. InvalidArgument: its grid is too large to hold in memory.
  static absl::StatusOr<std::shared_ptr<const ServedDatabase>> Load(const Database& database);

  const storage::v1::CellDescription& cell() const { return cell_; }
  uint64_t generation() const { return generation_; }
  const RobotImageTable& robot_images() const { return robot_images_; }
  const ConfigurationGrid& grid() const { return robot_images_.grid(); }

  int views() const { return robot_images_.views(); }
  const std::string& view_name(int view) const { return cell_.views(view).name(); }
  // The view of this name; nothing if there is none.
  std::optional<int> ViewOf(const std::string& name) const;

  // Whether camera images can be differenced.
  bool has_references() const { return !references_.empty(); }
  // The reference image of a view; has_references() must hold.
  const Reference& reference(int view) const { return references_[static_cast<size_t>(view)]; }

 private:
  ServedDatabase(storage::v1::CellDescription cell, uint64_t generation,
                 RobotImageTable robot_images, std::vector<Reference> references);

  storage::v1::CellDescription cell_;
  uint64_t generation_ = 0;
  RobotImageTable robot_images_;
  std::vector<Reference> references_;
};

}  // namespace silhouette
