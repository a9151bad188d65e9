// SPDX-License-Identifier: Apache-2.0
// Recordings: video files and folders of images.
#include <algorithm>
#include <filesystem>
#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "capture/drivers/opencv/image_stream.h"
#include "capture/drivers/opencv/opencv_camera.h"
#include "common/picture/files.h"
#include "common/picture/image_file.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

class RecordedCamera : public CameraSource {
 public:
  // The next image; OutOfRange: there is none.
  using Next = std::function<absl::StatusOr<cv::Mat>()>;

  RecordedCamera(const std::string& view, Next next) : views_{view}, next_(std::move(next)) {}

  const std::vector<std::string>& views() const override { return views_; }
  absl::Duration timeout() const override { return absl::InfiniteDuration(); }

  absl::Status Trigger() override {
    asked_ = absl::Now();
    return absl::OkStatus();
  }

  absl::StatusOr<EachImage> Wait(absl::Duration) override {
    ASSIGN_OR_RETURN(const cv::Mat image, next_());
    return EachImage{CameraImageOf(image, asked_)};
  }

 private:
  const std::vector<std::string> views_;
  const Next next_;
  absl::Time asked_;
};

absl::Status AtItsEnd(const std::string& path) {
  return absl::OutOfRangeError(
      absl::StrCat(path, " has no more images; 'repeat: true' begins with its first again"));
}

}  // namespace

absl::StatusOr<std::unique_ptr<CameraSource>> OpenVideo(const std::string& view,
                                                        const VideoSource& source) {
  std::error_code error;
  if (!fs::exists(source.file, error)) {
    return absl::NotFoundError(absl::StrCat("there is no video ", source.file));
  }
  const std::shared_ptr<ImageStream> video = FileStream(source.file);
  if (!video->Open().ok() || !video->Grab() || !video->Open().ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat(source.file, " is not a video that can be read"));
  }
  const auto next = [video, source, at = 0]() mutable -> absl::StatusOr<cv::Mat> {
    if (!video->Grab()) {
      if (!source.repeat || !video->Open().ok() || !video->Grab()) return AtItsEnd(source.file);
      at = 0;
    }
    ++at;
    cv::Mat image = video->damaged() ? cv::Mat() : video->Retrieve();
    if (image.empty()) {
      return absl::InvalidArgumentError(
          absl::StrCat("image ", at, " of ", source.file, " is damaged"));
    }
    return image;
  };
  return std::make_unique<RecordedCamera>(view, next);
}

absl::StatusOr<std::unique_ptr<CameraSource>> OpenFolder(const std::string& view,
                                                         const FolderSource& source) {
  std::error_code error;
  std::vector<std::string> files;
  for (fs::directory_iterator at(source.folder, error), end; !error && at != end;
       at.increment(error)) {
    if (!at->is_regular_file()) continue;
    const std::string file = at->path().string();
    // By its bytes or by its name: a damaged image left out would let the view run ahead of others.
    if (cv::haveImageReader(file) || cv::haveImageWriter(file)) files.push_back(file);
  }
  if (error) {
    return absl::NotFoundError(
        absl::StrCat("the folder ", source.folder, " cannot be read: ", error.message()));
  }
  if (files.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("the folder ", source.folder, " has no images"));
  }
  std::sort(files.begin(), files.end());
  const auto next = [files, source, at = size_t{0}]() mutable -> absl::StatusOr<cv::Mat> {
    if (at == files.size()) {
      if (!source.repeat) return AtItsEnd(source.folder);
      at = 0;
    }
    const std::string& file = files[at++];
    const std::string bytes = ReadWholeFile(file).value_or("");
    cv::Mat image = ImageOfBytes(bytes, cv::IMREAD_ANYCOLOR);  // grey stays grey, 16 bits become 8
    if (image.empty()) {
      return absl::InvalidArgumentError(file + " is not an image that can be read, or is cut off");
    }
    RETURN_IF_ERROR(CheckUsedBits(file, bytes, image));
    return image;
  };
  return std::make_unique<RecordedCamera>(view, next);
}

}  // namespace silhouette
