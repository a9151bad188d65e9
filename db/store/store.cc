// SPDX-License-Identifier: Apache-2.0
#include "db/store/store.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <functional>
#include <set>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "db/status/status_macros.h"
#include "db/store/database_state.h"
#include "db/store/schema.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
using storage::v1::CellDescription;

// What GridOf and MaskSizesOf do not check.
absl::Status CheckNames(const CellDescription& cell) {
  if (cell.views().empty()) return absl::InvalidArgumentError("a cell has at least one view");
  std::set<std::string> views;
  for (const storage::v1::View& view : cell.views()) {
    if (view.name().empty()) return absl::InvalidArgumentError("a view has no name");
    if (!views.insert(view.name()).second) {
      return absl::InvalidArgumentError(absl::StrCat("view '", view.name(), "' is named twice"));
    }
  }
  std::set<std::string> joints;
  for (const storage::v1::GridJoint& joint : cell.grid_joints()) joints.insert(joint.name());
  for (const storage::v1::FixedJoint& joint : cell.fixed_joints()) {
    if (!joints.insert(joint.name()).second) {
      return absl::InvalidArgumentError(absl::StrCat("joint '", joint.name(), "' is named twice"));
    }
  }
  if (joints.size() > 255) return absl::InvalidArgumentError("a robot has at most 255 joints");
  return absl::OkStatus();
}

// A state of which only path, cell, grid and mask sizes are set.
absl::StatusOr<std::shared_ptr<DatabaseState>> Describe(const std::string& path,
                                                        const CellDescription& cell) {
  RETURN_IF_ERROR(CheckNames(cell));
  ASSIGN_OR_RETURN(ConfigurationGrid grid, GridOf(cell));
  ASSIGN_OR_RETURN(std::vector<MaskSize> mask_sizes, MaskSizesOf(cell));
  auto state = std::make_shared<DatabaseState>(path, cell, std::move(grid), std::move(mask_sizes));
  state->cell.mutable_tile_edges()->Assign(state->grid.tile_edges().begin(),
                                           state->grid.tile_edges().end());
  return state;
}

// Makes the folder `path`, or sees that nothing is in it but what an interrupted Create() left.
absl::Status PrepareFolder(const std::string& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (error) {
    return absl::FailedPreconditionError(
        absl::StrCat("folder '", path, "' cannot be made: ", error.message()));
  }
  const std::set<std::string> ours = {schema::kDataFile, schema::kLockFile, schema::kWriterFile,
                                      schema::kUnfinishedFolder};
  for (fs::directory_iterator entry(path, error); !error && entry != fs::directory_iterator();
       entry.increment(error)) {
    if (!ours.contains(entry->path().filename().string())) {
      return absl::FailedPreconditionError(absl::StrCat(
          "folder '", path, "' is not empty; a new database needs an empty or a new folder"));
    }
  }
  if (error) {
    return absl::FailedPreconditionError(
        absl::StrCat("folder '", path, "' cannot be read: ", error.message()));
  }
  return absl::OkStatus();
}

void RemoveFiles(const std::string& path) {
  std::error_code ignored;
  fs::remove(fs::path(path) / schema::kDataFile, ignored);
  fs::remove(fs::path(path) / schema::kLockFile, ignored);
}

// Sees that a file's content is on the disk; 0 or the errno.
int Sync(const std::string& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return errno;
  const int code = fsync(file) == 0 ? 0 : errno;
  close(file);
  return code;
}

// Puts a data file that `make` makes, in the folder that it gets, into `path`. Whenever the program
// or the computer stops meanwhile, there is the whole file or none.
absl::Status PlaceDataFile(const std::string& path,
                           const std::function<absl::Status(const std::string& folder)>& make) {
  const fs::path beside = fs::path(path) / schema::kUnfinishedFolder;
  std::error_code error;
  fs::remove_all(beside, error);
  if (!error) fs::create_directory(beside, error);
  if (error) {
    return LmdbError(error.value(), absl::StrCat("folder '", beside.string(), "' cannot be made"));
  }
  absl::Status status = make(beside);
  if (status.ok()) {
    int code = Sync(beside / schema::kDataFile);
    if (code == 0) {
      fs::rename(beside / schema::kDataFile, fs::path(path) / schema::kDataFile, error);
      code = error ? error.value() : Sync(path);
    }
    if (code != 0) status = LmdbError(code, absl::StrCat("'", path, "' cannot be written"));
  }
  fs::remove_all(beside, error);
  return status;
}

absl::Status Fill(const Environment& environment, WriteTransaction& transaction,
                  const std::string& cell) {
  RETURN_IF_ERROR(transaction.Put(environment.meta(), schema::kFormatKey, schema::FormatValue()));
  RETURN_IF_ERROR(WriteMeta(environment, transaction, schema::kCellKey, cell));
  return WriteMeta(environment, transaction, schema::kGenerationKey, schema::EncodeGeneration(1));
}

}  // namespace

Database::Database(std::shared_ptr<DatabaseState> state) : state_(std::move(state)) {}
Database::~Database() = default;

void RemoveDatabase(const std::string& path) {
  std::error_code ignored;
  for (const char* name : {schema::kDataFile, schema::kLockFile, schema::kWriterFile}) {
    std::filesystem::remove(std::filesystem::path(path) / name, ignored);
  }
  std::filesystem::remove(path, ignored);
}

absl::StatusOr<std::unique_ptr<Database>> Database::Create(const std::string& path,
                                                           const CellDescription& cell) {
  ASSIGN_OR_RETURN(std::shared_ptr<DatabaseState> state, Describe(path, cell));
  state->stored_cell = state->cell.SerializeAsString();
  RETURN_IF_ERROR(PrepareFolder(path));
  ASSIGN_OR_RETURN(WriterLock lock, WriterLock::Take(path));
  const absl::Status existing = Environment::Open(path).status();
  if (existing.ok()) {
    return absl::AlreadyExistsError(absl::StrCat("there is a database in '", path, "' already"));
  }
  if (!absl::IsNotFound(existing)) return existing;
  RemoveFiles(path);
  RETURN_IF_ERROR(PlaceDataFile(path, [&](const std::string& folder) {
    return Environment::Create(folder,
                               [&](WriteTransaction& transaction) {
                                 return Fill(transaction.environment(), transaction,
                                             state->stored_cell);
                               })
        .status();
  }));
  ASSIGN_OR_RETURN(std::shared_ptr<Environment> environment, Environment::Open(path));
  state->writer_lock = std::make_shared<const WriterLock>(std::move(lock));
  state->robot_images = environment->robot_images();
  state->environment = std::move(environment);
  return std::unique_ptr<Database>(new Database(std::move(state)));
}

absl::StatusOr<std::unique_ptr<Database>> Database::Open(const std::string& path, Access access) {
  ASSIGN_OR_RETURN(std::shared_ptr<Environment> environment, Environment::Open(path));
  std::optional<WriterLock> lock;
  if (access == Access::kWrite) {
    if (environment->read_only()) {
      return absl::FailedPreconditionError(
          absl::StrCat("database '", path, "' cannot be written: no permission"));
    }
    ASSIGN_OR_RETURN(WriterLock taken, WriterLock::Take(path));
    lock.emplace(std::move(taken));
  }
  ASSIGN_OR_RETURN(ReadTransaction transaction, environment->Read());
  std::optional<std::string> payload;
  {
    const auto hold = environment->HoldMap();
    RETURN_IF_ERROR(CheckNames(*environment, transaction.get()));
    ASSIGN_OR_RETURN(payload, ReadMeta(*environment, transaction.get(), schema::kCellKey));
  }
  CellDescription cell;
  const bool parsed = payload && cell.ParseFromString(*payload);
  absl::StatusOr<std::shared_ptr<DatabaseState>> state = Describe(path, cell);
  if (!parsed || !state.ok()) {
    return absl::DataLossError(
        absl::StrCat("database '", path, "': its description of the cell is damaged"));
  }
  (*state)->stored_cell = *std::move(payload);
  if (lock) (*state)->writer_lock = std::make_shared<const WriterLock>(*std::move(lock));
  (*state)->robot_images = environment->robot_images();
  (*state)->environment = std::move(environment);
  return std::unique_ptr<Database>(new Database(*std::move(state)));
}

const std::string& Database::path() const { return state_->path; }
const CellDescription& Database::cell() const { return state_->cell; }
const ConfigurationGrid& Database::grid() const { return state_->grid; }
const std::vector<MaskSize>& Database::mask_sizes() const { return state_->mask_sizes; }

absl::Status Database::ChangeMeta(std::string_view key, const std::optional<std::string>& payload,
                                  const std::string& program) {
  RETURN_IF_ERROR(CheckWritable(*state_));
  const Environment& environment = *state_->environment;
  return WriteChange(*state_, payload ? payload->size() : 0, NewProvenance(absl::Now(), program, 0),
                     [&](WriteTransaction& transaction) {
                       return payload ? WriteMeta(environment, transaction, key, *payload)
                                      : transaction.Delete(environment.meta(), key);
                     });
}

absl::Status Database::SetReferences(const storage::v1::References& references,
                                     const std::string& program) {
  if (references.views_size() != cell().views_size()) {
    return absl::InvalidArgumentError(absl::StrCat("there are ", references.views_size(),
                                                   " reference images for ", cell().views_size(),
                                                   " views"));
  }
  return ChangeMeta(schema::kReferencesKey, references.SerializeAsString(), program);
}

absl::Status Database::SetCaptureHistory(const storage::v1::CaptureHistory& history) {
  return ChangeMeta(state_->places.capture_key, history.SerializeAsString(), "");
}

absl::Status Database::SetCalibration(const storage::v1::Calibration& calibration,
                                      const std::string& program) {
  RETURN_IF_ERROR(CheckCalibration(calibration, cell()));
  return ChangeMeta(schema::kCalibrationKey, calibration.SerializeAsString(), program);
}

absl::Status Database::RemoveCalibration(const std::string& program) {
  ASSIGN_OR_RETURN(const Snapshot snapshot, Read());
  const absl::StatusOr<std::optional<storage::v1::Calibration>> present = snapshot.Calibration();
  if (present.ok() && !present->has_value()) {
    return absl::NotFoundError(absl::StrCat("database '", path(), "' has no calibration"));
  }
  return ChangeMeta(schema::kCalibrationKey, std::nullopt, program);
}

absl::Status Database::SetVerification(
    const std::optional<storage::v1::ModelVerification>& verification, const std::string& program) {
  std::optional<std::string> payload;
  if (verification) payload = verification->SerializeAsString();
  return ChangeMeta(schema::kVerificationKey, payload, program);
}

absl::Status Database::Compact(const std::string& target) const {
  const auto require_none = [&] {
    return fs::exists(fs::path(target) / schema::kDataFile)
               ? absl::AlreadyExistsError(
                     absl::StrCat("there is a database in '", target, "' already"))
               : absl::OkStatus();
  };
  RETURN_IF_ERROR(require_none());
  RETURN_IF_ERROR(PrepareFolder(target));
  ASSIGN_OR_RETURN(const WriterLock lock, WriterLock::Take(target));
  RETURN_IF_ERROR(require_none());  // another one may just have placed it
  return PlaceDataFile(target, [&](const std::string& folder) {
    const auto hold = state_->environment->HoldMap();
    const int code = mdb_env_copy2(state_->environment->get(), folder.c_str(), MDB_CP_COMPACT);
    if (code == 0) return absl::OkStatus();
    return LmdbError(code,
                     absl::StrCat("database '", path(), "' cannot be copied to '", target, "'"));
  });
}

absl::StatusOr<Database::Usage> Database::GetUsage() const {
  Environment& environment = *state_->environment;
  constexpr MDB_dbi kFreePages = 0;
  constexpr MDB_dbi kSubDatabases = 1;
  ASSIGN_OR_RETURN(const std::vector<std::string> names, Variants());
  struct Places {
    std::optional<MDB_dbi> images;
    std::optional<MDB_dbi> index;
    std::optional<MDB_dbi> raw_images;
  };
  std::vector<Places> places;
  for (const std::string& name : names) {
    const schema::VariantPlaces of = schema::PlacesOfVariant(name);
    Places& of_variant = places.emplace_back();
    ASSIGN_OR_RETURN(of_variant.images, environment.Find(of.robot_images));
    ASSIGN_OR_RETURN(of_variant.index, environment.Find(of.collision_index));
    ASSIGN_OR_RETURN(of_variant.raw_images, environment.Find(of.raw_images));
  }
  ASSIGN_OR_RETURN(ReadTransaction transaction, environment.Read());
  const auto hold = environment.HoldMap();
  Usage usage;
  absl::Status status;
  // The bytes of a sub-database, and how many entries it has.
  const auto add = [&](std::optional<MDB_dbi> database, uint64_t* entries) {
    MDB_stat stat;
    const int code = database ? mdb_stat(transaction.get(), *database, &stat) : MDB_NOTFOUND;
    if (code == MDB_NOTFOUND || code == EINVAL) return uint64_t{0};  // there is none, or was none
    if (code != 0) status.Update(environment.ReadError(code));
    const uint64_t pages =
        uint64_t{stat.ms_branch_pages} + stat.ms_leaf_pages + stat.ms_overflow_pages;
    if (entries != nullptr) *entries = stat.ms_entries;
    usage.used_bytes += stat.ms_psize * pages;
    return stat.ms_psize * pages;
  };
  for (const MDB_dbi database : {kFreePages, kSubDatabases, environment.meta()}) {
    add(database, nullptr);
  }
  for (size_t i = 0; i < places.size(); ++i) {
    Usage::Variant& variant = usage.variants.emplace_back();
    variant.name = names[i];
    variant.record_bytes = add(places[i].images, &variant.records);
    variant.index_bytes = add(places[i].index, nullptr);
    usage.raw_image_bytes += add(places[i].raw_images, nullptr);
  }
  if (!status.ok()) return status;
  std::error_code error;
  usage.file_bytes = fs::file_size(fs::path(path()) / schema::kDataFile, error);
  if (error) {
    return absl::InternalError(absl::StrCat("'", path(), "' cannot be read: ", error.message()));
  }
  return usage;
}

}  // namespace silhouette
