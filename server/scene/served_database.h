// SPDX-License-Identifier: Apache-2.0
// One generation of a database: what scenes are made with and verdicts rest on. A database has one
// variant or several; what is loaded is the default variant, which has the others.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "calib/camera/calibration.h"
#include "calib/robot/drawing/drawn_kind.h"
#include "calib/robot/drawn_cell.h"
#include "capture/segmentation/image_condition.h"
#include "capture/segmentation/reference.h"
#include "db/mask/joint_regions.h"
#include "db/store/collision_index.h"
#include "db/store/fixed_joints.h"
#include "db/store/store.h"
#include "db/store/suspects.h"
#include "server/collision/epipolar_bands.h"
#include "server/collision/policy.h"
#include "server/collision/robot_image_table.h"
#include "server/scene/scene_settings.h"
#include "server/scene/separation_basis.h"
#include "server/scene/sound_basis.h"
#include "server/scene/view_treatment.h"

namespace silhouette {

// What was found wrong with a database since it was loaded. Stays. Thread-safe.
class DatabaseDamage {
 public:
  // Takes the first finding, which is not empty. Whether this is it.
  bool Note(const std::string& what) {
    const std::lock_guard lock(mutex_);
    if (!what_.empty()) return false;
    what_ = what;
    found_.store(true, std::memory_order_release);
    return true;
  }
  bool found() const { return found_.load(std::memory_order_acquire); }
  // Empty: nothing.
  std::string what() const {
    const std::lock_guard lock(mutex_);
    return what_;
  }

 private:
  std::atomic<bool> found_ = false;
  mutable std::mutex mutex_;
  std::string what_;
};

struct LoadSettings {
  // Bytes of robot images, uncompressed, that are held in memory. If all of a variant's are more,
  // or than the variants before it left, none of it is: they are read from the database when they
  // are needed.
  uint64_t robot_image_memory = std::numeric_limits<uint64_t>::max();
  // Whether variants beside the default one are held at all.
  bool variants_in_memory = false;
  // Called now and again while robot images are read, with how many of the records are done.
  std::function<void(uint64_t done, uint64_t records)> progress = nullptr;
  // Largest deviation of a fixed joint, when a robot image was captured, from where the cell has
  // it: radians, metres. A robot image with a larger one is not used.
  double fixed_joint_tolerance = 0.005;
  // In place of the database's own, for experiments: that it is of these cameras is not checked.
  std::optional<Calibration> calibration = std::nullopt;
  // Where the robot of captured images must never be; that of drawn ones: `drawn` says it.
  JointRegions forbidden = {};
  // What robot images are drawn from, by the calibration; nothing: they are those that were
  // captured. No verdict rests on captured ones then. Maps rest on the collision index of stored
  // drawn ones if they are of the very same robot.
  std::optional<DrawnCell> drawn = std::nullopt;
  // Why nothing may rest on the calibration; empty: nothing speaks against it.
  std::string calibration_doubt = {};
};

// Cannot be changed once loaded, but can be found damaged; used by any number of threads.
class ServedDatabase {
 public:
  // Reads all robot images of all variants once, in one state of the database, the reference images
  // and the calibration, and opens the collision index. A record that fails its checksum is marked
  // corrupt, one that was captured with a fixed joint elsewhere as such, so that nothing that takes
  // it is ever free. DataLoss: the database cannot be read as a
  // whole, or its calibration is damaged. InvalidArgument: its grid has more places than a
  // RobotImageTable can have, its calibration is none (two cameras at one place, a matrix that is
  // not of rank 2), the margin is negative, or `treatments` (TreatmentsOf), `sound`
  // (SoundBasis::Make) or `load.drawn` (DrawnRobotOf) cannot be. FailedPrecondition: robot images
  // are to be drawn, and there are no camera models, or several variants (but for those that have
  // the images of nodes of an arm); or captured ones are to be served, and those that are stored
  // were drawn, or a view does not show the robot's motion (WhyNoMotionShows). `sound`: what the
  // sound presets are served with, where the calibration has camera models; nothing: they are not
  // served.
  static absl::StatusOr<std::shared_ptr<const ServedDatabase>> Load(
      const Database& database, const CalibrationSettings& settings = {},
      const TreatmentSettings& treatments = {},
      const std::optional<SoundCell>& sound = std::nullopt, const LoadSettings& load = {});

  // The name of the variant.
  const std::string& variant() const { return variant_; }
  // The names of all variants of the database, if this is the default one: this first.
  std::vector<std::string> variants() const;
  // The same generation with another variant's robot images, collision index and sound presets;
  // `name` may be empty for the default variant. Null if there is none.
  static std::shared_ptr<const ServedDatabase> VariantOf(
      const std::shared_ptr<const ServedDatabase>& whole, const std::string& name);
  const ServedDatabase* Variant(const std::string& name) const;

  // Of all variants. Once it is found, no verdict can rest on them (BlockedReason).
  DatabaseDamage& damage() const { return *damage_; }

  const storage::v1::CellDescription& cell() const { return cell_; }
  uint64_t generation() const { return generation_; }
  // What gives configurations their meaning: XXH3-64 of the cell, but for `segmentation`, which is
  // all of it that may change. Never 0.
  uint64_t cell_digest() const { return cell_digest_; }
  // In memory, or read from the file of the database, of which they hold one state then, as the
  // collision index does; or drawn.
  const RobotImageTable& robot_images() const { return robot_images_; }
  const ConfigurationGrid& grid() const { return robot_images_.grid(); }

  int views() const { return robot_images_.views(); }
  const std::string& view_name(int view) const { return cell_.views(view).name(); }
  // The view of this name; nothing if there is none.
  std::optional<int> ViewOf(const std::string& name) const;

  // Whether robot images are drawn from a model that no captured ones were found to agree with, and
  // why (VerifiedRobot); empty: they are not.
  bool unverified_model() const { return !unverified_.empty(); }
  const std::string& unverified() const { return unverified_; }

  // Where the fixed joints stood when the robot images that are used were captured, those of all
  // variants, in the cell's order: within fixed_joint_tolerance of where the cell has them.
  const std::vector<FixedJointRange>& fixed_joints() const { return fixed_joints_->ranges(); }
  // What was elsewhere when the first robot image of the variant that is not used was captured
  // (FixedJointRanges::Elsewhere); empty: all are used.
  const std::string& elsewhere() const { return elsewhere_; }

  // Whether capture sessions changed, of any variant, which of the loaded robot images are suspect.
  // Reads the database's file. Not where robot images are drawn, nor where its being open keeps
  // writers out (ReadersKeepWritersOut). Unavailable and other errors of Database::Read.
  absl::StatusOr<bool> SuspectsChanged() const;

  // The collision index; null if there is none that can be used. It lies in the file of the
  // database, of which it holds one state (db/store/collision_index.h). The configurations of a
  // tile that it lacks are tested one by one. Of drawn images only if they are those of the very
  // robot that is drawn here.
  const CollisionIndex* index() const { return index_.get(); }
  // Of a grid whose configurations are nodes of an arm: the index of their own or reach images,
  // under the same condition; null also if the other kind's is not there. `kind`: kOwn or kReach.
  const CollisionIndex* node_index(DrawnKind kind) const {
    const bool both = own_index_ != nullptr && reach_index_ != nullptr;
    return !both ? nullptr : kind == DrawnKind::kOwn ? own_index_.get() : reach_index_.get();
  }
  // Why the index of stored drawn images is not used, as a sentence; empty: it is, or there are
  // none.
  const std::string& index_unused() const { return index_unused_; }

  // Whether camera images can be differenced.
  bool has_references() const { return !references_.empty(); }
  // The reference image of a view; has_references() must hold.
  const Reference& reference(int view) const { return references_[static_cast<size_t>(view)]; }

  // Of all reference images; empty where there are none.
  std::span<const Outline> outlines() const { return outlines_; }

  // Which calibration it is (FingerprintOf in calib/files/calibration_message.h); empty where there
  // is none.
  const std::string& calibration_fingerprint() const { return calibration_fingerprint_; }
  // LoadSettings::calibration_doubt. What rests on the calibration is unknown then.
  const std::string& calibration_doubt() const { return calibration_doubt_; }
  // CalibrationSettings::margin, with which it is served.
  double calibration_margin() const { return calibration_margin_; }

  // The calibration, and the epipolar lines that follow from it; null where there is none.
  const Calibration* calibration() const { return calibration_ ? &*calibration_ : nullptr; }
  const EpipolarBands* bands() const { return bands_.get(); }

  const ViewTreatment& treatment(int view) const {
    return treatments_.views[static_cast<size_t>(view)];
  }
  // FailedPrecondition: a margin is not known, and the mend. No verdict is free then.
  const absl::Status& margins_known() const { return treatments_.margins_known; }

  // What the sound presets rest on; null where they cannot be served.
  const std::shared_ptr<const SoundBasis>& sound() const { return sound_; }
  // What distances to people rest on; null where they are not served: the cell has no section
  // 'separation', or no sound presets.
  const std::shared_ptr<const SeparationBasis>& separation() const { return separation_; }

  // Whether the database has what a policy needs. FailedPrecondition: what it lacks, and the mend.
  absl::Status CanServe(const Policy& policy) const;
  // The default preset: sound where the cell is set up for it, else uncalibrated. Not calibrated:
  // it blocks most of a cell in which a person stands (docs/verdict-quality.md).
  Preset BestPreset() const;

 private:
  absl::Status CanServeSound(Preset preset) const;

  // What all variants share.
  struct Common {
    storage::v1::CellDescription cell;
    uint64_t generation = 0;
    std::vector<Reference> references;
    std::vector<Outline> outlines;
    std::optional<Calibration> calibration;
    std::string calibration_fingerprint;
    std::string calibration_doubt;
    double calibration_margin = 0;
    std::shared_ptr<const EpipolarBands> bands;
    ViewTreatments treatments;
    std::shared_ptr<DatabaseDamage> damage = std::make_shared<DatabaseDamage>();
    std::shared_ptr<FixedJointRanges> fixed_joints;  // gets what is met as variants are loaded
  };
  static absl::StatusOr<Common> LoadCommon(const Database& database, const Snapshot& snapshot,
                                           const CalibrationSettings& settings,
                                           const TreatmentSettings& treatments,
                                           const LoadSettings& load);
  // `load`: what memory the variant may take; gets what it leaves.
  static absl::StatusOr<std::shared_ptr<ServedDatabase>> LoadVariant(
      const Database& database, std::shared_ptr<const Snapshot> snapshot, const Common& common,
      const CalibrationSettings& settings, const std::optional<SoundCell>& sound,
      LoadSettings& load);

  // Takes the index of a variant that has the images of nodes.
  absl::Status LoadNodeIndex(DrawnKind kind, Snapshot snapshot, const DrawnCell& cell);

  ServedDatabase(std::string variant, const Common& common, RobotImageTable robot_images,
                 std::string elsewhere, std::shared_ptr<const CollisionIndex> index,
                 std::shared_ptr<const SoundBasis> sound);

  std::string variant_;
  std::string unverified_;
  std::map<std::string, std::shared_ptr<const ServedDatabase>> other_variants_;
  storage::v1::CellDescription cell_;
  uint64_t generation_ = 0;
  uint64_t cell_digest_ = 0;
  RobotImageTable robot_images_;
  std::shared_ptr<DatabaseDamage> damage_;
  std::shared_ptr<const FixedJointRanges> fixed_joints_;
  std::string elsewhere_;
  std::unique_ptr<const Database> file_;  // null: not watched
  SuspectSpans suspects_;                 // as far as they concern what was loaded
  absl::Time newest_ = absl::InfinitePast();
  std::shared_ptr<const CollisionIndex> index_;
  std::shared_ptr<const CollisionIndex> own_index_;
  std::shared_ptr<const CollisionIndex> reach_index_;
  std::string index_unused_;
  std::vector<Reference> references_;
  std::vector<Outline> outlines_;
  std::optional<Calibration> calibration_;
  std::string calibration_fingerprint_;
  std::string calibration_doubt_;
  double calibration_margin_;
  std::shared_ptr<const EpipolarBands> bands_;
  ViewTreatments treatments_;
  std::shared_ptr<const SoundBasis> sound_;
  std::shared_ptr<const SeparationBasis> separation_;
};

}  // namespace silhouette
