// SPDX-License-Identifier: Apache-2.0
#include "db/store/database_state.h"

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "db/store/read_at.h"
#include "db/store/schema.h"

namespace silhouette {
namespace {

constexpr MDB_dbi kSubDatabases = 1;  // LMDB's list of them

// Whether an entry of that list, an MDB_db, is of a sub-database without entries.
bool IsEmptySubDatabase(std::string_view value) {
  return value.size() == 48 && Load<uint64_t>(value.data() + 32) == 0;
}

}  // namespace

absl::Status CheckWritable(const DatabaseState& state) {
  if (state.writer_lock) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("database '", state.path, "' is open for reading only"));
}

absl::StatusOr<WriterTurn> WriterTurn::Take(const DatabaseState& state) {
  RETURN_IF_ERROR(CheckWritable(state));
  if (state.has_writer->exchange(true)) {
    return absl::FailedPreconditionError(
        absl::StrCat("database '", state.path, "' has a writer already"));
  }
  return WriterTurn(state.has_writer);
}

absl::Status DamagedMeta(const Environment& environment, std::string_view key) {
  return absl::DataLossError(absl::StrCat("database '", environment.folder(), "': its entry '",
                                          std::string(key), "' is damaged"));
}

absl::StatusOr<std::optional<std::string>> ReadMeta(const Environment& environment,
                                                    MDB_txn* transaction, std::string_view key) {
  ASSIGN_OR_RETURN(const auto value, environment.Get(transaction, environment.meta(), key));
  if (!value) return std::optional<std::string>();
  const std::optional<std::string_view> payload = schema::OpenMeta(*value);
  if (!payload) return DamagedMeta(environment, key);
  return std::optional<std::string>(*payload);
}

absl::Status WriteMeta(const Environment& environment, WriteTransaction& transaction,
                       std::string_view key, std::string_view payload) {
  return transaction.Put(environment.meta(), key, schema::SealMeta(payload));
}

absl::StatusOr<uint64_t> ReadGeneration(const Environment& environment, MDB_txn* transaction) {
  ASSIGN_OR_RETURN(const auto payload, ReadMeta(environment, transaction, schema::kGenerationKey));
  const std::optional<uint64_t> generation =
      payload ? schema::DecodeGeneration(*payload) : std::nullopt;
  if (!generation) return DamagedMeta(environment, schema::kGenerationKey);
  return *generation;
}

absl::Status RaiseGeneration(const Environment& environment, WriteTransaction& transaction) {
  ASSIGN_OR_RETURN(const uint64_t generation, ReadGeneration(environment, transaction.get()));
  return WriteMeta(environment, transaction, schema::kGenerationKey,
                   schema::EncodeGeneration(generation + 1));
}

absl::StatusOr<storage::v1::ProvenanceLog> ReadProvenance(const Environment& environment,
                                                          MDB_txn* transaction) {
  ASSIGN_OR_RETURN(auto log, ReadMetaMessage<storage::v1::ProvenanceLog>(environment, transaction,
                                                                         schema::kProvenanceKey));
  return std::move(log).value_or(storage::v1::ProvenanceLog());
}

absl::StatusOr<std::vector<std::string>> ReadVariants(const Environment& environment,
                                                      MDB_txn* transaction) {
  ASSIGN_OR_RETURN(const auto variants, ReadMetaMessage<storage::v1::RobotImageVariants>(
                                            environment, transaction, schema::kVariantsKey));
  std::vector<std::string> names = {schema::kDefaultVariant};
  if (variants) names.insert(names.end(), variants->names().begin(), variants->names().end());
  return names;
}

absl::Status CheckNames(const Environment& environment, MDB_txn* transaction) {
  ASSIGN_OR_RETURN(const std::vector<std::string> variants, ReadVariants(environment, transaction));
  const schema::Names keys = schema::KeysOfMeta(variants);
  const schema::Names sub_databases = schema::SubDatabases(variants);
  std::string fault;
  const auto check = [&](bool known, const char* what, std::string_view name) {
    if (!known && fault.empty()) {
      fault = absl::StrCat(what, " '", absl::CHexEscape({name.data(), name.size()}), "'");
    }
    return known;
  };
  RETURN_IF_ERROR(environment.ForEachEntry(transaction, environment.meta(), "",
                                           [&](std::string_view key, std::string_view) {
                                             return check(keys.contains(key), "an entry", key);
                                           }));
  RETURN_IF_ERROR(environment.ForEachEntry(
      transaction, kSubDatabases, "", [&](std::string_view name, std::string_view value) {
        return check(sub_databases.contains(name) || IsEmptySubDatabase(value), "a sub-database",
                     name);
      }));
  if (fault.empty()) return absl::OkStatus();
  return absl::DataLossError(absl::StrCat("database '", environment.folder(),
                                          "' is damaged: it has ", fault,
                                          ", which no program writes; restore it from a copy"));
}

absl::StatusOr<std::vector<MDB_dbi>> OtherVariants(Environment& environment) {
  std::vector<std::string> names;
  {
    ASSIGN_OR_RETURN(const ReadTransaction transaction, environment.Read());
    const auto hold = environment.HoldMap();
    ASSIGN_OR_RETURN(std::vector<std::string> read, ReadVariants(environment, transaction.get()));
    names.assign(read.begin() + 1, read.end());
  }
  std::vector<MDB_dbi> found;
  for (const std::string& name : names) {
    ASSIGN_OR_RETURN(const auto images,
                     environment.Find(schema::PlacesOfVariant(name).robot_images));
    if (images) found.push_back(*images);
  }
  return found;
}

absl::Status WriteChange(const DatabaseState& state, size_t new_bytes,
                         const storage::v1::Provenance& entry, const Environment::Change& write) {
  Environment& environment = *state.environment;
  return environment.Update(new_bytes, [&](WriteTransaction& transaction) -> absl::Status {
    RETURN_IF_ERROR(write(transaction));
    if (!entry.program().empty()) {
      ASSIGN_OR_RETURN(storage::v1::ProvenanceLog log,
                       ReadProvenance(environment, transaction.get()));
      *log.add_entries() = entry;
      RETURN_IF_ERROR(
          WriteMeta(environment, transaction, schema::kProvenanceKey, log.SerializeAsString()));
    }
    return RaiseGeneration(environment, transaction);
  });
}

storage::v1::Provenance NewProvenance(absl::Time time, const std::string& program,
                                      uint64_t robot_images) {
  storage::v1::Provenance entry;
  const int64_t nanoseconds = absl::ToUnixNanos(time);
  entry.mutable_time()->set_seconds(nanoseconds / 1'000'000'000);
  entry.mutable_time()->set_nanos(static_cast<int32_t>(nanoseconds % 1'000'000'000));
  entry.set_program(program);
  entry.set_robot_images(robot_images);
  return entry;
}

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

}  // namespace silhouette
