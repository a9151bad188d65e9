// SPDX-License-Identifier: Apache-2.0
// The camera images that a session keeps beside the masks.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/session/capture_settings.h"
#include "capture/session/visitor.h"
#include "db/store/store.h"

namespace silhouette {

// By view, all images of the visit as PNG files one after another, Visit::images first: losslessly
// compressed, for speed rather than size.
std::vector<std::string> RawImagesOf(const Visit& visit);

// The first image of a view out of the database; empty if it is none.
cv::Mat ImageInPng(const std::string& png);

// All of them: those that the robot image is the union of. Empty images where they are none.
std::vector<cv::Mat> ImagesInPng(std::string_view png);

// About how many bytes the raw images of one configuration take per set of images, estimated from
// the references: the empty cell with its noise, compressed. `database` null, or without
// references: a byte per pixel; colour takes up to three times as much.
uint64_t EstimateRawBytes(const storage::v1::CellDescription& cell, const Database* database);

}  // namespace silhouette
