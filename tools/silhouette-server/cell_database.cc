// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-server/cell_database.h"

#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "calib/files/calibration_message.h"
#include "capture/segmentation/down_sampling.h"
#include "common/picture/files.h"
#include "common/picture/mask_png.h"
#include "db/status/status_macros.h"
#include "db/store/schema.h"
#include "db/store/store.h"
#include "db/store/writer_lock.h"
#include "server/scene/what_is_missed.h"
#include "tools/cell/robot_in_images.h"
#include "tools/cell/segmentation_text.h"

namespace silhouette {
namespace {

// A mask pixel proves nothing if any part of its square does not. Messages do not name the view.
absl::StatusOr<Mask> ReadIgnored(const ViewSettings& view) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadWholeFile(view.ignore));
  const absl::StatusOr<cv::Mat> white = DecodeBlackAndWhite(bytes);
  const auto wrong = [&](absl::string_view why) {
    return absl::InvalidArgumentError(absl::StrCat("'", view.ignore, "': ", why));
  };
  if (!white.ok()) return wrong(white.status().message());
  const cv::Size mask(view.mask_size.width, view.mask_size.height);
  const cv::Size image(view.image_width, view.image_height);
  if (white->size() != mask && white->size() != image) {
    return wrong(absl::StrCat("it is ", white->cols, "x", white->rows,
                              " pixels large and should be ", mask.width, "x", mask.height,
                              ", as the mask, or ", image.width, "x", image.height,
                              ", as the camera image"));
  }
  const Mask ignored = DownSample(*white, view.mask_size, 0);
  if (ignored.Count() == view.mask_size.pixels()) {
    return wrong(
        "it is white everywhere, so that the view would show no obstacle; paint white "
        "only what proves nothing");
  }
  return ignored;
}

// The safety margins and ignored pixels that the cell file states. Reads the images of ignored
// pixels and, where a margin is a length, finds the workspace. NotFound and InvalidArgument name
// the view and the file: an image that is not there, is none, or has neither the size of the view's
// mask nor of its camera image. Further errors: WorkspaceOf.
absl::StatusOr<TreatmentSettings> TreatmentSettingsOf(const Cell& cell) {
  TreatmentSettings settings;
  bool lengths = false;
  for (const ViewSettings& view : cell.views) {
    ViewTreatmentSettings treatment{.margin = view.margin, .ignored = std::nullopt};
    lengths = lengths || view.margin.metres > 0;
    if (!view.ignore.empty()) {
      absl::StatusOr<Mask> ignored = ReadIgnored(view);
      if (!ignored.ok()) {
        return absl::Status(ignored.status().code(),
                            absl::StrCat(cell.file, ": view '", view.name,
                                         "': ignore: ", ignored.status().message()));
      }
      treatment.ignored = *std::move(ignored);
    }
    settings.views.push_back(std::move(treatment));
  }
  if (!lengths) return settings;
  ASSIGN_OR_RETURN(const Workspace workspace, WorkspaceOf(cell));
  settings.workspace = workspace;
  return settings;
}

constexpr absl::Duration kBetweenReports = absl::Seconds(5);

std::string Gigabytes(uint64_t bytes) {
  return absl::StrFormat("%.2f GB", static_cast<double>(bytes) * 1e-9);
}

// The least memory.max of this process's control group and those it is in; `most` if none says any.
uint64_t MemoryOfGroup(uint64_t most) {
  std::ifstream groups("/proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    if (!line.starts_with("0::/")) continue;  // those of version 1
    const std::filesystem::path root = "/sys/fs/cgroup";
    std::filesystem::path group = root / line.substr(4);
    while (true) {
      uint64_t bytes = 0;
      if (std::ifstream(group / "memory.max") >> bytes) most = std::min(most, bytes);
      if (group == root || !group.has_relative_path()) break;
      group = group.parent_path();
    }
  }
  return most;
}

std::string Counted(uint64_t count, const std::string& what) {
  return absl::StrCat(count, " ", what, count == 1 ? "" : "s");
}

// Bytes of memory that this process may use: those of the machine, or fewer if its control group or
// a process limit allows less.
uint64_t AvailableMemory() {
  uint64_t bytes =
      static_cast<uint64_t>(sysconf(_SC_PHYS_PAGES)) * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
  bytes = MemoryOfGroup(bytes);
  for (const auto resource : {RLIMIT_AS, RLIMIT_DATA}) {
    rlimit limit{};
    if (getrlimit(resource, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY) {
      bytes = std::min<uint64_t>(bytes, limit.rlim_cur);
    }
  }
  return bytes;
}

// The cell file's settings for loading. By default robot images may take two fifths of
// AvailableMemory(), because a reload has two databases at a time. The log reports the progress
// every few seconds.
LoadSettings LoadSettingsOf(const Cell& cell) {
  return {.robot_image_memory = cell.server.robot_image_memory.value_or(AvailableMemory() / 5 * 2),
          .variants_in_memory = cell.server.variants_in_memory,
          .progress =
              [last = absl::Now()](uint64_t done, uint64_t records) mutable {
                const absl::Time now = absl::Now();
                if (now - last < kBetweenReports) return;
                last = now;
                spdlog::info("read {} of {} robot images", done, records);
              },
          .fixed_joint_tolerance = cell.server.scene.fixed_joint_tolerance};
}

// Reports where the robot images are, and whether writers are locked out of the folder `path` while
// it is served.
void LogRobotImages(const ServedDatabase& database, const std::string& path,
                    const LoadSettings& settings) {
  const RobotImageTable& images = database.robot_images();
  const uint64_t bytes =
      images.Count(RobotImageState::kPresent) * images.words() * sizeof(uint64_t);
  const bool indexed =
      database.index() != nullptr || database.node_index(DrawnKind::kReach) != nullptr;
  if (images.drawn() != nullptr) {
    spdlog::info("robot images: drawn, of {} parts; maps {}", images.drawn()->parts().size(),
                 indexed ? "come from the collision index" : "are drawn");
    if (!database.index_unused().empty()) spdlog::warn("{}", database.index_unused());
    if (!indexed) return;
  } else if (images.in_memory()) {
    spdlog::info("robot images: {}, in memory", Gigabytes(bytes));
  } else {
    spdlog::info("robot images: {}, more than robot_image_memory ({}): read from '{}' when needed",
                 Gigabytes(bytes), Gigabytes(settings.robot_image_memory), path);
  }
  const bool reads_on = std::ranges::any_of(database.variants(), [&](const std::string& name) {
    const ServedDatabase& variant = *database.Variant(name);
    return !variant.robot_images().in_memory() || variant.index() != nullptr ||
           variant.node_index(DrawnKind::kReach) != nullptr;
  });
  if (!ReadersKeepWritersOut(path)) return;
  if (!reads_on) {
    spdlog::warn(
        "no permission to write '{}/{}': robot images that a capture session finds suspect are not "
        "noticed; send SIGHUP after it, or give this process the permission",
        path, schema::kLockFile);
    return;
  }
  spdlog::warn(
      "no permission to write '{}/{}': while this server runs, no capture or index can write to "
      "the database; give this process the permission, or stop it first",
      path, schema::kLockFile);
}

// Number of tiles with robot images but without a usable index. Reads every byte of the index.
uint64_t TilesWithoutIndex(const ServedDatabase& database) {
  uint64_t without = 0;
  for (uint64_t tile = 0; tile < database.grid().tiles(); ++tile) {
    if (database.robot_images().present(tile).Empty()) continue;
    if (database.index() == nullptr || database.index()->Tile(tile) == nullptr) ++without;
  }
  return without;
}

// How many robot images of a variant can be used, and why not the others. `title` and `of` begin
// the lines on what was loaded and what is wrong.
void LogVariant(const ServedDatabase& variant, const std::string& title, const std::string& of,
                const std::string& path) {
  const RobotImageTable& images = variant.robot_images();
  if (images.drawn() != nullptr) {
    spdlog::info("{}robot images are drawn", title);
    return;
  }
  spdlog::info("{}{} captured, {} excluded; {}", title, images.Count(RobotImageState::kPresent),
               images.Count(RobotImageState::kExcluded),
               images.in_memory() ? "in memory" : "read from the database when needed");
  const auto warn = [&](RobotImageState state, const std::string& what) {
    if (const uint64_t count = images.Count(state); count > 0) {
      spdlog::warn("{}{} {}", of, Counted(count, "configuration"), what);
    }
  };
  warn(RobotImageState::kMissing, "without a robot image: unknown until captured");
  warn(RobotImageState::kCorrupt,
       "with a robot image that fails its checksum: unknown until captured again; 'silhouette-db "
       "verify' says which");
  warn(RobotImageState::kEmpty,
       "with a robot image that shows the robot in no view: unknown until captured again, "
       "'silhouette-db verify' says which; if no camera can see the robot there, forbid the "
       "region");
  warn(RobotImageState::kElsewhere,
       absl::StrCat("with a robot image that was captured with a fixed joint elsewhere, as ",
                    variant.elsewhere(),
                    ": unknown until captured again; 'silhouette-db verify' lists them"));
  warn(RobotImageState::kSuspect,
       "with a robot image that was captured while the cell may have changed: unknown until "
       "captured again with 'silhouette-capture run --only suspect'");
  if (const uint64_t without = TilesWithoutIndex(variant); without > 0) {
    spdlog::warn(
        "{}{} of {} without a collision index that matches the robot images: the configuration "
        "space takes longer; run 'silhouette-db index {}' and reload",
        of, without, Counted(variant.grid().tiles(), "tile"), path);
  }
}

// Of the views whose reference tells too little of light or structure to check images by it.
void LogUnchecked(const ServedDatabase& database) {
  for (size_t view = 0; view < database.outlines().size(); ++view) {
    const Outline& outline = database.outlines()[view];
    const std::string& name = database.view_name(static_cast<int>(view));
    if (!outline.tells_light()) {
      spdlog::warn(
          "view '{}': its reference is dark or saturated everywhere, so that neither a change of "
          "light nor a covered or moved camera is noticed; correct the exposure or the light, and "
          "capture references and robot images again",
          name);
    } else if (!outline.tells_structure()) {
      spdlog::warn(
          "view '{}': its reference is too plain to notice that the camera moved, is covered or "
          "exchanged; put something with edges where it looks, such as posters, and capture "
          "references and robot images again",
          name);
    }
  }
}

void LogLoaded(const ServedDatabase& database, const std::string& path) {
  LogVariant(database,
             absl::StrCat("loaded '", path, "', generation ", database.generation(), ": ",
                          Counted(database.grid().size(), "configuration"), ", "),
             "", path);
  for (const std::string& name : database.variants()) {
    if (name == database.variant()) continue;
    const std::string of = absl::StrCat("variant '", name, "': ");
    LogVariant(*database.Variant(name), of, of, path);
  }
  if (!database.has_references()) {
    spdlog::warn("no reference images: camera images are refused, scene masks are accepted");
  }
  LogUnchecked(database);
  if (database.bands() == nullptr) {
    spdlog::info("no calibration: unknown and error pixels are not resolved");
  }
  for (int view = 0; view < database.views(); ++view) {
    const ViewTreatment& treatment = database.treatment(view);
    if (treatment.margin > 0) {
      spdlog::info("view '{}': margin of {:.2f} pixels", database.view_name(view),
                   treatment.margin);
    }
    if (treatment.ignored) {
      spdlog::info("view '{}': {} ignored", database.view_name(view),
                   Counted(treatment.ignored->Count(), "pixel"));
    }
  }
}

std::string LinksNamed(const std::vector<std::string>& links) {
  return absl::StrJoin(links, ", ", [](std::string* out, const std::string& link) {
    absl::StrAppend(out, "link '", link, "'");
  });
}

// Of a cell whose robot images are drawn.
void LogDrawn(const ServedDatabase& database, const Cell& cell, const DrawnCell& drawn) {
  const DrawnRobot& robot = *database.robot_images().drawn();
  if (const std::string partial = PartialViews(cell, robot, drawn.forbidden); !partial.empty()) {
    spdlog::warn("{}", partial);
  }
  const std::vector<std::string> uncertain = UncertainLinks(*drawn.robot, robot);
  if (uncertain.empty()) return;
  spdlog::warn(
      "no pixel certainly shows {}, too thin for the masks' pixels, or with meshes that are "
      "concave "
      "or not closed: that it is not where it reports is not noticed there; use finer masks "
      "(mask_size), close the meshes, or draw closed ones by 'geometry'",
      LinksNamed(uncertain));
}

// How many voxels loading prepares for the sound presets, the margin around the workspace left out.
std::string VoxelsText(const SoundCell& sound, size_t views) {
  constexpr double kMany = 1e7;  // of all views: some ten seconds on a busy machine
  const double edge = sound.VoxelEdge();
  const double voxels = sound.workspace.volume() / (edge * edge * edge);
  return absl::StrFormat(", %.2g million voxels of %.3f m in %d views for the sound presets%s",
                         1e-6 * voxels, edge, views,
                         voxels * static_cast<double>(views) > kMany
                             ? ": this may take minutes, less with a larger voxel_edge"
                             : "");
}

// The least multiple of 1 / parts that is no less.
double RoundedUp(double value, double parts) { return std::ceil(value * parts) / parts; }

// Of a cell that states the section 'sound'.
void LogSound(const ServedDatabase& database, const Cell& cell) {
  if (database.sound() == nullptr) {
    spdlog::warn("the sound presets are not served: {}",
                 std::string(database.CanServe({.preset = Preset::kSound}).message()));
    return;
  }
  const SoundBasis& sound = *database.sound();
  if (sound.mask_scale() > 1) {
    spdlog::warn(
        "the masks resolve only obstacles of about {:.3f} m beside the robot, so much free space "
        "will be blocked: set least_obstacle to more than that, or use masks of {:.2f} times as "
        "many pixels along each side",
        RoundedUp(sound.resolvable_obstacle(), 1000), RoundedUp(sound.mask_scale(), 100));
  }
  if (!sound.open_links().empty()) {
    spdlog::warn(
        "the meshes of {} are not closed, are hollow, or have pieces that are inside out: an "
        "obstacle may be inside, so that the sound presets may block what is near them, or all; "
        "mend them, or set 'sound: {{geometry: collision}}' if the URDF has solid collision meshes",
        LinksNamed(sound.open_links()));
  }
  if (cell.robot.drawn) {
    if (const absl::Status holds = WorkspaceHoldsRobot(cell); !holds.ok()) {
      spdlog::warn("{}", std::string(holds.message()));
    }
  }
  for (int view = 0; view < database.views(); ++view) {
    if (database.treatment(view).margin == 0) continue;
    spdlog::warn(
        "view '{}' has a margin: the sound presets assume that an obstacle may be hidden within it "
        "around the robot, and may block everything; use no margin, or a larger least_obstacle",
        database.view_name(view));
    return;
  }
}

// Of a cell that does not.
void LogWithoutSound(const ServedDatabase& database, const Cell& cell) {
  const Calibration* calibration = database.calibration();
  if (calibration == nullptr || calibration->cameras.empty() || !cell.robot.model) return;
  spdlog::info(
      "the sound presets, which would find what the robot hides, are not served: add 'sound: "
      "{least_obstacle: 0.15}' to the cell file, the radius of the least obstacle in metres");
}

// Of a cell that states the section 'separation'.
void LogSeparation(const ServedDatabase& database, const Cell& cell) {
  const SeparationBasis* basis = database.separation().get();
  if (basis == nullptr) {
    spdlog::warn(
        "distances to people are not served: they need camera models in the database; import a "
        "calibration with 'silhouette-db calibration import'");
    return;
  }
  spdlog::info("distances to people: up to {:.2f} m, in voxels of {:.3f} m", basis->range(),
               basis->grid().edge());
  if (database.robot_images().drawn() == nullptr && !cell.sound->whole_model) {
    spdlog::warn(
        "distances to people are those of the robot's model: what the model lacks, such as a cable "
        "or a tool, is nearer to them; state 'sound: whole_model: true' if it lacks nothing");
  }
  if (basis->unseen_share() < 0.001) return;
  spdlog::warn("no view sees {:.1f} % of the zone for people, which counts as {}",
               100 * basis->unseen_share(),
               cell.separation->unseen_is_empty
                   ? "empty: nobody must come there"
                   : "possibly somebody: state a smaller 'separation: zone', or 'unseen: empty' if "
                     "nobody can be there");
}

// Which calibration the database holds, as ServedDatabase has it.
absl::StatusOr<std::string> StoredFingerprint(const Database& database) {
  ASSIGN_OR_RETURN(const Snapshot snapshot, database.Read());
  ASSIGN_OR_RETURN(const auto calibration, snapshot.Calibration());
  return calibration ? FingerprintOf(*calibration) : std::string();
}

// Why nothing may rest on the calibration; empty: there is none, or nothing speaks against it.
// FailedPrecondition: it is not that of the robot images, and margins, which no preset does
// without, rest on it. Errors of MisplacedViews.
absl::StatusOr<std::string> CalibrationDoubtOf(const Cell& cell, const Database& database) {
  ASSIGN_OR_RETURN(const Snapshot snapshot, database.Read());
  ASSIGN_OR_RETURN(const auto calibration, snapshot.Calibration());
  if (!calibration) return std::string();
  if (!cell.robot.drawn && cell.robot.model && cell.capture.first_look.least_overlap == 0) {
    spdlog::warn(
        "{}: capture: first_look: least_overlap: 0: the server does not compare the calibration "
        "with the robot images: what rests on a wrong one may be free though it is not; state a "
        "value above 0",
        cell.file);
  }
  ASSIGN_OR_RETURN(std::string misplaced, MisplacedViews(cell, database));
  if (misplaced.empty() && cell.segmentation.min_cover > 0) {
    return absl::StrFormat(
        "segmentation: min_cover: %g: what covers less of a mask pixel is missed; leave it out",
        cell.segmentation.min_cover);
  }
  const bool lengths = std::ranges::any_of(
      cell.views, [](const ViewSettings& view) { return view.margin.metres > 0; });
  if (misplaced.empty() || !lengths) return misplaced;
  return absl::FailedPreconditionError(
      absl::StrCat("margins in metres need a calibration that is right: ", misplaced));
}

}  // namespace

absl::StatusOr<std::shared_ptr<const ServedDatabase>> LoadDatabase(const Cell& cell,
                                                                   bool unverified) {
  const std::string& path = cell.database;
  if (path.empty()) {
    return InvalidArgument("'", cell.file, "' names no database; use --database DIR");
  }
  const auto opened = Database::Open(path, Database::Access::kRead);
  if (absl::IsNotFound(opened.status())) {
    return absl::NotFoundError(
        absl::StrCat(opened.status().message(), "; begin one with '",
                     cell.robot.drawn && !HasSources(cell)
                         ? absl::StrCat("silhouette-db calibration import ", path, " CAMERAS")
                         : absl::StrCat("silhouette-capture reference --database ", path),
                     " --cell ", cell.file, "'"));
  }
  if (!opened.ok()) return opened.status();
  const std::unique_ptr<Database>& database = *opened;
  storage::v1::CellDescription wanted = DescriptionOf(cell);
  *wanted.mutable_tile_edges() = database->cell().tile_edges();
  const std::vector<std::string> differences =
      Differences(wanted, "the cell file", database->cell(), "the database");
  if (!differences.empty()) {
    return absl::FailedPreconditionError(absl::StrCat(
        "the database '", path, "' does not fit the cell file '", cell.file, "': ",
        absl::StrJoin(differences, "; "), SegmentationAdvice(cell.segmentation, database->cell()),
        "; serve the cell file that the database was captured with, or capture again"));
  }
  ASSIGN_OR_RETURN(const TreatmentSettings treatments, TreatmentSettingsOf(cell));
  ASSIGN_OR_RETURN(const std::optional<SoundCell> sound, SoundCellOf(cell));
  LoadSettings load = LoadSettingsOf(cell);
  ASSIGN_OR_RETURN(load.forbidden, ForbiddenOf(cell));
  ASSIGN_OR_RETURN(load.drawn, DrawnCellOf(cell));
  for (const std::string& doubt : Doubts(cell)) spdlog::warn("{}: {}", cell.file, doubt);
  ASSIGN_OR_RETURN(const std::string doubted, StoredFingerprint(*database));
  ASSIGN_OR_RETURN(load.calibration_doubt, CalibrationDoubtOf(cell, *database));
  spdlog::info("loading '{}'{}", path, sound ? VoxelsText(*sound, cell.views.size()) : "");
  const auto served = ServedDatabase::Load(*database, cell.calibration, treatments, sound, load);
  if (!served.ok()) return served;
  if ((*served)->calibration_fingerprint() != doubted) {
    return absl::UnavailableError(absl::StrCat(
        "the calibration of '", path, "' was replaced while it was loaded; load it again"));
  }
  if ((*served)->unverified_model() && !unverified) {
    return absl::FailedPreconditionError(
        absl::StrCat("the robot images of '", cell.file,
                     "' are drawn from a model that is not verified: ", (*served)->unverified(),
                     "; verdicts are wrong wherever the robot is larger than it; verify it with ",
                     "'silhouette-capture verify-model --cell ", cell.file, " --database ", path,
                     "', or serve it with --unverified if you know it"));
  }
  LogLoaded(**served, path);
  if (const std::string& doubt = (*served)->calibration_doubt(); !doubt.empty()) {
    spdlog::error("what rests on the calibration is unknown, never free: {}", doubt);
  }
  LogRobotImages(**served, path, load);
  if (load.drawn) LogDrawn(**served, cell, *load.drawn);
  if (sound) {
    LogSound(**served, cell);
  } else {
    LogWithoutSound(**served, cell);
  }
  if (cell.separation) LogSeparation(**served, cell);
  Policy policy = cell.policy;
  if (cell.choose_preset) policy.preset = (*served)->BestPreset();
  if ((*served)->CanServe(policy).ok()) {
    const double least = IsSound(policy.preset) ? (*served)->sound()->space().least_obstacle() : 0;
    spdlog::info("preset '{}': {}", NameOf(policy.preset),
                 WhatIsMissed(policy, (*served)->views(), least));
  }
  if (cell.choose_preset) return served;
  const absl::Status servable = (*served)->CanServe(cell.policy);
  if (servable.ok()) return served;
  return absl::FailedPreconditionError(absl::StrCat("the cell file '", cell.file,
                                                    "' asks for what the database '", path,
                                                    "' cannot serve: ", servable.message()));
}

absl::Status MarginsKnown(const Cell& cell, const ServedDatabase& database) {
  const absl::Status& known = database.margins_known();
  if (known.ok()) return known;
  return absl::Status(known.code(), absl::StrCat(cell.file, ": ", known.message()));
}

}  // namespace silhouette
