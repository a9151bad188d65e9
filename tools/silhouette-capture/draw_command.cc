// SPDX-License-Identifier: Apache-2.0
// silhouette-capture draw: draws the robot images of the grid, or of a shard of it.
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "calib/camera/calibration.h"
#include "calib/files/calibration_message.h"
#include "calib/robot/drawing/drawn_kind.h"
#include "calib/robot/drawn_cell.h"
#include "calib/robot/drawn_digest.h"
#include "capture/session/drawn_images.h"
#include "capture/verification/verified_robot.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "db/store/collision_index.h"
#include "db/store/shards.h"
#include "tools/program/progress.h"
#include "tools/silhouette-capture/commands.h"
#include "tools/silhouette-capture/opened_cell.h"
#include "tools/silhouette-capture/run_plan.h"

namespace silhouette {
namespace {

constexpr char kDrawProgram[] = "silhouette-capture draw";

struct DrawOptions {
  CellArguments cell;
  std::string from;   // the database with the calibration; empty: that of the cell
  std::string shard;  // "3/8"; empty: all
  size_t threads = 0;
};

// The numbers of "3/8". InvalidArgument.
absl::StatusOr<std::pair<uint32_t, uint32_t>> ShardOf(const std::string& text) {
  if (text.empty()) return std::pair<uint32_t, uint32_t>(0, 1);
  const std::vector<std::string> parts = absl::StrSplit(text, '/');
  uint32_t shard = 0;
  uint32_t shards = 0;
  constexpr uint32_t kMostShards = 100'000;
  if (parts.size() != 2 || !absl::SimpleAtoi(parts[0], &shard) ||
      !absl::SimpleAtoi(parts[1], &shards) || shards > kMostShards || shard >= shards) {
    return InvalidArgument("--shard ", text,
                           ": state I/N, the shard and their number, with I from 0 to N - 1, such "
                           "as 0/8");
  }
  return std::pair(shard, shards);
}

// What a database has that is not drawn.
struct Given {
  std::optional<storage::v1::Calibration> calibration;
  std::optional<storage::v1::References> references;
  std::optional<storage::v1::ModelVerification> verification;
  bool has_drawn = false;
};

absl::StatusOr<Given> GivenIn(const Database& database) {
  ASSIGN_OR_RETURN(const Snapshot snapshot, database.Read());
  Given given;
  ASSIGN_OR_RETURN(given.calibration, snapshot.Calibration());
  ASSIGN_OR_RETURN(given.references, snapshot.References());
  ASSIGN_OR_RETURN(given.verification, snapshot.Verification());
  ASSIGN_OR_RETURN(const auto drawn, snapshot.DrawnImages());
  given.has_drawn = drawn.has_value();
  return given;
}

// The names of joints and views, in order, on which calibration, reference images and verification
// rest.
storage::v1::CellDescription JointsAndViews(const storage::v1::CellDescription& cell) {
  storage::v1::CellDescription named;
  for (const storage::v1::GridJoint& joint : cell.grid_joints()) {
    named.add_grid_joints()->set_name(joint.name());
  }
  for (const storage::v1::View& view : cell.views()) {
    storage::v1::View& of = *named.add_views();
    of.set_name(view.name());
    of.set_image_width(view.image_width());
    of.set_image_height(view.image_height());
  }
  return named;
}

// What the database of --from has. FailedPrecondition: its joints or views are not the cell's.
absl::StatusOr<Given> GivenFrom(const DrawOptions& options, const CellFile& file) {
  ASSIGN_OR_RETURN(const auto from, Database::Open(options.from, Database::Access::kRead));
  const std::vector<std::string> differences =
      Differences(JointsAndViews(DescriptionOf(file.cell)), "the cell file",
                  JointsAndViews(from->cell()), "the database");
  if (differences.empty()) return GivenIn(*from);
  return FailedPrecondition(
      "the database '", options.from, "' does not belong to the cell of '", file.cell.file,
      "': ", differences.front(),
      "; with --from name one that has the cell's joints and views in their order");
}

// What the database has, or the one that --from names.
absl::StatusOr<Given> FindGiven(const DrawOptions& options, const CellFile& file) {
  Given given;
  auto present = OpenDatabase(file, Database::Access::kRead);
  if (present.ok()) {
    ASSIGN_OR_RETURN(given, GivenIn(**present));
  } else if (!absl::IsNotFound(present.status())) {
    return present.status();
  }
  if (!options.from.empty()) {
    ASSIGN_OR_RETURN(Given other, GivenFrom(options, file));
    if (given.calibration && other.calibration &&
        given.calibration->SerializeAsString() != other.calibration->SerializeAsString()) {
      return FailedPrecondition("'", file.database, "' has another calibration than '",
                                options.from, "'; draw into a new database");
    }
    if (!given.calibration) given.calibration = std::move(other.calibration);
    if (!given.references) given.references = std::move(other.references);
    if (!given.verification) given.verification = std::move(other.verification);
  }
  if (given.calibration && !given.calibration->cameras().empty()) return given;
  return FailedPrecondition(
      "robot images can be drawn only with a calibration with camera models, which '",
      options.from.empty() ? file.database : options.from,
      "' does not have; name a database that has one with --from, or import it with "
      "'silhouette-db calibration import'");
}

// The robot as the server draws it: with the growth of its verification.
absl::StatusOr<VerifiedRobot> RobotOf(const CellFile& file, const DrawnCell& drawn,
                                      const Given& given) {
  ASSIGN_OR_RETURN(const Calibration calibration, CalibrationFrom(*given.calibration));
  std::vector<std::string> moving;
  for (const GridJoint& joint : file.cell.grid.joints()) moving.push_back(joint.name);
  std::vector<MaskSize> sizes;
  for (const ViewSettings& view : file.cell.views) sizes.push_back(view.mask_size);
  ASSIGN_OR_RETURN(DrawnRobot bare, DrawnRobotOf(drawn, moving, file.cell.fixed_joints, calibration,
                                                 sizes, file.cell.calibration.margin));
  return VerifiedRobotOf(drawn, std::move(bare), file.cell.grid.joints(), given.verification);
}

// For writing. One that has no drawn images yet gets what it lacks.
absl::StatusOr<std::unique_ptr<Database>> OpenTarget(const CellFile& file, const Given& given) {
  ASSIGN_OR_RETURN(auto database, OpenOrCreateDatabase(file));
  ASSIGN_OR_RETURN(const Given there, GivenIn(*database));
  if (there.has_drawn) return database;
  if (!there.calibration) {
    RETURN_IF_ERROR(database->SetCalibration(*given.calibration, kDrawProgram));
  }
  if (!there.references && given.references) {
    RETURN_IF_ERROR(database->SetReferences(*given.references, kDrawProgram));
  }
  if (!there.verification && given.verification) {
    RETURN_IF_ERROR(database->SetVerification(given.verification, kDrawProgram));
  }
  return database;
}

absl::StatusOr<DrawReport> DrawWithProgress(const DrawOptions& options, Database& database,
                                            const storage::v1::DrawnImages& drawn,
                                            const DrawMasks& draw) {
  std::optional<Progress> progress;
  DrawSettings settings{.program = kDrawProgram, .progress = [&](const DrawReport& so_far) {
                          if (!progress) {
                            progress.emplace("robot images", so_far.configurations,
                                             "configurations");
                          }
                          progress->Update(so_far.kept + so_far.drawn, so_far.kept);
                          return !StopRequested();
                        }};
  if (options.threads > 0) settings.most_threads = options.threads;
  return DrawInto(database, drawn, draw, settings);
}

// The database of the images of that kind: of nodes a variant of its own.
absl::StatusOr<std::unique_ptr<Database>> DatabaseOf(Database& whole, DrawnKind kind) {
  if (kind == DrawnKind::kWhole) return whole.OpenVariant(whole.variant());
  auto variant = whole.OpenVariant(NameOf(kind));
  if (!absl::IsNotFound(variant.status())) return variant;
  return whole.CreateVariant(NameOf(kind), kDrawProgram);
}

// Draws all that the cell's grid needs. `drawn`: gets the digest of what was drawn last.
absl::StatusOr<DrawReport> DrawKinds(const DrawOptions& options, Database& database,
                                     const DrawnRobot& robot, const JointRegions& forbidden,
                                     storage::v1::DrawnImages& drawn) {
  const ConfigurationGrid& grid = database.grid();
  DrawReport all;
  for (const DrawnKind kind : KindsFor(grid)) {
    const auto as_kind = std::make_shared<const DrawnRobot>(AsKind(robot, grid, kind));
    drawn.set_digest(DigestOf(*as_kind));
    ASSIGN_OR_RETURN(const auto variant, DatabaseOf(database, kind));
    const DrawMasks draw = kind == DrawnKind::kWhole ? WholeRobot(as_kind, forbidden)
                                                     : ArmNodes(as_kind, grid, forbidden);
    ASSIGN_OR_RETURN(const DrawReport report, DrawWithProgress(options, *variant, drawn, draw));
    all.configurations += report.configurations;
    all.kept += report.kept;
    all.drawn += report.drawn;
    all.damaged += report.damaged;
    all.excluded += report.excluded;
    all.stopped = report.stopped;
    if (all.stopped) break;
  }
  return all;
}

absl::StatusOr<IndexBuildReport> IndexWithProgress(const DrawOptions& options, Database& database) {
  std::optional<Progress> progress;
  IndexBuildOptions build{.progress = [&](uint64_t done, uint64_t tiles) {
    if (!progress) progress.emplace("collision index", tiles, "tiles");
    progress->Update(done);
    return !StopRequested();
  }};
  if (options.threads > 0) build.threads = static_cast<int>(options.threads);
  return BuildCollisionIndex(database, build);
}

// InvalidArgument: nothing is drawn of the cell.
absl::StatusOr<DrawnCell> CellToDraw(const CellFile& file) {
  ASSIGN_OR_RETURN(std::optional<DrawnCell> cell, DrawnCellOf(file.cell));
  if (!cell) {
    return InvalidArgument("'", file.cell.file,
                           "' says that robot images are captured; state 'images: drawn' of the "
                           "robot to draw them");
  }
  if (file.cell.grid_move == 0) {
    return InvalidArgument("'", file.cell.file,
                           "' states no grid whose images could be drawn; state 'grid', with "
                           "max_move or steps");
  }
  return *std::move(cell);
}

nlohmann::ordered_json DrawnJson(const CellFile& file, const storage::v1::DrawnImages& drawn,
                                 const DrawReport& report, bool verified, absl::Duration took) {
  return {{"database", file.database},
          {"shard", drawn.shard()},
          {"shards", drawn.shards()},
          {"configurations", report.configurations},
          {"drawn", report.drawn},
          {"kept", report.kept},
          {"damaged", report.damaged},
          {"excluded", report.excluded},
          {"digest", drawn.digest()},
          {"verified", verified},
          {"seconds", absl::ToDoubleSeconds(took)}};
}

std::string DrawnText(const storage::v1::DrawnImages& drawn, const DrawReport& report,
                      absl::Duration took) {
  std::string text = absl::StrFormat(
      "configurations     %d%s\n"
      "drawn              %d, %d of them excluded, in %s\n"
      "there already      %d\n",
      report.configurations, drawn.shards() > 1 ? absl::StrCat(", shard ", NameOfShard(drawn)) : "",
      report.drawn, report.excluded, Spoken(took), report.kept);
  if (report.damaged > 0) {
    absl::StrAppend(&text, "damaged            ", report.damaged, ", drawn again\n");
  }
  return text;
}

absl::StatusOr<ExitCode> DrawHere(const DrawOptions& options) {
  const absl::Time start = absl::Now();
  ASSIGN_OR_RETURN(const auto shard, ShardOf(options.shard));
  ASSIGN_OR_RETURN(const CellFile file, OpenCellFile(options.cell));
  ASSIGN_OR_RETURN(const DrawnCell cell, CellToDraw(file));
  ASSIGN_OR_RETURN(const Given given, FindGiven(options, file));
  ASSIGN_OR_RETURN(VerifiedRobot verified, RobotOf(file, cell, given));
  if (!verified.unverified.empty()) {
    std::cerr << "the robot's model is not verified: " << verified.unverified << std::endl;
  }
  storage::v1::DrawnImages drawn;
  drawn.set_forbidden(cell.forbidden_text);
  drawn.set_tolerance(cell.parts.tolerance);
  drawn.set_shard(shard.first);
  drawn.set_shards(shard.second);
  ASSIGN_OR_RETURN(const auto database, OpenTarget(file, given));

  CatchStopSignals();
  ASSIGN_OR_RETURN(const DrawReport report,
                   DrawKinds(options, *database, verified.robot, cell.forbidden, drawn));
  std::optional<IndexBuildReport> index;
  if (!report.stopped) {
    ASSIGN_OR_RETURN(index, IndexWithProgress(options, *database));
  }
  const absl::Duration took = absl::Now() - start;
  nlohmann::ordered_json json = DrawnJson(file, drawn, report, verified.unverified.empty(), took);
  std::string text = DrawnText(drawn, report, took);
  const bool complete = index && !index->stopped;
  if (index) {
    json["collision_index"] = IndexJson(*index);
    text += IndexText(*index);
  }
  const std::string again = absl::StrCat(options.cell.Command("draw"),
                                         options.shard.empty() ? "" : " --shard " + options.shard);
  if (!complete) json["next"] = again;
  PrintResult(options.cell.format, json, text);
  if (complete) return kDone;
  std::cerr << "stopped; what was drawn is stored; go on with: " << again << std::endl;
  return kNo;
}

}  // namespace

void AddDraw(CLI::App& app, Work& work) {
  CLI::App* command = app.add_subcommand(
      "draw",
      "Draws the robot images of the grid from the robot's model and the cameras' models, and\n"
      "builds their collision index: the server's map of a cell with 'images: drawn' comes from\n"
      "it. Safe to interrupt: run the same command again to resume.");
  command->footer(
      "Examples:\n"
      "  silhouette-capture draw --cell cell.yaml --from cell.lmdb --database drawn.lmdb\n"
      "  silhouette-capture draw --cell cell.yaml --from cell.lmdb --database s3.lmdb --shard 3/8\n"
      "  silhouette-db merge s0.lmdb s1.lmdb ... --into drawn.lmdb");
  const auto options = std::make_shared<DrawOptions>();
  AddCellOptions(*command, options->cell);
  command->add_option("--from", options->from,
                      "A database with the calibration and the reference images; default: the "
                      "cell's own");
  command->add_option("--shard", options->shard,
                      "I/N: only shard I (0 to N - 1) of N, into a database of its own");
  command->add_option("--threads", options->threads, "How many threads; default: one a processor")
      ->check(PositiveNumber());
  command->callback([options, &work] { work = [options] { return DrawHere(*options); }; });
}

}  // namespace silhouette
