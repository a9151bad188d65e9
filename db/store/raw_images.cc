// Raw images and capture history as a snapshot has them.
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "db/store/database_state.h"
#include "db/store/raw_image_format.h"
#include "db/store/schema.h"
#include "db/store/snapshot_impl.h"

namespace silhouette {
namespace {

std::string_view ViewOf(const RawImageKey& key) { return {key.data(), key.size()}; }

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
  ASSIGN_OR_RETURN(RawImage image, DecodeRawImage(number, place, FromVal(value)));
  return std::optional<RawImage>(std::move(image));
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
  ASSIGN_OR_RETURN(const auto payload, ReadMeta(impl_->environment(), impl_->transaction(),
                                                impl_->state->places.capture_key));
  storage::v1::CaptureHistory history;
  if (payload && !history.ParseFromString(*payload)) {
    return absl::DataLossError(
        absl::StrCat("database '", impl_->state->path, "': its capture history is damaged"));
  }
  return history;
}

}  // namespace silhouette
