// SPDX-License-Identifier: Apache-2.0
// A video of an episode: what every camera sees, and what the scene makes of it.
#pragma once

#include <opencv2/videoio.hpp>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "tools/silhouette-experiments/people/rendered_cell.h"

namespace silhouette::people_experiment {

class Video {
 public:
  // Of `views` views; `rate`: pictures a second. `path`: H.264 if it ends with .mp4, motion JPEG if
  // it ends with .avi. InvalidArgument: another ending. Unavailable: it cannot be written.
  static absl::StatusOr<Video> Open(const std::string& path, size_t views, double rate);

  // Images with obstacle, robot and error pixels laid over them, and two lines below.
  void Add(const Sight& sight, const std::string& first_line, const std::string& second_line);

 private:
  Video(cv::VideoWriter writer, size_t views) : writer_(std::move(writer)), views_(views) {}

  cv::VideoWriter writer_;
  size_t views_;
};

}  // namespace silhouette::people_experiment
