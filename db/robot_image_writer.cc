#include <map>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "db/database_state.h"
#include "db/robot_image_format.h"
#include "db/schema.h"

namespace silhouette {
namespace {

constexpr size_t kBatchBytes = size_t{32} << 20;

absl::Status CheckFits(const DatabaseState& state, const RobotImage& image) {
  const std::string name = absl::StrCat("robot image ", image.number);
  if (!state.grid.Contains(image.number)) {
    return absl::InvalidArgumentError(name + ": the grid has no configuration of this number");
  }
  const size_t views = image.excluded ? 0 : state.mask_sizes.size();
  if (image.masks.size() != views) {
    return absl::InvalidArgumentError(
        absl::StrCat(name, ": it has ", image.masks.size(), " masks and should have ", views));
  }
  for (size_t i = 0; i < views; ++i) {
    const MaskSize expected = state.mask_sizes[i];
    const MaskSize actual = image.masks[i].size();
    if (actual != expected) {
      return absl::InvalidArgumentError(absl::StrCat(
          name, ": view '", state.cell.views(static_cast<int>(i)).name(), "' has masks of ",
          expected.width, "x", expected.height, ", not ", actual.width, "x", actual.height));
    }
  }
  const size_t joints =
      static_cast<size_t>(state.grid.dimensions() + state.cell.fixed_joints_size());
  for (const auto* values : {&image.commanded, &image.measured}) {
    if (!values->empty() && values->size() != joints) {
      return absl::InvalidArgumentError(absl::StrCat(
          name, ": it has ", values->size(), " joint values, the cell has ", joints, " joints"));
    }
  }
  return absl::OkStatus();
}

}  // namespace

struct RobotImageWriter::Impl {
  Impl(std::shared_ptr<DatabaseState> database, std::string program_name, absl::Duration delay,
       ReadTransaction idle_lookup)
      : state(std::move(database)),
        program(std::move(program_name)),
        max_delay(delay),
        lookup(std::move(idle_lookup)) {}
  ~Impl() { state->has_writer = false; }

  const std::shared_ptr<DatabaseState> state;
  const std::string program;
  const absl::Duration max_delay;
  // Looks up what is stored; holds no state between uses.
  ReadTransaction lookup;

  // The values to be written.
  std::map<ConfigurationNumber, std::string> batch;
  size_t batch_bytes = 0;
  const absl::Time started = absl::Now();
  absl::Time last_commit = started;
  uint64_t committed = 0;
  // This session's place in the provenance log, once it has one.
  std::optional<int> provenance_entry;

  absl::StatusOr<bool> IsStored(ConfigurationNumber number);
  absl::Status WriteBatch(WriteTransaction& transaction) const;
  absl::StatusOr<int> WriteProvenance(WriteTransaction& transaction) const;
};

absl::StatusOr<bool> RobotImageWriter::Impl::IsStored(ConfigurationNumber number) {
  Environment& environment = *state->environment;
  if (absl::Status status = lookup.Renew(); !status.ok()) return status;
  const absl::Cleanup reset = [this] { lookup.Reset(); };
  const auto hold = environment.HoldMap();
  const schema::NumberKey key = schema::EncodeKey(number);
  MDB_val key_val = ToVal({key.data(), key.size()});
  MDB_val value;
  const int code = mdb_get(lookup.get(), environment.robot_images(), &key_val, &value);
  if (code != 0 && code != MDB_NOTFOUND) return environment.ReadError(code);
  return code == 0;
}

absl::Status RobotImageWriter::Impl::WriteBatch(WriteTransaction& transaction) const {
  const Environment& environment = *state->environment;
  // What comes after all that is stored fills its pages; what is put between splits them in halves.
  MDB_cursor* cursor = nullptr;
  int code = mdb_cursor_open(transaction.get(), environment.robot_images(), &cursor);
  if (code != 0) return environment.WriteError(code);
  MDB_val key_val;
  MDB_val value;
  code = mdb_cursor_get(cursor, &key_val, &value, MDB_LAST);
  std::optional<ConfigurationNumber> last;
  if (code == 0) last = schema::DecodeKey(FromVal(key_val));
  mdb_cursor_close(cursor);
  if (code != 0 && code != MDB_NOTFOUND) return environment.WriteError(code);

  for (const auto& [number, image] : batch) {
    const schema::NumberKey key = schema::EncodeKey(number);
    const unsigned flags = !last || number > *last ? MDB_APPEND : 0;
    absl::Status status =
        transaction.Put(environment.robot_images(), {key.data(), key.size()}, image, flags);
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

// Returns the place of this session's entry.
absl::StatusOr<int> RobotImageWriter::Impl::WriteProvenance(WriteTransaction& transaction) const {
  const Environment& environment = *state->environment;
  absl::StatusOr<storage::v1::ProvenanceLog> log = ReadProvenance(environment, transaction.get());
  if (!log.ok()) return log.status();
  const int place = provenance_entry.value_or(log->entries_size());
  if (place == log->entries_size()) log->add_entries();
  *log->mutable_entries(place) = NewProvenance(started, program, committed + batch.size());
  absl::Status status =
      WriteMeta(environment, transaction, schema::kProvenanceKey, log->SerializeAsString());
  if (!status.ok()) return status;
  return place;
}

RobotImageWriter::RobotImageWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
RobotImageWriter::~RobotImageWriter() = default;
RobotImageWriter::RobotImageWriter(RobotImageWriter&&) noexcept = default;
RobotImageWriter& RobotImageWriter::operator=(RobotImageWriter&&) noexcept = default;

absl::StatusOr<RobotImageWriter> Database::Write(const std::string& program,
                                                 absl::Duration max_delay) {
  if (!state_->writer_lock) {
    return absl::FailedPreconditionError(
        absl::StrCat("database '", path(), "' is open for reading only"));
  }
  absl::StatusOr<ReadTransaction> lookup = state_->environment->Read();
  if (!lookup.ok()) return lookup.status();
  lookup->Reset();
  if (state_->has_writer.exchange(true)) {
    return absl::FailedPreconditionError(
        absl::StrCat("database '", path(), "' has a writer already"));
  }
  return RobotImageWriter(
      std::make_unique<RobotImageWriter::Impl>(state_, program, max_delay, *std::move(lookup)));
}

absl::Status RobotImageWriter::Put(const RobotImage& image, bool replace) {
  if (absl::Status status = CheckFits(*impl_->state, image); !status.ok()) return status;
  const auto waiting = impl_->batch.find(image.number);
  if (!replace) {
    absl::StatusOr<bool> stored = impl_->IsStored(image.number);
    if (!stored.ok()) return stored.status();
    if (*stored || waiting != impl_->batch.end()) {
      return absl::AlreadyExistsError(
          absl::StrCat("configuration ", image.number, " has a robot image already"));
    }
  }
  if (waiting != impl_->batch.end()) impl_->batch_bytes -= waiting->second.size();
  std::string& value = impl_->batch[image.number];
  value = EncodeRobotImage(image);
  impl_->batch_bytes += value.size();
  const bool due = absl::Now() - impl_->last_commit >= impl_->max_delay;
  return due || impl_->batch_bytes >= kBatchBytes ? Commit() : absl::OkStatus();
}

absl::Status RobotImageWriter::Commit() {
  Environment& environment = *impl_->state->environment;
  if (!impl_->batch.empty()) {
    int provenance_entry = 0;
    absl::Status status =
        environment.Update(impl_->batch_bytes, [&](WriteTransaction& transaction) -> absl::Status {
          if (absl::Status written = impl_->WriteBatch(transaction); !written.ok()) return written;
          const absl::StatusOr<int> place = impl_->WriteProvenance(transaction);
          if (!place.ok()) return place.status();
          provenance_entry = *place;
          return RaiseGeneration(environment, transaction);
        });
    if (!status.ok()) return status;
    impl_->provenance_entry = provenance_entry;
    impl_->committed += impl_->batch.size();
    impl_->batch.clear();
    impl_->batch_bytes = 0;
  }
  impl_->last_commit = absl::Now();
  return absl::OkStatus();
}

uint64_t RobotImageWriter::committed() const { return impl_->committed; }

}  // namespace silhouette
