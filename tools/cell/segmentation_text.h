// SPDX-License-Identifier: Apache-2.0
// Settings of the segmentation out of texts: those of a database, and those of a command line.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "capture/segmentation/settings.h"
#include "db/store/store.h"

namespace silhouette {

// The keys in `text`, YAML as in the section `segmentation` of a cell file, with or without the
// braces of a flow map; what is not in it is as in `usual`. `source`: what messages call the text.
// InvalidArgument if a key is unknown or a value is not valid.
absl::StatusOr<SegmentationSettings> SegmentationIn(const std::string& text,
                                                    const std::string& source,
                                                    const SegmentationSettings& usual);

// The settings that a database's masks were made with. NotFound: its masks were made elsewhere.
// InvalidArgument: it names what is not known here.
absl::StatusOr<SegmentationSettings> SegmentationOf(const storage::v1::CellDescription& cell);

// What to write into a cell file so that it has the database's settings, as half a sentence that
// begins with "; "; empty if it has them, or they are not known.
std::string SegmentationAdvice(const SegmentationSettings& of_cell_file,
                               const storage::v1::CellDescription& database);

}  // namespace silhouette
