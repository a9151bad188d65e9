// SPDX-License-Identifier: Apache-2.0
// DetectSession: the images of a session in which tags were looked for, and the warnings about
// them.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "calib/boards/board.h"
#include "calib/boards/sighting_file.h"
#include "calib/detection/image_tags.h"

namespace silhouette {

struct ImageWarning {
  std::string kind;    // a sentence that images share
  std::string detail;  // what is special of this one; empty: nothing
};

struct SessionImage {
  ImageTags tags;
  std::string source;                  // what messages call it: its file, or view and frame
  bool copy = false;                   // of another image, to the last pixel; it is left out
  std::vector<ImageWarning> warnings;  // filled by Judge
};

class DetectSession {
 public:
  // InvalidArgument, naming the images: another size than the view's other images have, or the same
  // picture as one of another view.
  absl::Status Add(ImageTags tags, const std::string& source);

  // In the order of views and frames, once they were judged.
  const std::vector<SessionImage>& images() const { return images_; }
  const std::map<std::string, Coverage>& coverage() const { return coverage_; }

  // Sorts the images and warns of what is weak in each.
  void Judge();

  std::vector<TagSighting> Sightings() const;

  // NotFound, with the likely reason, if no image shows a tag of the boards.
  absl::Status CheckThatTagsWereSeen() const;

 private:
  std::vector<SessionImage> images_;
  std::map<std::string, Coverage> coverage_;
  std::map<std::string, size_t> first_of_view_;
  std::map<uint64_t, size_t> by_digest_;
};

}  // namespace silhouette
