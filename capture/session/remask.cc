#include "capture/session/remask.h"

#include <algorithm>
#include <atomic>
#include <map>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "capture/reference_images.h"
#include "capture/segmentation/difference.h"
#include "capture/session/raw_archive.h"

namespace silhouette {
namespace {

// Reference images by their id, read once.
class KeptReferences {
 public:
  absl::StatusOr<const std::vector<Reference>*> Get(const Snapshot& snapshot,
                                                    const storage::v1::CellDescription& cell,
                                                    uint64_t id) {
    const std::lock_guard lock(mutex_);
    const auto known = references_.find(id);
    if (known != references_.end()) return &known->second;
    const auto stored = snapshot.ReferencesOf(id);
    if (!stored.ok()) return stored.status();
    auto references = ReferencesIn(*stored, cell);
    if (!references.ok()) return references.status();
    return &references_.emplace(id, *std::move(references)).first->second;
  }

 private:
  std::mutex mutex_;
  std::map<uint64_t, std::vector<Reference>> references_;
};

class Work {
 public:
  Work(const Database& database, const RemaskOptions& options, std::vector<RobotImage>& images)
      : database_(database), options_(options), images_(images) {}

  absl::Status Run() {
    std::vector<std::jthread> threads;
    running_ = std::max(options_.threads, 1);
    for (int i = running_; i > 0; --i) threads.emplace_back([this] { MakeMasks(); });
    while (running_ > 0) {
      absl::SleepFor(absl::Milliseconds(20));
      if (options_.progress && !options_.progress(done_, images_.size())) {
        Fail(absl::CancelledError("stopped; nothing was changed"));
      }
    }
    threads.clear();
    const std::lock_guard lock(mutex_);
    return status_;
  }

 private:
  void MakeMasks() {
    const auto snapshot = database_.Read();
    if (!snapshot.ok()) Fail(snapshot.status());
    while (!failed_) {
      const size_t next = next_++;
      if (next >= images_.size()) break;
      if (!images_[next].excluded) {
        try {
          absl::Status status = Make(*snapshot, images_[next]);
          if (!status.ok()) Fail(std::move(status));
        } catch (const std::invalid_argument& error) {
          Fail(absl::InvalidArgumentError(error.what()));
        }
      }
      ++done_;
    }
    --running_;
  }

  absl::Status Make(const Snapshot& snapshot, RobotImage& image) {
    std::vector<Mask> masks;
    for (int v = 0; v < database_.cell().views_size(); ++v) {
      const auto raw = snapshot.FindRawImage(image.number, v);
      if (!raw.ok()) return raw.status();
      if (!raw->has_value()) return Unreadable(image.number, v);
      const auto references = references_.Get(snapshot, database_.cell(), (*raw)->references);
      if (!references.ok()) return references.status();
      const cv::Mat picture = ImageInPng((*raw)->png);
      const Reference& reference = (**references)[static_cast<size_t>(v)];
      if (picture.size() != reference.size()) return Unreadable(image.number, v);
      masks.push_back(Difference(picture, reference, options_.segmentation,
                                 options_.mask_sizes[static_cast<size_t>(v)]));
    }
    image.masks = std::move(masks);
    return absl::OkStatus();
  }

  absl::Status Unreadable(ConfigurationNumber number, int view) const {
    return absl::DataLossError(absl::StrCat("the raw image of configuration ", number,
                                            " in the view '", database_.cell().views(view).name(),
                                            "' cannot be read; capture it anew"));
  }

  void Fail(absl::Status status) {
    const std::lock_guard lock(mutex_);
    status_.Update(status);
    failed_ = true;
  }

  const Database& database_;
  const RemaskOptions& options_;
  std::vector<RobotImage>& images_;
  KeptReferences references_;
  std::atomic<size_t> next_ = 0;
  std::atomic<uint64_t> done_ = 0;
  std::atomic<int> running_ = 0;
  std::atomic<bool> failed_ = false;
  std::mutex mutex_;
  absl::Status status_;  // guarded by mutex_
};

void Count(const Mask& before, const Mask& after, ViewChange& change) {
  if (before.size() != after.size()) return;
  change.before += before.Count();
  if (before == after) return;
  ++change.images;
  for (int y = 0; y < before.height(); ++y) {
    for (int x = 0; x < before.width(); ++x) {
      change.added += after.at(x, y) && !before.at(x, y) ? 1 : 0;
      change.removed += before.at(x, y) && !after.at(x, y) ? 1 : 0;
    }
  }
}

// What is to be made anew, and what is excluded.
absl::Status ReadRecords(const Snapshot& snapshot, const RemaskOptions& options, Remasked& result) {
  const auto numbers = snapshot.RawImageNumbers();
  if (!numbers.ok()) return numbers.status();
  const auto visit = [&](ConfigurationNumber number, absl::StatusOr<RobotImage> image) {
    const bool has_raw = std::binary_search(numbers->begin(), numbers->end(), number);
    const bool excluded = image.ok() && image->excluded;
    if (!has_raw && !excluded) {
      ++result.left_out;
    } else if (image.ok()) {
      result.excluded += excluded ? 1 : 0;
      result.images.push_back(*std::move(image));
    } else {
      ++result.left_out;
    }
    return true;
  };
  const absl::Status status = snapshot.ForEach(visit);
  if (!status.ok() && !absl::IsDataLoss(status)) return status;
  if (result.left_out == 0 || options.leave_out) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat(result.left_out, " of ", result.left_out + result.images.size(),
                   " robot images have no raw images that can be read: their masks cannot be made "
                   "anew"));
}

}  // namespace

absl::StatusOr<Remasked> Remask(const Database& database, const RemaskOptions& options) {
  const auto snapshot = database.Read();
  if (!snapshot.ok()) return snapshot.status();
  Remasked result;
  if (absl::Status status = ReadRecords(*snapshot, options, result); !status.ok()) return status;
  const std::vector<RobotImage> before = result.images;
  absl::Status status = Work(database, options, result.images).Run();
  if (!status.ok()) return status;
  for (const storage::v1::View& view : database.cell().views()) {
    result.views.push_back({.name = view.name()});
  }
  for (size_t i = 0; i < before.size(); ++i) {
    for (size_t v = 0; v < before[i].masks.size(); ++v) {
      Count(before[i].masks[v], result.images[i].masks[v], result.views[v]);
    }
  }
  return result;
}

}  // namespace silhouette
