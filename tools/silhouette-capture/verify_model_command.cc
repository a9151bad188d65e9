// SPDX-License-Identifier: Apache-2.0
// silhouette-capture verify-model: compares the model that robot images are drawn from with
// captured ones.
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "calib/files/calibration_message.h"
#include "calib/robot/drawn_digest.h"
#include "capture/session/reference_images.h"
#include "capture/verification/kept_samples.h"
#include "capture/verification/model_comparison.h"
#include "capture/verification/samples.h"
#include "capture/verification/verified_robot.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/cell/devices/cell_devices.h"
#include "tools/cell/devices/stop_command.h"
#include "tools/program/progress.h"
#include "tools/silhouette-capture/commands.h"
#include "tools/silhouette-capture/opened_cell.h"
#include "tools/silhouette-capture/verify_model_report.h"

namespace silhouette {
namespace {

constexpr char kVerifyModelProgram[] = "silhouette-capture verify-model";

absl::StatusOr<ModelOfCell> ModelOf(const VerifyModelOptions& options, const CellFile& file) {
  ASSIGN_OR_RETURN(std::optional<DrawnCell> drawn, DrawnCellOf(file.cell));
  if (!drawn) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", file.cell.file,
                     "' says that the robot's images are captured: there is no model to verify; "
                     "state 'images: drawn' of the robot to have them drawn"));
  }
  auto database = OpenDatabase(file, Database::Access::kWrite);
  if (absl::IsNotFound(database.status())) {
    return absl::NotFoundError(
        absl::StrCat("there is no database in '", file.database,
                     "' yet, and no reference images of the empty cell; take them first with: ",
                     options.cell.Command("reference")));
  }
  if (!database.ok()) return database.status();
  ASSIGN_OR_RETURN(const Snapshot snapshot, (*database)->Read());
  ASSIGN_OR_RETURN(const auto stored, snapshot.Calibration());
  std::optional<Calibration> calibration;
  if (stored) {
    ASSIGN_OR_RETURN(calibration, CalibrationFrom(*stored));
  }
  ASSIGN_OR_RETURN(DrawnRobot bare,
                   BareRobotOf(*drawn, **database, calibration, file.cell.calibration.margin));
  std::vector<std::string> links;
  for (const RobotLink& link : drawn->robot->links()) links.push_back(link.name);
  std::vector<std::string> views;
  for (const auto& view : (*database)->cell().views()) views.push_back(view.name());
  return ModelOfCell{*std::move(database), *std::move(drawn), std::move(bare), std::move(links),
                     std::move(views)};
}

absl::StatusOr<std::vector<std::pair<size_t, size_t>>> NotChecked(const VerifyModelOptions& options,
                                                                  const ModelOfCell& model) {
  const auto index = [&](const std::string& name) -> absl::StatusOr<size_t> {
    const auto found = std::ranges::find(model.links, name);
    if (found != model.links.end()) return static_cast<size_t>(found - model.links.begin());
    return absl::InvalidArgumentError(absl::StrCat("--not-checked: the robot has no link '", name,
                                                   "'; its links are '",
                                                   absl::StrJoin(model.links, "', '"), "'"));
  };
  std::vector<std::pair<size_t, size_t>> pairs;
  for (const auto& [first, second] : options.not_checked) {
    ASSIGN_OR_RETURN(const size_t a, index(first));
    ASSIGN_OR_RETURN(const size_t b, index(second));
    pairs.emplace_back(a, b);
  }
  return pairs;
}

// Where driven configurations are kept until all are compared, and from then on.
std::string UnfinishedSamples(const CellFile& file) {
  return BesideDatabase(file.database, ".verification.part");
}
std::string ComparedSamples(const CellFile& file) {
  return BesideDatabase(file.database, ".verification");
}

// Those of a drive that ended early.
absl::StatusOr<std::vector<ModelSample>> SamplesOfBefore(const VerifyModelOptions& options,
                                                         const CellFile& file,
                                                         const ModelOfCell& model,
                                                         const Database& kept) {
  ASSIGN_OR_RETURN(const Snapshot snapshot, kept.Read());
  if (snapshot.size() == 0) return std::vector<ModelSample>();
  ASSIGN_OR_RETURN(std::vector<ModelSample> samples,
                   SamplesIn(kept, model.database->cell(), options.sample,
                             file.cell.server.scene.fixed_joint_tolerance, options.seed));
  std::cerr << "going on from " << samples.size() << " configurations in '" << kept.path()
            << "'; if robot, cell or cameras changed since, move that folder away, and drive again"
            << std::endl;
  return samples;
}

// By driving the robot; `samples` has those that were taken, however it ends.
absl::Status DriveToSamples(const VerifyModelOptions& options, const CellFile& file,
                            const ModelOfCell& model, std::vector<ModelSample>& samples) {
  if (!file.cell.workspace) {
    return absl::InvalidArgumentError(absl::StrCat(
        file.cell.file,
        ": state 'workspace', the box that the robot must not leave while it is driven to "
        "configurations by chance: floor, walls and what stands about it are not in its model; or "
        "compare with captured images: --captured DATABASE"));
  }
  SamplerSettings settings{.tolerance = model.cell.parts.tolerance};
  ASSIGN_OR_RETURN(settings.not_checked, NotChecked(options, model));
  const Travel travel(file.cell.grid, file.cell.capture.forbidden_regions);
  ASSIGN_OR_RETURN(const auto devices, OpenDevices(file.cell, travel, file.variant));
  const storage::v1::CellDescription& cell = model.database->cell();
  ASSIGN_OR_RETURN(CellRobot robot, CellRobot::Create(cell, *devices.robot));
  ASSIGN_OR_RETURN(CellCameras cameras,
                   CellCameras::Create(cell, *devices.cameras, file.cell.capture.noisy_views));
  absl::StatusOr<std::vector<Reference>> references = ReadReferences(*model.database);
  if (absl::IsNotFound(references.status())) {
    return absl::NotFoundError(
        absl::StrCat(references.status().message(),
                     "; take them first with: ", options.cell.Command("reference")));
  }
  if (!references.ok()) return references.status();
  SessionParts parts{.database = model.database.get(),
                     .travel = &travel,
                     .robot = std::move(robot),
                     .cameras = std::move(cameras),
                     .references = *std::move(references),
                     .settings = file.cell.capture,
                     .segmentation = file.cell.segmentation};
  ASSIGN_OR_RETURN(auto kept,
                   OpenKeptSamples(UnfinishedSamples(file), *model.database, kVerifyModelProgram));
  ASSIGN_OR_RETURN(samples, SamplesOfBefore(options, file, model, *kept));
  // Not to the same configurations again.
  const uint64_t seed = options.seed + samples.size();
  ModelSampler sampler(model.bare, travel.grid().joints(), *file.cell.workspace,
                       model.cell.forbidden, settings, seed);
  std::optional<Progress> progress;
  progress.emplace("images", options.sample, "configurations");
  CaptureObserver observer;
  const uint64_t before = samples.size();
  observer.progress = [&](uint64_t done) { progress->Update(done, before); };
  observer.say = [&](const std::string& line) { progress->Say(line); };
  observer.stop_requested = StopRequested;
  const HaltOnSignals halt(StopCommandTo(*devices.robot));
  const absl::Status status = TakeSamples(parts, sampler, model.links, options.sample,
                                          kVerifyModelProgram, *kept, samples, observer);
  kept.reset();
  if (samples.empty()) RemoveDatabase(UnfinishedSamples(file));
  return status;
}

// Says how to go on with what is kept.
void TellKept(const VerifyModelOptions& options, const CellFile& file, size_t kept) {
  if (kept == 0) return;
  std::cerr << kept << " of " << options.sample << " configurations are kept in '"
            << UnfinishedSamples(file) << "'; go on with: " << Again(options, options.sample)
            << std::endl;
}

absl::StatusOr<std::vector<ModelSample>> StoredSamples(const VerifyModelOptions& options,
                                                       const CellFile& file,
                                                       const ModelOfCell& model) {
  ASSIGN_OR_RETURN(const auto captured, Database::Open(options.captured, Database::Access::kRead));
  return SamplesIn(*captured, model.database->cell(), options.sample,
                   file.cell.server.scene.fixed_joint_tolerance, options.seed);
}

// Whether the masks that were compared may hold the robot's shadow.
absl::StatusOr<bool> MayHoldShadows(const VerifyModelOptions& options, const CellFile& file) {
  if (options.captured.empty()) return file.cell.segmentation.shadows == Shadows::kForeground;
  ASSIGN_OR_RETURN(const auto captured, Database::Open(options.captured, Database::Access::kRead));
  return !absl::StrContains(captured->cell().segmentation(), "shadows: ignore");
}

storage::v1::ModelVerification VerificationOf(const ModelOfCell& model,
                                              const ModelComparison& found, size_t configurations,
                                              const ComparisonSettings& settings) {
  storage::v1::ModelVerification verification;
  verification.mutable_time()->set_seconds(absl::ToUnixSeconds(absl::Now()));
  verification.set_digest(DigestOf(model.bare));
  for (size_t link = 0; link < model.links.size(); ++link) {
    storage::v1::LinkGrowth& growth = *verification.add_link_growth();
    growth.set_link(model.links[link]);
    growth.set_growth(found.links[link].growth);
  }
  verification.set_configurations(static_cast<uint32_t>(configurations));
  verification.set_held_out_masks(static_cast<uint32_t>(found.held_out_masks));
  verification.set_held_out_missing(static_cast<uint32_t>(found.held_out_missing));
  verification.set_additional(found.additional);
  for (size_t view = 0; view < model.views.size(); ++view) {
    const ComparedView& compared = found.views[view];
    storage::v1::ViewAgreement& agreement = *verification.add_views();
    agreement.set_view(model.views[view]);
    agreement.set_strays(ShareOf(compared.noise, compared.captured));
    agreement.set_uncaptured(ShareOf(compared.uncaptured, compared.certain));
    agreement.set_shift_x(compared.mean_shift.x());
    agreement.set_shift_y(compared.mean_shift.y());
    agreement.set_shift(compared.mean_amount);
  }
  verification.set_settings(Describe(settings));
  for (const GridJoint& joint : model.database->grid().joints()) {
    storage::v1::VerifiedRange& range = *verification.add_ranges();
    range.set_joint(joint.name);
    range.set_lower(joint.lower);
    range.set_upper(joint.upper);
  }
  return verification;
}

// Says why.
absl::StatusOr<ExitCode> RefuseModel(const VerifyModelOptions& options, const CellFile& file,
                                     Database& database, const ModelComparison& found,
                                     size_t configurations) {
  ASSIGN_OR_RETURN(const Snapshot snapshot, database.Read());
  const auto before = snapshot.Verification();
  if (!before.ok() || *before) {
    RETURN_IF_ERROR(database.SetVerification(std::nullopt, kVerifyModelProgram));
    std::cerr << "the verification that the database had is removed\n";
  }
  for (const std::string& fault : found.faults) std::cerr << "not verified: " << fault << "\n";
  if (found.enough > 0) {
    std::cerr << LargerSample(options, found, configurations) << "\n";
  }
  const bool unreached =
      std::ranges::any_of(found.views, [](const ComparedView& view) { return view.unreached > 0; });
  ASSIGN_OR_RETURN(const bool shadows, MayHoldShadows(options, file));
  if (unreached && shadows) {
    std::cerr
        << "captured masks may hold the robot's shadow, which drawn ones lack: light the cell "
           "diffusely, or state 'segmentation: {shadows: ignore}' in the cell file, and make "
           "the masks again\n";
  }
  std::cerr << std::flush;
  return kNo;
}

absl::StatusOr<ExitCode> CompareSamples(const VerifyModelOptions& options, const CellFile& file,
                                        const ModelOfCell& model,
                                        const std::vector<ModelSample>& samples) {
  const ComparisonSettings& settings = file.cell.verification;
  std::optional<Progress> progress;
  progress.emplace("comparison", 2 * samples.size() * model.views.size(), "masks");
  const ModelComparison found =
      CompareModel(model.bare, model.database->grid().joints(), model.links, model.views, samples,
                   settings, [&](uint64_t done) { progress->Update(done); });
  progress.reset();
  const std::string picture = options.picture.empty()
                                  ? BesideDatabase(file.database, ".verification.png")
                                  : options.picture;
  RETURN_IF_ERROR(WriteWorst(model, found, samples, picture));
  nlohmann::ordered_json json = ComparisonJson(model, found, samples.size());
  json["picture"] = picture;
  PrintResult(
      options.cell.format, json,
      absl::StrCat(ComparisonText(options, model, found, samples.size()), "worst masks        ",
                   picture, "\n", found.faults.empty() ? "the model is verified\n" : ""));
  if (!found.faults.empty()) {
    return RefuseModel(options, file, *model.database, found, samples.size());
  }
  RETURN_IF_ERROR(model.database->SetVerification(
      VerificationOf(model, found, samples.size(), settings), kVerifyModelProgram));
  return kDone;
}

// Driven configurations that were compared make room for those of the next drive.
absl::Status FinishSamples(const CellFile& file) {
  const std::string compared = ComparedSamples(file);
  RemoveDatabase(compared);
  std::error_code error;
  std::filesystem::rename(UnfinishedSamples(file), compared, error);
  if (!error) return absl::OkStatus();
  return absl::InternalError(absl::StrCat(
      "'", UnfinishedSamples(file), "' cannot be renamed: ", error.message(), "; move it away"));
}

absl::StatusOr<ExitCode> DriveAndCompare(const VerifyModelOptions& options, const CellFile& file,
                                         const ModelOfCell& model) {
  std::vector<ModelSample> samples;
  absl::Status status = DriveToSamples(options, file, model, samples);
  if (absl::IsCancelled(status) || (status.ok() && samples.size() < options.sample)) {
    std::cerr << "stopped; nothing was verified" << std::endl;
    TellKept(options, file, samples.size());
    return kNo;
  }
  absl::StatusOr<ExitCode> code = kNo;
  if (status.ok()) {
    code = CompareSamples(options, file, model, samples);
  } else {
    code = std::move(status);
  }
  if (code.ok()) {
    RETURN_IF_ERROR(FinishSamples(file));
    return code;
  }
  const ExitCode failed = Report("silhouette-capture", code.status());
  TellKept(options, file, samples.size());
  return failed;
}

absl::StatusOr<ExitCode> VerifyModelRun(const VerifyModelOptions& options) {
  ASSIGN_OR_RETURN(const CellFile file, OpenCellFile(options.cell));
  ASSIGN_OR_RETURN(const ModelOfCell model, ModelOf(options, file));
  CatchStopSignals();
  if (options.captured.empty()) return DriveAndCompare(options, file, model);
  ASSIGN_OR_RETURN(const std::vector<ModelSample> samples, StoredSamples(options, file, model));
  if (StopRequested()) {
    std::cerr << "stopped; nothing was verified" << std::endl;
    return kNo;
  }
  return CompareSamples(options, file, model, samples);
}

}  // namespace

void AddVerifyModel(CLI::App& app, Work& work) {
  CLI::App* command = app.add_subcommand(
      "verify-model",
      "Compares the model that robot images are drawn from with captured ones, finds by how much\n"
      "each link must grow to hold them (cables, hoses, tools), and stores that in the database.\n"
      "Drives the robot to configurations by chance, straight from one to the next, within\n"
      "'workspace' and past itself and the forbidden regions; or takes those of a database.\n"
      "Refuses a model that is wrong, and says which link, view or joint.");
  command->footer(
      "Examples:\n"
      "  silhouette-capture verify-model --cell cell.yaml --database cell.lmdb\n"
      "  silhouette-capture verify-model --cell cell.yaml --database cell.lmdb --captured "
      "old.lmdb\n"
      "Exit codes: 0 verified; 1 not verified, or stopped; 2 wrong arguments or files; 3 a device "
      "or "
      "the disk failed.");
  const auto options = std::make_shared<VerifyModelOptions>();
  AddCellOptions(*command, options->cell);
  command->add_option("--sample", options->sample, "Configurations that are compared")
      ->capture_default_str()
      ->check(CLI::Range(2, 1'000'000));
  command->add_option("--captured", options->captured,
                      "A database with captured robot images of the same cell: nothing is driven");
  AddPictureOption(*command, options->picture,
                   "PNG of the worst masks; default: beside the database (.verification.png)");
  command->add_option("--seed", options->seed, "Of the choice of configurations")
      ->capture_default_str();
  command->add_option(
      "--not-checked", options->not_checked,
      "Two links that touch by the model, but cannot on the robot: their distance is not checked\n"
      "while the robot is driven. Repeat for more pairs");
  command->callback([options, &work] { work = [options] { return VerifyModelRun(*options); }; });
}

}  // namespace silhouette
