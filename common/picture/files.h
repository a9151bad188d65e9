// SPDX-License-Identifier: Apache-2.0
// Whole files in one call.
#pragma once

#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace silhouette {

// NotFound, FailedPrecondition (no permission, a folder) or Internal, each naming the file.
absl::StatusOr<std::string> ReadWholeFile(const std::string& path);

// FailedPrecondition, naming it, of a pipe or device, which may never end.
absl::Status RefusePipe(const std::string& path);

// Overwrites, where a link points, too. Whoever reads it meanwhile finds all of the new file or of
// the old one, which stays unless all is written; not if its folder takes no other file. Besides
// the errors above: ResourceExhausted if the disk is full.
absl::Status WriteWholeFile(const std::string& path, std::string_view bytes);

// Makes the folder and those that it is in, as far as they are not there. FailedPrecondition if
// that cannot be.
absl::Status MakeFolder(const std::string& path);

}  // namespace silhouette
