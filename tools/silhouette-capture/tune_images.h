// The images that silhouette-capture tune looks at.
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "capture/segmentation/reference.h"
#include "db/store/store.h"

namespace silhouette {

struct TuneImage {
  std::string name;  // "17, top" or "pictures/top.png"
  int view = 0;
  cv::Mat image;
  std::shared_ptr<const Reference> reference;
  bool empty = false;            // nothing but the cell is in it: all foreground is false
  std::optional<Mask> recorded;  // of the database's robot image
};

// The raw images of at most `most` configurations, spread over those that have some, in all views,
// with the references that they were taken with. DataLoss if one cannot be read.
absl::StatusOr<std::vector<TuneImage>> RawImagesToTune(const Database& database, int most);

// The images in a folder, VIEW.png, VIEW.jpg or VIEW.jpeg for each view that has one, with the
// database's references. NotFound if there are none; InvalidArgument, naming the file, if one
// cannot be read or is not of its view's size.
absl::StatusOr<std::vector<TuneImage>> FolderImagesToTune(const Database& database,
                                                          const std::string& folder, bool empty);

}  // namespace silhouette
