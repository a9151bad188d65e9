// SPDX-License-Identifier: Apache-2.0
// The database of a cell: robot images, what they belong to, reference images, calibration. One
// LMDB environment in a folder; docs/database_format.md has the bytes, db/store/schema.h the keys.
//
// A Database may be used by several threads; a Snapshot and a RobotImageWriter by one at a time.
// Several processes may read while one writes.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "db/mask/configuration_grid.h"
#include "db/mask/mask.h"
#include "silhouette/storage/v1/storage.pb.h"

namespace silhouette {

// What is stored for one configuration.
struct RobotImage {
  ConfigurationNumber number = 0;
  // In a region the robot must never enter: there are no masks, and it is never free.
  bool excluded = false;
  // One per view, in the order of the cell's views.
  std::vector<Mask> masks;
  absl::Time captured = absl::UnixEpoch();
  // The robot's joints, those of the grid first, then the fixed ones, each in the order of the cell
  // description; radians, metres. Empty where it is not known (masks made elsewhere).
  std::vector<double> commanded;
  std::vector<double> measured;

  bool operator==(const RobotImage&) const = default;
};

// The camera images that a mask was made from.
struct RawImage {
  absl::Time captured = absl::UnixEpoch();
  // Which reference images the mask was made with, as Snapshot::ReferencesOf knows them.
  uint64_t references = 0;
  std::string png;  // PNG files, one after another: the mask is the union of what they show

  bool operator==(const RawImage&) const = default;
};

// The grid that a description speaks of; InvalidArgument if it describes none.
absl::StatusOr<ConfigurationGrid> GridOf(const storage::v1::CellDescription& cell);

// The sizes of the masks, one per view; InvalidArgument if one is not valid.
absl::StatusOr<std::vector<MaskSize>> MaskSizesOf(const storage::v1::CellDescription& cell);

// In what two descriptions differ, one sentence each, e.g.
// "joint 'axis_1': steps is 84 in the cell file, 72 in the database". Empty: they fit together.
// `a_name` and `b_name` are what the sentences call them. Segmentation settings and image sizes are
// compared only where both have them.
std::vector<std::string> Differences(const storage::v1::CellDescription& a,
                                     const std::string& a_name,
                                     const storage::v1::CellDescription& b,
                                     const std::string& b_name);

// Whether a calibration fits the views of a cell: either cameras or fundamental matrices; a camera
// per view, for the view's images; views and pairs that are there, none twice; as many numbers as
// the messages say, all finite. InvalidArgument, naming the view, if not. Whether a matrix is of
// rank 2 is not looked at.
absl::Status CheckCalibration(const storage::v1::Calibration& calibration,
                              const storage::v1::CellDescription& cell);

struct DatabaseState;
struct VariantState;
class IndexBuild;
class ReadTransaction;
class ShardMerge;

// One consistent state of the database. Holds a read transaction: keep it no longer than needed
// while a capture writes, for its pages cannot be reused until then. May outlive its Database.
class Snapshot {
 public:
  ~Snapshot();
  Snapshot(Snapshot&&) noexcept;
  Snapshot& operator=(Snapshot&&) noexcept;

  // Grows with every committed change; equal generations hold equal content.
  uint64_t generation() const;

  // Number of records: captured and excluded configurations.
  uint64_t size() const;

  // The record of a configuration; nothing if there is none. DataLoss if it fails its checksum or
  // cannot be decoded.
  absl::StatusOr<std::optional<RobotImage>> Find(ConfigurationNumber number) const;

  // Whether there is a record; does not read it.
  absl::StatusOr<bool> Contains(ConfigurationNumber number) const;

  // Calls `visit` for every record in the order of numbers, until it returns false. A record that
  // Find would refuse is given as its DataLoss status. `visit` may write into the database.
  absl::Status ForEach(
      const std::function<bool(ConfigurationNumber, absl::StatusOr<RobotImage>)>& visit) const;

  // The reference images; nothing if none were taken yet.
  absl::StatusOr<std::optional<storage::v1::References>> References() const;

  // The calibration; nothing if there is none. DataLoss if it fails its checksum or does not fit
  // the cell.
  absl::StatusOr<std::optional<storage::v1::Calibration>> Calibration() const;

  // The raw image of a configuration in a view, by its place in the cell's views; nothing if there
  // is none. DataLoss if it is damaged.
  absl::StatusOr<std::optional<RawImage>> FindRawImage(ConfigurationNumber number, int view) const;

  // The configurations that have raw images, in order.
  absl::StatusOr<std::vector<ConfigurationNumber>> RawImageNumbers() const;

  // The reference images that raw images speak of, whatever was set since. NotFound; DataLoss.
  absl::StatusOr<storage::v1::References> ReferencesOf(uint64_t id) const;

  // What the model was found to need; nothing: it was not compared. DataLoss if it is damaged.
  absl::StatusOr<std::optional<storage::v1::ModelVerification>> Verification() const;

  // What capture sessions noticed about the cell; empty if they did not yet.
  absl::StatusOr<storage::v1::CaptureHistory> CaptureHistory() const;

  // What the variant's robot images were drawn from; nothing if they are captured.
  absl::StatusOr<std::optional<storage::v1::DrawnImages>> DrawnImages() const;

  // Who wrote into the database, oldest first.
  absl::StatusOr<storage::v1::ProvenanceLog> Provenance() const;

 private:
  friend class Database;
  friend class CollisionIndex;
  friend class RecordWalk;
  friend class ShardMerge;
  struct Impl;  // db/store/raw_records.h
  explicit Snapshot(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// Writes robot images in batches. Put() collects. After Commit() has returned OK, the batch is on
// the disk and stays there. Destruction without Commit() drops what was not committed. No record is
// ever half-written. May outlive its Database.
class RobotImageWriter {
 public:
  ~RobotImageWriter();
  RobotImageWriter(RobotImageWriter&&) noexcept;
  RobotImageWriter& operator=(RobotImageWriter&&) noexcept;

  // Adds a record to the batch. InvalidArgument if its number is not in the grid, its masks do not
  // fit the views, or its joint values are neither none nor one per joint of the cell.
  // AlreadyExists if the configuration has a record and `replace` is false. Capture times are kept
  // to the nanosecond.
  // Commits by itself, this record included, when `max_delay` (see Database::Write) has passed
  // since the last commit, or the batch is 32 MiB large. Every other error is that commit's; the
  // record is in the batch then, and Commit() tries again.
  // `raw_images`: RawImage::png, one per view (InvalidArgument if not), which are written with the
  // record, all or none. Empty: those that it has are removed.
  absl::Status Put(const RobotImage& image, bool replace = false,
                   std::vector<std::string> raw_images = {});

  // Writes the batch durably. ResourceExhausted if the disk is full; the batch is kept, so a second
  // call tries again.
  absl::Status Commit();

  // Records that are durably written by this writer.
  uint64_t committed() const;

 private:
  friend class Database;
  struct Impl;
  explicit RobotImageWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// A database has one or several variants of the robot: gripper open, gripper closed, with a part.
// Each has its own robot images, raw images, collision index and capture history; they share the
// rest. A Database object stands for one variant. Open() and Create() give the variant `default`,
// which every database has; OpenVariant() gives the others.
class Database {
 public:
  enum class Access { kRead, kWrite };

  // Makes a new database in the folder `path`, open for writing. Tile edges that the description
  // leaves open are chosen. AlreadyExists if there is one; InvalidArgument if
  // the description is not valid; FailedPrecondition if the folder is not empty or cannot be
  // written.
  static absl::StatusOr<std::unique_ptr<Database>> Create(const std::string& path,
                                                          const storage::v1::CellDescription& cell);

  // Opens an existing one. NotFound: there is none. FailedPrecondition: not a Silhouette database,
  // another format version, no permission, a file of it was replaced while this process has it
  // open, or (kWrite) another process is writing. DataLoss: the file is truncated or damaged. Read
  // access works in a read-only folder. Looks at every page of the trees: about a quarter of a
  // second per million records.
  static absl::StatusOr<std::unique_ptr<Database>> Open(const std::string& path, Access access);

  ~Database();

  const std::string& path() const;
  const storage::v1::CellDescription& cell() const;
  const ConfigurationGrid& grid() const;
  const std::vector<MaskSize>& mask_sizes() const;

  // The name of the variant.
  const std::string& variant() const;

  // The names of all variants, the default one first, then in the order in which they were made.
  absl::StatusOr<std::vector<std::string>> Variants() const;

  // Another variant of this database, with the access that this has. NotFound, naming those that
  // there are.
  absl::StatusOr<std::unique_ptr<Database>> OpenVariant(const std::string& name) const;

  // Makes a variant without robot images. `program` goes into the provenance log. Needs kWrite.
  // InvalidArgument: no variant may have the name (schema::IsVariantName). AlreadyExists.
  // FailedPrecondition: there are as many variants as there may be.
  absl::StatusOr<std::unique_ptr<Database>> CreateVariant(const std::string& name,
                                                          const std::string& program);

  // Removes a variant with all that is its own. Needs kWrite, and no writer. NotFound;
  // InvalidArgument: the default variant.
  absl::Status RemoveVariant(const std::string& name, const std::string& program);

  // The state at this moment.
  absl::StatusOr<Snapshot> Read() const;

  // One state of all variants, in the order of Variants(). The snapshots share one transaction: one
  // thread at a time may use any of them. Unavailable: cell() is of an earlier state, for another
  // Database replaced the masks since; open it again.
  absl::StatusOr<std::vector<VariantState>> ReadVariants() const;

  // A writer of robot images; `program` goes into the provenance log. `max_delay`: how long records
  // are collected; a caller that pauses between two Put() calls does Commit() first. Needs kWrite.
  // FailedPrecondition while there is another writer of this database, of whatever variant.
  // Robot images of another variant are stored by their difference from those of the default
  // variant where that is smaller. Replacing a default image keeps the others valid, in the same
  // transaction.
  absl::StatusOr<RobotImageWriter> Write(const std::string& program,
                                         absl::Duration max_delay = absl::Seconds(1));

  // Replaces the reference images; one per view, else InvalidArgument. Needs kWrite.
  absl::Status SetReferences(const storage::v1::References& references, const std::string& program);

  // Replaces the calibration. Needs kWrite. InvalidArgument as CheckCalibration.
  absl::Status SetCalibration(const storage::v1::Calibration& calibration,
                              const std::string& program);
  // Removes it. Needs kWrite. NotFound if there is none.
  absl::Status RemoveCalibration(const std::string& program);

  // Replaces what the model was found to need; nothing: removes it. Needs kWrite.
  absl::Status SetVerification(const std::optional<storage::v1::ModelVerification>& verification,
                               const std::string& program);

  // Replaces what capture sessions noticed. Leaves no entry in the provenance log. Needs kWrite.
  absl::Status SetCaptureHistory(const storage::v1::CaptureHistory& history);

  // States what the variant's robot images are drawn from. Needs kWrite. FailedPrecondition, with
  // the difference: they are drawn from something else, or captured (db/store/shards.h).
  absl::Status SetDrawnImages(const storage::v1::DrawnImages& drawn, const std::string& program);

  // Replaces the records of all variants by those of another database, and the settings that the
  // cell's description says their masks were made with, in one change. Raw images stay.
  // InvalidArgument, saying why: `made` has not the same grid, views and mask sizes, or not just
  // the variants, the records and the excluded ones among them that there are. Needs kWrite and no
  // writer, and is asked of the default variant while no other thread uses any variant of this
  // database.
  absl::Status ReplaceMasks(const Database& made, const std::string& program);

  // Writes a copy without unused pages into the new folder `path`. AlreadyExists if there is a
  // database; ResourceExhausted if the disk is full, with nothing left of the copy.
  absl::Status Compact(const std::string& path) const;

  // Bytes on disk, and bytes of it that are in use.
  struct Usage {
    uint64_t file_bytes = 0;
    uint64_t used_bytes = 0;
    uint64_t raw_image_bytes = 0;  // of these, for raw images
    struct Variant {
      std::string name;
      uint64_t records = 0;
      uint64_t record_bytes = 0;
      uint64_t index_bytes = 0;
    };
    std::vector<Variant> variants;
  };
  absl::StatusOr<Usage> GetUsage() const;

 private:
  friend class IndexBuild;
  friend class ShardMerge;

  // Writes `payload` under `key` in `meta`, or removes the key, as one change by `program`. An
  // empty program leaves no entry in the provenance log.
  absl::Status ChangeMeta(std::string_view key, const std::optional<std::string>& payload,
                          const std::string& program);

  absl::StatusOr<Snapshot> StateOf(std::shared_ptr<const ReadTransaction> held) const;

  explicit Database(std::shared_ptr<DatabaseState> state);
  std::shared_ptr<DatabaseState> state_;
};

// Leaves nothing of a database in the folder `path`, nor the folder if nothing else is in it.
void RemoveDatabase(const std::string& path);

// A variant in one state.
struct VariantState {
  std::unique_ptr<Database> database;
  Snapshot snapshot;
};

}  // namespace silhouette
