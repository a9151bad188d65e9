// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <chrono>
#include <map>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "db/status/status_macros.h"
#include "db/store/database_state.h"
#include "db/store/raw_image_format.h"
#include "db/store/robot_image_format.h"
#include "db/store/schema.h"

namespace silhouette {
namespace {

constexpr size_t kBatchBytes = size_t{32} << 20;

// What waits to be written of a configuration.
struct Waiting {
  std::string value;
  absl::Time captured;
  std::vector<std::string> raw_images;  // none, or one per view

  size_t bytes() const {
    size_t bytes = value.size();
    for (const std::string& image : raw_images) bytes += image.size();
    return bytes;
  }
};

// Writes the raw images of a record, or removes those that it has.
absl::Status WriteRawImages(WriteTransaction& transaction, MDB_dbi raw_images, int views,
                            ConfigurationNumber number, const Waiting& waiting,
                            uint64_t references) {
  for (size_t view = 0; view < static_cast<size_t>(views); ++view) {
    const std::string key = EncodeRawImageKey(number, view);
    if (waiting.raw_images.empty()) {
      RETURN_IF_ERROR(transaction.Delete(raw_images, key));
    } else {
      const RawImage image{
          .captured = waiting.captured, .references = references, .png = waiting.raw_images[view]};
      RETURN_IF_ERROR(transaction.Put(raw_images, key, EncodeRawImage(number, view, image)));
    }
  }
  return absl::OkStatus();
}

// Keeps the present reference images beside raw images that were taken with them. Returns their id;
// 0 without any.
absl::StatusOr<uint64_t> KeepReferences(WriteTransaction& transaction, MDB_dbi raw_images) {
  const Environment& environment = transaction.environment();
  ASSIGN_OR_RETURN(const auto payload,
                   ReadMeta(environment, transaction.get(), schema::kReferencesKey));
  if (!payload) return uint64_t{0};
  const uint64_t id = IdOfReferences(*payload);
  const std::string key = EncodeReferencesKey(id);
  ASSIGN_OR_RETURN(const auto kept, environment.Get(transaction.get(), raw_images, key));
  if (kept) return id;
  RETURN_IF_ERROR(transaction.Put(raw_images, key, schema::SealMeta(*payload)));
  return id;
}

// The value under a key; empty if there is none, or it cannot be read.
std::string_view Stored(const WriteTransaction& transaction, MDB_dbi database,
                        std::string_view key) {
  const auto value = transaction.environment().Get(transaction.get(), database, key);
  return value.ok() ? value->value_or("") : "";
}

// Stores the records of other variants that rest on a record of the default variant on their own,
// before that is replaced.
absl::Status KeepDependents(WriteTransaction& transaction, const DatabaseState& state,
                            const std::vector<MDB_dbi>& other_variants,
                            ConfigurationNumber number) {
  const schema::NumberKey key = schema::EncodeKey(number);
  for (const MDB_dbi images : other_variants) {
    const std::string_view value = Stored(transaction, images, key);
    if (!NeedsBase(value)) continue;
    const std::optional<std::string> own =
        OwnValue(number, value, Stored(transaction, state.robot_images, key), state.mask_sizes);
    if (!own) continue;  // it cannot be read as it is
    RETURN_IF_ERROR(transaction.Put(images, key, *own));
  }
  return absl::OkStatus();
}

}  // namespace

struct RobotImageWriter::Impl {
  Impl(std::shared_ptr<DatabaseState> database, WriterTurn writer_turn, std::string program_name,
       absl::Duration delay, ReadTransaction idle_lookup)
      : state(std::move(database)),
        turn(std::move(writer_turn)),
        program(std::move(program_name)),
        max_delay(delay),
        lookup(std::move(idle_lookup)) {}

  const std::shared_ptr<DatabaseState> state;
  const WriterTurn turn;
  const std::string program;
  const absl::Duration max_delay;
  // Looks up what is stored; holds no state between uses.
  ReadTransaction lookup;

  std::map<ConfigurationNumber, Waiting> batch;
  size_t batch_bytes = 0;
  const absl::Time started = absl::Now();
  std::chrono::steady_clock::time_point last_commit = std::chrono::steady_clock::now();
  uint64_t committed = 0;
  // This session's place in the provenance log, once it has one.
  std::optional<int> provenance_entry;

  absl::StatusOr<bool> IsStored(ConfigurationNumber number);
  absl::Status Add(const RobotImage& image, bool replace, std::vector<std::string> raw_images);
  bool has_raw_images() const;
  // `dependents`: the robot images of other variants, if this is the default one; `raw_images`: the
  // sub-database, if there is one.
  absl::Status WriteBatch(WriteTransaction& transaction, const std::vector<MDB_dbi>& dependents,
                          std::optional<MDB_dbi> raw_images) const;
  absl::Status WriteAllRawImages(WriteTransaction& transaction, MDB_dbi raw_images) const;
  absl::StatusOr<int> WriteProvenance(WriteTransaction& transaction) const;
};

absl::StatusOr<bool> RobotImageWriter::Impl::IsStored(ConfigurationNumber number) {
  Environment& environment = *state->environment;
  RETURN_IF_ERROR(lookup.Renew());
  const absl::Cleanup reset = [this] { lookup.Reset(); };
  const auto hold = environment.HoldMap();
  ASSIGN_OR_RETURN(const auto stored,
                   environment.Get(lookup.get(), state->robot_images, schema::EncodeKey(number)));
  return stored.has_value();
}

absl::Status RobotImageWriter::Impl::WriteBatch(WriteTransaction& transaction,
                                                const std::vector<MDB_dbi>& dependents,
                                                std::optional<MDB_dbi> raw_images) const {
  const Environment& environment = *state->environment;
  // What comes after all that is stored fills its pages; what is put between splits them in halves.
  MDB_cursor* cursor = nullptr;
  int code = mdb_cursor_open(transaction.get(), state->robot_images, &cursor);
  if (code != 0) return environment.WriteError(code);
  MDB_val key_val;
  MDB_val last_value;
  code = mdb_cursor_get(cursor, &key_val, &last_value, MDB_LAST);
  std::optional<ConfigurationNumber> last;
  if (code == 0) last = schema::DecodeKey(FromVal(key_val));
  mdb_cursor_close(cursor);
  if (code != 0 && code != MDB_NOTFOUND) return environment.WriteError(code);

  for (const auto& [number, waiting] : batch) {
    const schema::NumberKey key = schema::EncodeKey(number);
    const unsigned flags = !last || number > *last ? MDB_APPEND : 0;
    std::string_view value = waiting.value;
    std::optional<std::string> shared;
    if (state->places.is_default()) {
      RETURN_IF_ERROR(KeepDependents(transaction, *state, dependents, number));
    } else {
      shared = SharedValue(number, value, Stored(transaction, environment.robot_images(), key),
                           state->mask_sizes);
      if (shared) value = *shared;
    }
    RETURN_IF_ERROR(transaction.Put(state->robot_images, key, value, flags));
  }
  return raw_images ? WriteAllRawImages(transaction, *raw_images) : absl::OkStatus();
}

absl::Status RobotImageWriter::Impl::WriteAllRawImages(WriteTransaction& transaction,
                                                       MDB_dbi raw_images) const {
  uint64_t references = 0;
  if (has_raw_images()) {
    ASSIGN_OR_RETURN(references, KeepReferences(transaction, raw_images));
  }
  for (const auto& [number, waiting] : batch) {
    RETURN_IF_ERROR(WriteRawImages(transaction, raw_images, state->cell.views_size(), number,
                                   waiting, references));
  }
  return absl::OkStatus();
}

bool RobotImageWriter::Impl::has_raw_images() const {
  return std::ranges::any_of(batch,
                             [](const auto& entry) { return !entry.second.raw_images.empty(); });
}

// Returns the place of this session's entry.
absl::StatusOr<int> RobotImageWriter::Impl::WriteProvenance(WriteTransaction& transaction) const {
  const Environment& environment = *state->environment;
  ASSIGN_OR_RETURN(storage::v1::ProvenanceLog log, ReadProvenance(environment, transaction.get()));
  const int place = provenance_entry.value_or(log.entries_size());
  if (place == log.entries_size()) log.add_entries();
  *log.mutable_entries(place) = NewProvenance(started, program, committed + batch.size());
  if (!state->places.is_default()) log.mutable_entries(place)->set_variant(state->places.name);
  RETURN_IF_ERROR(
      WriteMeta(environment, transaction, schema::kProvenanceKey, log.SerializeAsString()));
  return place;
}

RobotImageWriter::RobotImageWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
RobotImageWriter::~RobotImageWriter() = default;
RobotImageWriter::RobotImageWriter(RobotImageWriter&&) noexcept = default;
RobotImageWriter& RobotImageWriter::operator=(RobotImageWriter&&) noexcept = default;

absl::StatusOr<RobotImageWriter> Database::Write(const std::string& program,
                                                 absl::Duration max_delay) {
  RETURN_IF_ERROR(CheckWritable(*state_));
  ASSIGN_OR_RETURN(ReadTransaction lookup, state_->environment->Read());
  lookup.Reset();
  ASSIGN_OR_RETURN(WriterTurn turn, WriterTurn::Take(*state_));
  return RobotImageWriter(std::make_unique<RobotImageWriter::Impl>(state_, std::move(turn), program,
                                                                   max_delay, std::move(lookup)));
}

absl::Status RobotImageWriter::Impl::Add(const RobotImage& image, bool replace,
                                         std::vector<std::string> raw_images) {
  RETURN_IF_ERROR(CheckFits(*state, image));
  if (!raw_images.empty() && raw_images.size() != image.masks.size()) {
    return absl::InvalidArgumentError(absl::StrCat("robot image ", image.number, ": it has ",
                                                   raw_images.size(), " raw images for ",
                                                   image.masks.size(), " masks"));
  }
  const auto present = batch.find(image.number);
  if (!replace) {
    ASSIGN_OR_RETURN(bool stored, IsStored(image.number));
    if (stored || present != batch.end()) {
      return absl::AlreadyExistsError(
          absl::StrCat("configuration ", image.number, " has a robot image already"));
    }
  }
  if (present != batch.end()) batch_bytes -= present->second.bytes();
  Waiting& waiting = batch[image.number];
  waiting = {EncodeRobotImage(image), image.captured, std::move(raw_images)};
  batch_bytes += waiting.bytes();
  return absl::OkStatus();
}

absl::Status RobotImageWriter::Put(const RobotImage& image, bool replace,
                                   std::vector<std::string> raw_images) {
  RETURN_IF_ERROR(impl_->Add(image, replace, std::move(raw_images)));
  const bool due = std::chrono::steady_clock::now() - impl_->last_commit >=
                   absl::ToChronoNanoseconds(impl_->max_delay);
  return due || impl_->batch_bytes >= kBatchBytes ? Commit() : absl::OkStatus();
}

absl::Status RobotImageWriter::Commit() {
  Environment& environment = *impl_->state->environment;
  if (!impl_->batch.empty()) {
    // Before the transaction, which could not open it.
    ASSIGN_OR_RETURN(std::optional<MDB_dbi> raw_images,
                     environment.Find(impl_->state->places.raw_images));
    if (!raw_images && impl_->has_raw_images()) {
      ASSIGN_OR_RETURN(raw_images, environment.Make(impl_->state->places.raw_images));
    }
    std::vector<MDB_dbi> dependents;
    if (impl_->state->places.is_default()) {
      ASSIGN_OR_RETURN(dependents, OtherVariants(environment));
    }
    int provenance_entry = 0;
    const auto write = [&](WriteTransaction& transaction) -> absl::Status {
      RETURN_IF_ERROR(impl_->WriteBatch(transaction, dependents, raw_images));
      ASSIGN_OR_RETURN(provenance_entry, impl_->WriteProvenance(transaction));
      return absl::OkStatus();
    };
    RETURN_IF_ERROR(WriteChange(*impl_->state, impl_->batch_bytes, {}, write));
    impl_->provenance_entry = provenance_entry;
    impl_->committed += impl_->batch.size();
    impl_->batch.clear();
    impl_->batch_bytes = 0;
  }
  impl_->last_commit = std::chrono::steady_clock::now();
  return absl::OkStatus();
}

uint64_t RobotImageWriter::committed() const { return impl_->committed; }

}  // namespace silhouette
