// SPDX-License-Identifier: Apache-2.0
// The camera images that a session keeps beside the masks.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/session/capture_settings.h"
#include "capture/session/cell_cameras.h"
#include "db/store/store.h"

namespace silhouette {

// Each image as a PNG file: losslessly compressed, for speed rather than size.
std::vector<std::string> RawImagesOf(const ImageSet& images);

// An image out of the database; empty if it is none.
cv::Mat ImageInPng(const std::string& png);

// About how many bytes the raw images of one configuration take, estimated from the references:
// the empty cell with its noise, compressed. `database` null, or without references: a byte per
// pixel; colour takes up to three times as much.
uint64_t EstimateRawBytes(const storage::v1::CellDescription& cell, const Database* database);

}  // namespace silhouette
