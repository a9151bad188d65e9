// Raw images and capture history as a snapshot has them, and making masks anew from the former.
#include <map>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "db/database_state.h"
#include "db/raw_image_format.h"
#include "db/robot_image_format.h"
#include "db/schema.h"
#include "db/snapshot_impl.h"

namespace silhouette {
namespace {

std::string_view ViewOf(const RawImageKey& key) { return {key.data(), key.size()}; }

// Every configuration that has records with masks is in `values`, and no other.
absl::Status CheckComplete(const Environment& environment, const WriteTransaction& transaction,
                           const std::map<ConfigurationNumber, std::string>& values,
                           const std::vector<MaskSize>& mask_sizes) {
  MDB_cursor* cursor = nullptr;
  int code = mdb_cursor_open(transaction.get(), environment.robot_images(), &cursor);
  if (code != 0) return environment.WriteError(code);
  size_t found = 0;
  absl::Status status;
  MDB_val key;
  MDB_val value;
  for (code = mdb_cursor_get(cursor, &key, &value, MDB_FIRST); code == 0 && status.ok();
       code = mdb_cursor_get(cursor, &key, &value, MDB_NEXT)) {
    const auto number = schema::DecodeKey(FromVal(key));
    if (!number) continue;
    if (values.contains(*number)) {
      ++found;
      continue;
    }
    const auto image = DecodeRobotImage(*number, FromVal(value), mask_sizes);
    if (!image.ok() || !image->excluded) {
      status =
          absl::InvalidArgumentError(absl::StrCat("configuration ", *number, " has no new masks"));
    }
  }
  mdb_cursor_close(cursor);
  if (!status.ok()) return status;
  if (code != MDB_NOTFOUND) return environment.ReadError(code);
  return found == values.size()
             ? absl::OkStatus()
             : absl::InvalidArgumentError("there are new masks for what has no robot image");
}

}  // namespace

absl::StatusOr<std::optional<RawImage>> Snapshot::FindRawImage(ConfigurationNumber number,
                                                               int view) const {
  Environment& environment = impl_->environment();
  const auto raw_images = environment.Find(impl_->state->places.raw_images);
  if (!raw_images) return std::optional<RawImage>();
  const auto hold = environment.HoldMap();
  const auto place = static_cast<uint64_t>(view);
  const RawImageKey key = EncodeRawImageKey(number, place);
  MDB_val key_val = ToVal(ViewOf(key));
  MDB_val value;
  const int code = mdb_get(impl_->transaction(), *raw_images, &key_val, &value);
  // EINVAL: the snapshot is of before there were any.
  if (code == MDB_NOTFOUND || code == EINVAL) return std::optional<RawImage>();
  if (code != 0) return environment.ReadError(code);
  absl::StatusOr<RawImage> image = DecodeRawImage(number, place, FromVal(value));
  if (!image.ok()) return image.status();
  return std::optional<RawImage>(*std::move(image));
}

absl::StatusOr<std::vector<ConfigurationNumber>> Snapshot::RawImageNumbers() const {
  Environment& environment = impl_->environment();
  std::vector<ConfigurationNumber> numbers;
  const auto raw_images = environment.Find(impl_->state->places.raw_images);
  if (!raw_images) return numbers;
  const auto hold = environment.HoldMap();
  MDB_cursor* cursor = nullptr;
  int code = mdb_cursor_open(impl_->transaction(), *raw_images, &cursor);
  if (code == EINVAL) return numbers;
  if (code != 0) return environment.ReadError(code);
  MDB_val key;
  MDB_val value;
  code = mdb_cursor_get(cursor, &key, &value, MDB_FIRST);
  while (code == 0) {
    const auto number = NumberInRawImageKey(FromVal(key));
    if (!number) break;  // reference images come last
    numbers.push_back(*number);
    const RawImageKey next = EncodeRawImageKey(*number + 1, 0);
    key = ToVal(ViewOf(next));
    code = mdb_cursor_get(cursor, &key, &value, MDB_SET_RANGE);
  }
  mdb_cursor_close(cursor);
  if (code != 0 && code != MDB_NOTFOUND) return environment.ReadError(code);
  return numbers;
}

absl::StatusOr<storage::v1::References> Snapshot::ReferencesOf(uint64_t id) const {
  Environment& environment = impl_->environment();
  const auto raw_images = environment.Find(impl_->state->places.raw_images);
  const RawImageKey key = EncodeReferencesKey(id);
  MDB_val key_val = ToVal(ViewOf(key));
  MDB_val value;
  const auto hold = environment.HoldMap();
  if (!raw_images || mdb_get(impl_->transaction(), *raw_images, &key_val, &value) != 0) {
    return absl::NotFoundError(
        absl::StrCat("database '", impl_->state->path,
                     "' does not have the reference images that its raw images were taken with"));
  }
  const auto payload = schema::OpenMeta(FromVal(value));
  storage::v1::References references;
  if (!payload || IdOfReferences(*payload) != id ||
      !references.ParseFromArray(payload->data(), static_cast<int>(payload->size()))) {
    return absl::DataLossError(absl::StrCat("database '", impl_->state->path,
                                            "': reference images of raw images are damaged"));
  }
  return references;
}

absl::StatusOr<storage::v1::CaptureHistory> Snapshot::CaptureHistory() const {
  const auto hold = impl_->environment().HoldMap();
  const auto payload =
      ReadMeta(impl_->environment(), impl_->transaction(), impl_->state->places.capture_key);
  if (!payload.ok()) return payload.status();
  storage::v1::CaptureHistory history;
  if (*payload && !history.ParseFromString(**payload)) {
    return absl::DataLossError(
        absl::StrCat("database '", impl_->state->path, "': its capture history is damaged"));
  }
  return history;
}

absl::Status Database::ReplaceMasks(const std::string& segmentation,
                                    const std::vector<RobotImage>& images,
                                    const std::string& program) {
  if (!state_->writer_lock) {
    return absl::FailedPreconditionError(
        absl::StrCat("database '", path(), "' is open for reading only"));
  }
  std::map<ConfigurationNumber, std::string> values;
  size_t bytes = 0;
  for (const RobotImage& image : images) {
    if (absl::Status status = CheckFits(*state_, image); !status.ok()) return status;
    std::string& value = values[image.number];
    value = EncodeRobotImage(image);
    bytes += value.size();
  }
  const absl::StatusOr<std::vector<std::string>> sets = Sets();
  if (!sets.ok()) return sets.status();
  if (sets->size() > 1) {
    return absl::FailedPreconditionError(absl::StrCat(
        "database '", path(), "' has several sets, whose masks must all be made with the same ",
        "settings: make the masks of each anew in a database of its own"));
  }
  storage::v1::CellDescription description = cell();
  description.set_segmentation(segmentation);
  const Environment& environment = *state_->environment;
  const absl::Status status =
      state_->environment->Update(bytes, [&](WriteTransaction& transaction) -> absl::Status {
        absl::Status change = CheckComplete(environment, transaction, values, state_->mask_sizes);
        for (auto value = values.begin(); change.ok() && value != values.end(); ++value) {
          const schema::NumberKey key = schema::EncodeKey(value->first);
          change =
              transaction.Put(environment.robot_images(), {key.data(), key.size()}, value->second);
        }
        if (change.ok()) {
          change = WriteMeta(environment, transaction, schema::kCellKey,
                             description.SerializeAsString());
        }
        if (change.ok()) {
          change = AddProvenance(environment, transaction,
                                 NewProvenance(absl::Now(), program, values.size()));
        }
        return change.ok() ? RaiseGeneration(environment, transaction) : change;
      });
  if (status.ok()) state_->cell = description;
  return status;
}

}  // namespace silhouette
