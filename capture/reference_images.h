// The reference images of a cell: taken by its cameras, kept in its database.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/cell_cameras.h"
#include "capture/segmentation/reference.h"
#include "db/store.h"

namespace silhouette {

struct ReferenceObserver {
  // Sets of images so far.
  std::function<void(uint64_t done)> progress = [](uint64_t) {};
  std::function<void(const std::string& line)> say = [](const std::string&) {};
  std::function<bool()> stop_requested = [] { return false; };
};

// Takes `count` sets of images of the empty cell, at least two, `pause` apart. Errors are those of
// the cameras; Cancelled if a stop was requested.
absl::StatusOr<storage::v1::References> TakeReferences(CellCameras& cameras, int count,
                                                       absl::Duration pause,
                                                       const ReferenceObserver& observer = {});

// The database's references as the segmentation wants them, one per view. NotFound if there are
// none. DataLoss, naming the view, if one cannot be read. FailedPrecondition if one has not the
// size of its view's camera image.
absl::StatusOr<std::vector<Reference>> ReadReferences(const Database& database);

}  // namespace silhouette
