// SPDX-License-Identifier: Apache-2.0
// silhouette-db verify: whether everything is there and can be read.
#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "db/store/fixed_joints.h"
#include "db/store/shards.h"
#include "db/store/suspects.h"
#include "server/collision/robot_image_table.h"
#include "tools/program/progress.h"
#include "tools/silhouette-db/commands.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

using Json = nlohmann::ordered_json;

struct VerifyOptions : DatabaseOptions {
  bool allow_missing = false;
  double fixed_joint_tolerance = 0.005;
};

// Of a variant, or of all.
struct Findings {
  std::string variant;
  uint64_t captured = 0;
  uint64_t excluded = 0;
  uint64_t damaged = 0;
  uint64_t foreign = 0;  // of these: of tiles that a shard does not have
  uint64_t missing = 0;
  uint64_t elsewhere = 0;  // captured with a fixed joint elsewhere
  uint64_t suspect = 0;    // captured while the cell may have changed
  std::vector<FixedJointRange> fixed_joints;
  uint64_t raw_images = 0;  // configurations that have them
  CollisionIndexSummary index;
  std::vector<std::string> faults;

  // An empty one is not sound, but nothing in it is wrong.
  const char* Word() const {
    if (faults.empty()) return "sound";
    return captured + excluded + damaged == 0 && faults.size() == 1 && missing > 0 ? "empty"
                                                                                   : "not sound";
  }

  void Add(const Findings& other) {
    captured += other.captured;
    excluded += other.excluded;
    damaged += other.damaged;
    missing += other.missing;
    elsewhere += other.elsewhere;
    suspect += other.suspect;
    raw_images += other.raw_images;
    faults.insert(faults.end(), other.faults.begin(), other.faults.end());
  }
};

// The collision index against the robot images that it should hold: takes all records in the order
// of their numbers, builds the tiles from them again, and compares.
class IndexCheck {
 public:
  // `index` must outlive it. The records are those of its snapshot.
  explicit IndexCheck(const CollisionIndex& index) : index_(index), builder_(index.trees()) {}

  // The next record; an error status stands for one that cannot be read.
  void Take(ConfigurationNumber number, const absl::StatusOr<RobotImage>& image) {
    if (tile_ && *tile_ != number / kTileSize) CompareTile();
    tile_ = number / kTileSize;
    readable_ = readable_ && image.ok();
    if (!image.ok() || image->excluded) return;
    std::vector<MaskWords> words;
    for (const Mask& mask : image->masks) words.push_back(mask.words());
    builder_.Add(number % kTileSize, words);
  }

  // There are no more. A sentence per tile whose index is not what its robot images give.
  std::vector<std::string> Finish() {
    if (tile_) CompareTile();
    return std::move(faults_);
  }

 private:
  // A record that became unreadable after the tile was built cannot be compared; it is a fault of
  // its own.
  void CompareTile() {
    const std::vector<std::byte> expected = builder_.Finish();
    const std::span<const std::byte> stored = index_.Bytes(*tile_);
    const bool same = stored.size() >= expected.size() &&
                      std::ranges::equal(expected, stored.first(expected.size()));
    if (!stored.empty() && readable_ && !same) {
      faults_.push_back(
          absl::StrCat("the collision index of tile ", *tile_, " is not that of its robot images"));
    }
    readable_ = true;
  }

  const CollisionIndex& index_;
  TileIndexBuilder builder_;
  std::optional<uint64_t> tile_;
  bool readable_ = true;  // all records of the tile
  std::vector<std::string> faults_;
};

// Where the fixed joints stood when the robot images were captured.
class FixedJointCheck {
 public:
  FixedJointCheck(const storage::v1::CellDescription& cell, double tolerance)
      : ranges_(cell), tolerance_(tolerance) {}

  void Take(const RobotImage& image) {
    if (image.excluded) return;
    ranges_.Add(image.measured);
    const std::optional<std::string> elsewhere = ranges_.Elsewhere(image.measured, tolerance_);
    if (!elsewhere) return;
    if (count_++ == 0) first_ = *elsewhere;
    if (numbers_.size() < kMostNumbers) numbers_.push_back(image.number);
  }

  void Report(Findings& findings) const {
    findings.fixed_joints = ranges_.ranges();
    findings.elsewhere = count_;
    if (count_ == 0) return;
    findings.faults.push_back(absl::StrCat(
        count_, " robot images were captured with a fixed joint elsewhere, the first with ", first_,
        ", and are not used; move it back, and recapture them: silhouette-capture run --only ",
        count_ > kMostNumbers ? "all" : absl::StrJoin(numbers_, ",")));
  }

 private:
  static constexpr size_t kMostNumbers = 20;

  FixedJointRanges ranges_;
  const double tolerance_;
  uint64_t count_ = 0;
  std::string first_;
  std::vector<ConfigurationNumber> numbers_;
};

// Whether every view shows the robot's motion.
class MotionCheck {
 public:
  void Take(const RobotImage& image) {
    if (image.excluded) return;
    if (images_++ == 0) any_ = every_ = image.masks;
    for (size_t view = 0; view < any_.size(); ++view) {
      any_[view] = any_[view] | image.masks[view];
      every_[view] = every_[view] & image.masks[view];
    }
  }

  void Report(const storage::v1::CellDescription& cell, Findings& findings) const {
    for (size_t view = 0; view < any_.size(); ++view) {
      std::string fault = WhyNoMotionShows(cell.views(static_cast<int>(view)).name(), any_[view],
                                           every_[view], images_);
      if (!fault.empty()) findings.faults.push_back(std::move(fault));
    }
  }

 private:
  uint64_t images_ = 0;
  std::vector<Mask> any_, every_;  // per view
};

// Reads every record, and compares the collision index with them.
absl::Status ReadRecords(const Database& database, const CollisionIndex& index,
                         FixedJointCheck& fixed_joints, Findings& findings) {
  const ConfigurationGrid& grid = database.grid();
  ASSIGN_OR_RETURN(const auto history, index.snapshot().CaptureHistory());
  const SuspectSpans suspects(history);
  ASSIGN_OR_RETURN(const auto drawn, index.snapshot().DrawnImages());
  MotionCheck motion;
  Progress progress("verify", index.snapshot().size(), "records");
  IndexCheck index_check(index);
  uint64_t done = 0;
  std::vector<ConfigurationNumber> without_robot;
  const auto visit = [&](ConfigurationNumber number, const absl::StatusOr<RobotImage>& image) {
    if (!image.ok()) {
      ++findings.damaged;
      findings.faults.push_back(
          absl::StrCat(image.status().message(), " (", JointText(grid, number), ")"));
    } else {
      image->excluded ? ++findings.excluded : ++findings.captured;
      fixed_joints.Take(*image);
      motion.Take(*image);
      if (!image->excluded && suspects.Contain(image->captured)) ++findings.suspect;
      if (ShowsNoRobot(*image)) without_robot.push_back(number);
    }
    if (drawn && !HasTile(*drawn, number / kTileSize)) ++findings.foreign;
    index_check.Take(number, image);
    progress.Update(++done);
    return !StopRequested();
  };
  const absl::Status status = index.snapshot().ForEach(visit);
  if (StopRequested()) return Stopped("verify reads the database from its beginning each time");
  fixed_joints.Report(findings);
  motion.Report(database.cell(), findings);
  if (findings.suspect > 0) {
    findings.faults.push_back(absl::StrCat(
        findings.suspect, " robot images were captured while the cell may have changed; capture ",
        "them again with 'silhouette-capture run --only suspect'"));
  }
  if (!without_robot.empty()) {
    findings.faults.push_back(absl::StrCat(
        "robot images without a pixel of the robot in any view, which no obstacle can meet: ",
        without_robot.size(), ", the first at ", JointText(grid, without_robot.front()),
        "; capture them again, or import them with --replace"));
  }
  for (std::string& fault : index_check.Finish()) findings.faults.push_back(std::move(fault));
  if (absl::IsDataLoss(status)) {
    findings.faults.emplace_back(status.message());
    return absl::OkStatus();
  }
  return status;
}

// Reads every camera image that was kept, and looks for the reference images that go with them.
absl::Status ReadRawImages(const storage::v1::CellDescription& cell, const Snapshot& snapshot,
                           Findings& findings) {
  ASSIGN_OR_RETURN(const auto numbers, snapshot.RawImageNumbers());
  findings.raw_images = numbers.size();
  std::set<uint64_t> references;
  for (const ConfigurationNumber number : numbers) {
    if (StopRequested()) return Stopped("verify reads the database from its beginning each time");
    for (int view = 0; view < cell.views_size(); ++view) {
      const auto image = snapshot.FindRawImage(number, view);
      if (!image.ok()) {
        findings.faults.emplace_back(image.status().message());
      } else if (!image->has_value()) {
        findings.faults.push_back(absl::StrCat("configuration ", number,
                                               " has no raw image in the view '",
                                               cell.views(view).name(), "', but in others"));
      } else {
        references.insert((*image)->references);
      }
    }
  }
  for (const uint64_t id : references) {
    const auto kept = snapshot.ReferencesOf(id);
    if (!kept.ok()) findings.faults.emplace_back(kept.status().message());
  }
  return absl::OkStatus();
}

// Whether the server draws the robot images, which a database without records need not have then:
// its model was verified, or other variants have what was drawn (the nodes of an arm).
absl::StatusOr<bool> DrawnWhenServed(const Database& database) {
  ASSIGN_OR_RETURN(const auto variants, database.ReadVariants());
  for (const VariantState& variant : variants) {
    const auto verification = variant.snapshot.Verification();
    const auto drawn = variant.snapshot.DrawnImages();
    if ((verification.ok() && *verification) || (drawn.ok() && *drawn)) return true;
  }
  return false;
}

absl::Status CheckCompleteness(const Database& database, const Snapshot& snapshot,
                               bool allow_missing, Findings& findings) {
  const ConfigurationGrid& grid = database.grid();
  const uint64_t records = findings.captured + findings.excluded + findings.damaged;
  ASSIGN_OR_RETURN(const auto drawn, snapshot.DrawnImages());
  if (records == 0 && !drawn) {
    ASSIGN_OR_RETURN(const bool when_served, DrawnWhenServed(database));
    if (when_served) return absl::OkStatus();
  }
  const uint64_t wanted = drawn ? ConfigurationsOf(*drawn, grid) : grid.size();
  findings.missing = wanted - std::min(records - findings.foreign, wanted);
  if (findings.foreign > 0) {
    findings.faults.push_back(
        absl::StrCat(findings.foreign, " records are of tiles of other shards than this one, ",
                     NameOfShard(*drawn), "; draw it again into a new database"));
  }
  if (findings.missing == 0 || allow_missing) return absl::OkStatus();
  if (records == 0 && !drawn) {
    findings.faults.push_back(absl::StrCat(
        "there are no robot images: capture them (silhouette-capture run) or import them; a cell "
        "with 'images: drawn' needs none, once its model is verified (silhouette-capture "
        "verify-model) or where the server may draw it --unverified"));
    return absl::OkStatus();
  }
  std::vector<ConfigurationNumber> first;
  for (ConfigurationNumber number = 0; number < grid.number_limit() && first.size() < 3; ++number) {
    if (!grid.Contains(number) || (drawn && !HasTile(*drawn, number / kTileSize))) continue;
    const absl::StatusOr<bool> there = snapshot.Contains(number);
    if (there.ok() && !*there) first.push_back(number);
  }
  findings.faults.push_back(absl::StrCat(findings.missing, " of ", wanted,
                                         " configurations are missing, the first are ",
                                         absl::StrJoin(first, ", ")));
  return absl::OkStatus();
}

void CheckMeta(const storage::v1::CellDescription& cell, const Snapshot& snapshot,
               Findings& findings) {
  const auto references = snapshot.References();
  if (!references.ok()) {
    findings.faults.emplace_back(references.status().message());
  } else if (*references && (*references)->views_size() != cell.views_size()) {
    findings.faults.push_back("there are reference images for another number of views");
  }
  const auto calibration = snapshot.Calibration();
  if (!calibration.ok()) findings.faults.emplace_back(calibration.status().message());
  const auto verification = snapshot.Verification();
  if (!verification.ok()) findings.faults.emplace_back(verification.status().message());
  const auto provenance = snapshot.Provenance();
  if (!provenance.ok()) findings.faults.emplace_back(provenance.status().message());
}

absl::StatusOr<Findings> VerifyVariant(const VerifyOptions& options, const std::string& name) {
  ASSIGN_OR_RETURN(OpenedDatabase opened, OpenForReading(options.database, name));
  const Database& database = *opened.database;
  ASSIGN_OR_RETURN(const auto index, CollisionIndex::Open(std::move(opened.snapshot)));
  const Snapshot& snapshot = index->snapshot();
  Findings findings;
  findings.variant = name;
  const bool further = name != schema::kDefaultVariant;
  if (!further) CheckMeta(database.cell(), snapshot, findings);
  findings.index = index->Summary();
  // A tile whose index is stale or missing is no fault: nothing uses it.
  if (findings.index.damaged > 0) {
    findings.faults.push_back(absl::StrCat("the collision index of ",
                                           Counted(findings.index.damaged, "tile"), " is damaged"));
  }
  FixedJointCheck fixed_joints(database.cell(), options.fixed_joint_tolerance);
  RETURN_IF_ERROR(ReadRecords(database, *index, fixed_joints, findings));
  RETURN_IF_ERROR(ReadRawImages(database.cell(), snapshot, findings));
  RETURN_IF_ERROR(CheckCompleteness(database, snapshot, options.allow_missing, findings));
  for (std::string& fault : findings.faults) {
    if (further) fault = absl::StrCat("variant '", name, "': ", fault);
  }
  return findings;
}

Json JsonOf(const Findings& findings, const CollisionIndexSummary& index) {
  return {{"captured", findings.captured},     {"excluded", findings.excluded},
          {"damaged", findings.damaged},       {"missing", findings.missing},
          {"elsewhere", findings.elsewhere},   {"suspect", findings.suspect},
          {"raw_images", findings.raw_images}, {"collision_index", StateJson(index)}};
}

// A variant's part of the result; `of` begins its lines.
void AppendVariant(const std::string& database, const std::string& of, const Findings& findings,
                   std::string& text, Json& variants) {
  Json& json = variants.emplace_back(JsonOf(findings, findings.index));
  json["name"] = findings.variant;
  json["fixed_joints"] = Json::object();
  absl::StrAppend(&text, of, "collision index: ", StateText(findings.index, database), "\n");
  for (const FixedJointRange& joint : findings.fixed_joints) {
    json["fixed_joints"][joint.name] = {
        {"position", joint.position}, {"lowest", joint.lowest}, {"highest", joint.highest}};
    if (joint.lowest == joint.highest) continue;
    absl::StrAppend(&text, of, "fixed joint '", joint.name, "': captured at ", joint.lowest, " to ",
                    absl::StrCat(joint.highest, "\n"));
  }
  if (findings.raw_images > 0) {
    absl::StrAppend(&text, of, "raw images: of ", findings.raw_images, " configurations\n");
  }
  absl::StrAppend(&text, of,
                  absl::StrCat(findings.captured, " captured, ", findings.excluded, " excluded, ",
                               findings.damaged, " damaged, ", findings.missing,
                               " missing: ", findings.Word(), "\n"));
}

absl::StatusOr<ExitCode> Verify(const VerifyOptions& options) {
  ASSIGN_OR_RETURN(const OpenedDatabase opened, OpenForReading(options.database));
  ASSIGN_OR_RETURN(const std::vector<std::string> names, opened.database->Variants());
  CatchStopSignals();
  std::vector<Findings> variants;
  Findings sum;
  for (const std::string& name : names) {
    ASSIGN_OR_RETURN(Findings findings, VerifyVariant(options, name));
    sum.Add(findings);
    variants.push_back(std::move(findings));
  }
  Json json = JsonOf(sum, variants.front().index);
  json["ok"] = sum.faults.empty();
  json["faults"] = sum.faults;
  json["variants"] = Json::array();
  std::string text;
  for (const std::string& fault : sum.faults) absl::StrAppend(&text, fault, "\n");
  for (const Findings& findings : variants) {
    const std::string of = variants.size() == 1 ? "" : "variant '" + findings.variant + "': ";
    AppendVariant(options.database, of, findings, text, json["variants"]);
  }
  PrintResult(options.format, json, text);
  return sum.faults.empty() ? kDone : kNo;
}

}  // namespace

void AddVerify(CLI::App& app, Work& work) {
  auto [command, options] = AddCommand(
      app, work, "verify",
      "Reads the whole database. Checks checksums, completeness, the positions of fixed joints\n"
      "and the collision index; exit code 1 if it is not sound",
      Verify);
  command.add_flag("--allow-missing", options.allow_missing,
                   "Configurations without a record are no fault");
  command
      .add_option("--fixed-joint-tolerance", options.fixed_joint_tolerance,
                  "How far a joint outside the grid may have been from its position in the cell\n"
                  "file; radians, metres: fixed_joint_tolerance of the cell file")
      ->check(PositiveNumber())
      ->capture_default_str();
  AddFormatOption(command, options.format);
  command.footer("Example:\n  silhouette-db verify cell.lmdb");
}

}  // namespace silhouette
