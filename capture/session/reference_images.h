// The reference images of a cell: taken by its cameras, kept in its database.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "capture/segmentation/reference.h"
#include "capture/session/capture_observer.h"
#include "capture/session/cell_cameras.h"
#include "db/store/store.h"

namespace silhouette {

// Takes `count` sets of images of the empty cell, at least two. Errors are those of
// the cameras; Cancelled if a stop was requested.
absl::StatusOr<storage::v1::References> TakeReferences(CellCameras& cameras, int count,
                                                       const CaptureObserver& observer = {});

// The database's references as the segmentation wants them, one per view. NotFound if there are
// none. DataLoss, naming the view, if one cannot be read. FailedPrecondition if one has not the
// size of its view's camera image.
absl::StatusOr<std::vector<Reference>> ReadReferences(const Database& database);

// The same of others that a database kept.
absl::StatusOr<std::vector<Reference>> ReferencesIn(const storage::v1::References& stored,
                                                    const storage::v1::CellDescription& cell);

}  // namespace silhouette
