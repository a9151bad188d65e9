// SPDX-License-Identifier: Apache-2.0
#include "capture/session/remask.h"

#include <algorithm>
#include <map>
#include <mutex>
#include <stdexcept>
#include <utility>

#include "absl/strings/str_cat.h"
#include "capture/segmentation/difference.h"
#include "capture/session/raw_archive.h"
#include "capture/session/reference_images.h"
#include "common/parallel/parallel.h"
#include "db/status/status_macros.h"
#include "db/store/schema.h"

namespace silhouette {
namespace {

constexpr size_t kBatch = 128;

// Reference images by their id, read once.
class KeptReferences {
 public:
  absl::StatusOr<const std::vector<Reference>*> Get(const Snapshot& snapshot,
                                                    const storage::v1::CellDescription& cell,
                                                    uint64_t id) {
    const std::lock_guard lock(mutex_);
    const auto known = references_.find(id);
    if (known != references_.end()) return &known->second;
    ASSIGN_OR_RETURN(const auto stored, snapshot.ReferencesOf(id));
    ASSIGN_OR_RETURN(auto references, ReferencesIn(stored, cell));
    return &references_.emplace(id, std::move(references)).first->second;
  }

 private:
  std::mutex mutex_;
  std::map<uint64_t, std::vector<Reference>> references_;
};

void Count(const Mask& before, const Mask& after, ViewChange& change) {
  if (before.size() != after.size()) return;
  change.before += before.Count();
  if (before == after) return;
  ++change.images;
  change.added += (after - before).Count();
  change.removed += (before - after).Count();
}

// The work on one variant.
class VariantRemask {
 public:
  VariantRemask(const Database& database, const RemaskOptions& options)
      : database_(database), options_(options) {
    result_.name = database.variant();
    for (const storage::v1::View& view : database.cell().views()) {
      result_.views.push_back({.name = view.name()});
    }
  }

  const RemaskedVariant& result() const { return result_; }
  uint64_t records() const { return result_.configurations + result_.excluded; }

  // Finds out what is to be made.
  absl::Status CountRecords() {
    ASSIGN_OR_RETURN(const auto snapshot, database_.Read());
    ASSIGN_OR_RETURN(auto numbers, snapshot.RawImageNumbers());
    with_raw_images_ = std::move(numbers);
    return snapshot.ForEach([&](ConfigurationNumber, const absl::StatusOr<RobotImage>& image) {
      if (!IsMade(image)) {
        ++result_.left_out;
      } else {
        ++(image->excluded ? result_.excluded : result_.configurations);
      }
      return true;
    });
  }

  absl::Status CopyHistory(Database& into) const {
    ASSIGN_OR_RETURN(const auto snapshot, database_.Read());
    ASSIGN_OR_RETURN(const auto history, snapshot.CaptureHistory());
    return into.SetCaptureHistory(history);
  }

  // `tell`: with how many more records are done; false stops.
  absl::Status Write(Database& into, const std::string& program,
                     const std::function<bool(uint64_t)>& tell) {
    ASSIGN_OR_RETURN(const auto snapshot, database_.Read());
    ASSIGN_OR_RETURN(auto writer, into.Write(program));
    std::vector<RobotImage> batch;
    absl::Status status;
    const auto finish = [&] {
      status.Update(MakeBatch(into.mask_sizes(), batch, writer));
      if (status.ok() && !tell(batch.size())) {
        status = absl::CancelledError("stopped; nothing was changed");
      }
      batch.clear();
      return status.ok();
    };
    const absl::Status read =
        snapshot.ForEach([&](ConfigurationNumber, absl::StatusOr<RobotImage> image) {
          if (IsMade(image)) batch.push_back(*std::move(image));
          return batch.size() < kBatch || finish();
        });
    if (!read.ok()) return read;
    if (status.ok()) finish();
    return status.ok() ? writer.Commit() : status;
  }

 private:
  bool IsMade(const absl::StatusOr<RobotImage>& image) const {
    return image.ok() &&
           (image->excluded || std::ranges::binary_search(with_raw_images_, image->number));
  }

  absl::Status MakeBatch(const std::vector<MaskSize>& sizes, std::vector<RobotImage>& batch,
                         RobotImageWriter& writer) {
    std::vector<std::vector<Mask>> masks(batch.size());
    std::vector<absl::Status> made(batch.size());
    ParallelWhile(batch.size(), [&](size_t i) {
      if (!batch[i].excluded) made[i] = MakeMasks(batch[i].number, sizes, masks[i]);
      return made[i].ok();
    });
    absl::Status status;
    for (const absl::Status& each : made) status.Update(each);
    for (size_t i = 0; i < batch.size() && status.ok(); ++i) {
      if (!batch[i].excluded) {
        for (size_t v = 0; v < masks[i].size(); ++v) {
          Count(batch[i].masks[v], masks[i][v], result_.views[v]);
        }
        batch[i].masks = std::move(masks[i]);
      }
      status = writer.Put(batch[i], /*replace=*/true);
    }
    return status;
  }

  absl::Status MakeMasks(ConfigurationNumber number, const std::vector<MaskSize>& sizes,
                         std::vector<Mask>& masks) try {
    ASSIGN_OR_RETURN(const auto snapshot, database_.Read());
    for (int v = 0; v < database_.cell().views_size(); ++v) {
      ASSIGN_OR_RETURN(const auto raw, snapshot.FindRawImage(number, v));
      if (!raw.has_value()) return Unreadable(number, v);
      ASSIGN_OR_RETURN(const auto references,
                       references_.Get(snapshot, database_.cell(), raw->references));
      const Reference& reference = (*references)[static_cast<size_t>(v)];
      const MaskSize size = sizes[static_cast<size_t>(v)];
      Mask mask(size);
      for (const cv::Mat& picture : ImagesInPng(raw->png)) {
        if (picture.size() != reference.size()) return Unreadable(number, v);
        mask = mask | RobotMask(picture, reference, options_.segmentation, size);
      }
      masks.push_back(std::move(mask));
    }
    return absl::OkStatus();
  } catch (const std::invalid_argument& error) {
    return absl::InvalidArgumentError(error.what());
  }

  absl::Status Unreadable(ConfigurationNumber number, int view) const {
    return absl::DataLossError(absl::StrCat("the raw image of configuration ", number,
                                            " in the view '", database_.cell().views(view).name(),
                                            "' cannot be read; recapture it"));
  }

  const Database& database_;
  const RemaskOptions& options_;
  std::vector<ConfigurationNumber> with_raw_images_;
  KeptReferences references_;
  RemaskedVariant result_;
};

absl::Status CheckLeftOut(const RemaskedVariant& variant) {
  if (variant.left_out == 0) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat(variant.left_out, " of ",
                   variant.left_out + variant.configurations + variant.excluded, " robot images",
                   variant.name == schema::kDefaultVariant
                       ? ""
                       : absl::StrCat(" of the variant '", variant.name, "'"),
                   " have no raw images that can be read: their masks cannot be rebuilt"));
}

}  // namespace

absl::StatusOr<std::vector<RemaskedVariant>> Remask(const Database& database,
                                                    const RemaskOptions& options,
                                                    const std::string& program, Database& into) {
  ASSIGN_OR_RETURN(const auto names, database.Variants());
  std::vector<std::unique_ptr<Database>> variants;
  std::vector<std::unique_ptr<VariantRemask>> works;
  uint64_t total = 0;
  for (const std::string& name : names) {
    ASSIGN_OR_RETURN(auto variant, database.OpenVariant(name));
    variants.push_back(std::move(variant));
    works.push_back(std::make_unique<VariantRemask>(*variants.back(), options));
    RETURN_IF_ERROR(works.back()->CountRecords());
    const absl::Status complete = CheckLeftOut(works.back()->result());
    if (!complete.ok() && !options.leave_out) return complete;
    total += works.back()->records();
  }
  uint64_t done = 0;
  const auto tell = [&](uint64_t more) {
    done += more;
    return !options.progress || options.progress(done, total);
  };
  std::vector<RemaskedVariant> results;
  for (const auto& work : works) {
    auto place = into.OpenVariant(work->result().name);
    if (absl::IsNotFound(place.status())) place = into.CreateVariant(work->result().name, program);
    if (!place.ok()) return place.status();
    RETURN_IF_ERROR(work->CopyHistory(**place));
    RETURN_IF_ERROR(work->Write(**place, program, tell));
    results.push_back(work->result());
  }
  return results;
}

}  // namespace silhouette
