// SPDX-License-Identifier: Apache-2.0
// All permanent names and keys of the database, and the grammar of the values in `meta`.
// docs/database_format.md describes them for outsiders.
//
// Sub-database `meta`: key (ASCII) -> value:
//   "format"      "silhouette " and the format version as decimal ASCII; nothing else
//   the others    checksum (u64), payload. The checksum is XXH3-64 of the payload, seed 0.
//                 "cell": CellDescription; "references": References; "calibration": Calibration;
//                 "verification": ModelVerification;
//                 "provenance": ProvenanceLog; "capture": CaptureHistory; "drawn": DrawnImages,
//                 absent if robot images are captured; "sets": RobotImageVariants, absent while
//                 there is but the default variant; "generation": u64, one more in every committed
//                 change but those of `collision_index`.
// Sub-database `robot_images`: configuration number (u64, big-endian) ->
// db/store/robot_image_format.h. Sub-database `collision_index`, which may be absent: tile (u64,
// big-endian) -> db/store/tile_value.h. Sub-database `raw_images`, which may be absent:
// db/store/raw_image_format.h. They are those of the default variant. The variant NAME has
// `robot_images/NAME`, `collision_index/NAME` and `raw_images/NAME`, and the keys "capture/NAME"
// and "drawn/NAME" (PlacesOfVariant).
//
// Integers are little-endian unless said otherwise.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "db/mask/configuration_grid.h"

namespace silhouette::schema {

inline constexpr int kFormatVersion = 1;

inline constexpr char kDataFile[] = "data.mdb";
inline constexpr char kLockFile[] = "lock.mdb";
// Locked with flock() by the one process that writes; its text is that process's id.
inline constexpr char kWriterFile[] = "writer.lock";
// Where a new data file is made, until it is whole.
inline constexpr char kUnfinishedFolder[] = "unfinished";

inline constexpr char kMeta[] = "meta";
inline constexpr char kRobotImages[] = "robot_images";
inline constexpr char kCollisionIndex[] = "collision_index";
inline constexpr char kRawImages[] = "raw_images";
// How many sub-databases a process may have open, those of later versions included: some for all
// variants, and up to three for each name of a variant that it met, removed ones included, until it
// closes the database.
inline constexpr unsigned kMaxSubDatabases = 1024;

// The variant that every database has, and the most variants of a database, this one included.
inline constexpr char kDefaultVariant[] = "default";
inline constexpr size_t kMaxVariants = 16;

// Where the records of a variant and what belongs to them lie.
struct VariantPlaces {
  std::string name;
  std::string robot_images;
  std::string collision_index;
  std::string raw_images;
  std::string capture_key;
  std::string drawn_key;

  bool is_default() const { return name == kDefaultVariant; }
};
VariantPlaces PlacesOfVariant(const std::string& name);

// Whether a variant may have this name: 1 to 32 of a-z, 0-9, '_' and '-'.
bool IsVariantName(std::string_view name);

inline constexpr std::string_view kFormatKey = "format";
inline constexpr std::string_view kCellKey = "cell";
inline constexpr std::string_view kReferencesKey = "references";
inline constexpr std::string_view kCalibrationKey = "calibration";
inline constexpr std::string_view kVerificationKey = "verification";
inline constexpr std::string_view kProvenanceKey = "provenance";
inline constexpr std::string_view kCaptureKey = "capture";
inline constexpr std::string_view kDrawnKey = "drawn";
// The text stays as the first databases have it, so that their variants are found.
inline constexpr std::string_view kVariantsKey = "sets";
inline constexpr std::string_view kGenerationKey = "generation";

// All keys of `meta`, and all sub-databases, that a database with these variants may have.
using Names = std::set<std::string, std::less<>>;
Names KeysOfMeta(const std::vector<std::string>& variants);
Names SubDatabases(const std::vector<std::string>& variants);

// The value of "format" that this version writes.
std::string FormatValue();

// The format version that a value of "format" states; nothing if it is not one.
std::optional<int> FormatVersionIn(std::string_view value);

// Every value but that of "format" begins with its checksum: XXH3-64 of all bytes after it.
inline constexpr size_t kChecksumSize = 8;
// Writes the checksum into the first bytes of `value`.
void Seal(std::string& value, uint64_t seed = 0);
// Whether a value begins with its checksum.
bool IsSealed(std::string_view value, uint64_t seed = 0);

// A value of `meta` around its payload, and back. Nothing if the checksum does not hold.
std::string SealMeta(std::string_view payload);
std::optional<std::string_view> OpenMeta(std::string_view value);

// The payload of "generation".
std::string EncodeGeneration(uint64_t generation);
std::optional<uint64_t> DecodeGeneration(std::string_view payload);

// The key of a configuration in `robot_images`, or of a tile in `collision_index`.
using NumberKey = std::string;  // 8 bytes
NumberKey EncodeKey(uint64_t number);
std::optional<uint64_t> DecodeKey(std::string_view key);

// Little-endian integers in byte strings.
void AppendU64(std::string& bytes, uint64_t value);
uint64_t ReadU64(const char* bytes);

}  // namespace silhouette::schema
