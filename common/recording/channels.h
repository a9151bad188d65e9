// SPDX-License-Identifier: Apache-2.0
// What a recording has: messages of the API under these topics, and camera images as
// foxglove.CompressedImage, which Foxglove shows.
//
// * /database: silhouette.v1.GetDatabaseResponse, at the beginning of each file, before each state,
//   and when it changes
// * /state: silhouette.v1.ServedState, there, every few seconds, and when it changes
// * /scene: silhouette.v1.Scene, with its planes
// * /path: silhouette.v1.WatchedPath, each answer to a client that watches a path
// * /camera/<view>: foxglove.CompressedImage, JPEG
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/mcap/mcap.h"
#include "silhouette/v1/database_service.pb.h"
#include "silhouette/v1/scene_service.pb.h"

namespace silhouette {

// The places of the channels in ChannelsOf.
enum RecordingChannel : uint16_t {
  kDatabaseChannel,
  kStateChannel,
  kSceneChannel,
  kPathChannel,
  kFirstCameraChannel,  // those of the views follow, in the order of the database
};

std::vector<McapChannel> ChannelsOf(const v1::GetDatabaseResponse& database);

// A serialized foxglove.CompressedImage.
std::string CompressedImageOf(const std::string& jpeg, absl::Time taken);
// The JPEG file in it. DataLoss: it cannot be parsed.
absl::StatusOr<std::string> JpegOfCompressedImage(const std::string& serialized);

}  // namespace silhouette
