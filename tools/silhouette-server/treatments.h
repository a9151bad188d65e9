// Safety margins and ignored pixels as the cell file states them.
#pragma once

#include "absl/status/statusor.h"
#include "server/scene/view_treatment.h"
#include "tools/cell/cell.h"

namespace silhouette {

// Reads the images of ignored pixels and, where a margin is a length, finds the workspace. NotFound
// and InvalidArgument name the view and the file: an image that is not there, is none, or has
// neither the size of the view's mask nor of its camera image. Further errors: WorkspaceOf.
absl::StatusOr<TreatmentSettings> TreatmentSettingsOf(const Cell& cell);

}  // namespace silhouette
