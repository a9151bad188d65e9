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

// What a file that was written outlasts. kPowerFailure takes milliseconds a file.
enum class Outlasts { kProcess, kPowerFailure };

// Replaces the file, or the file that a symbolic link points to, in one step: readers see the whole
// old file or the whole new one, and the old one stays if the write fails. Written in place if no
// other file can be made in its folder. Besides the errors above: ResourceExhausted if the disk is
// full. Outlasts::kPowerFailure holds only if another file can be made in the folder.
absl::Status WriteWholeFile(const std::string& path, std::string_view bytes,
                            Outlasts outlasts = Outlasts::kProcess);

// Makes the folder and those that it is in, as far as they are not there. FailedPrecondition if
// that cannot be.
absl::Status MakeFolder(const std::string& path);

}  // namespace silhouette
