// SPDX-License-Identifier: Apache-2.0
// What people and other programs give: lists of configurations, folders of images, regions, times.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "absl/time/time.h"
#include "silhouette/configuration_grid.h"
#include "silhouette/v1/scene_service.pb.h"
#include "tools/program/path_file.h"
#include "tools/silhouette/formats/typed_joints.h"

namespace silhouette {

// A configuration per line, values separated by commas or blanks; empty lines and what follows a #
// do not count; at least one. `file` "-": standard input. Errors of `joints` name file and line.
absl::StatusOr<std::vector<Configuration>> ReadConfigurations(const std::string& file,
                                                              TypedJoints& joints);

// The values on one such line; none if there is nothing on it.
std::vector<std::string> ValuesOnLine(absl::string_view line);

// `file` "-": standard input.
absl::StatusOr<PathFile> ReadPath(const std::string& file);

struct ImageFile {
  std::string view;
  std::string path;
};

struct ImagesFolder {
  // When the images were taken; nothing if that is not recorded.
  std::optional<absl::Time> time;
  // Where the robot stood then: names and values.
  std::vector<std::pair<std::string, double>> joints;
  std::vector<ImageFile> images;
};

// Reads images.json in `folder`: {"time": RFC 3339 (optional), "joints": {name: radians or metres},
// "views": {name: file, relative to the folder}}. Errors name the file and the key.
absl::StatusOr<ImagesFolder> ReadImagesFolder(const std::string& folder);

// "VIEW:x,y;x,y;x,y": a polygon in pixels of the mask. InvalidArgument, naming the text, if it is
// none.
absl::StatusOr<v1::RegionPixels> ParseRegionPolygon(const std::string& text);

// "VIEW=FILE": an image file of the mask, white where the region lies. Errors name the text or the
// file.
absl::StatusOr<v1::RegionPixels> ReadRegionMask(const std::string& text);

// "name=value" in its two parts; nothing if one of them is missing.
std::optional<std::pair<std::string, std::string>> SplitAtEquals(const std::string& text);

}  // namespace silhouette
