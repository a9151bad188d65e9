// SPDX-License-Identifier: Apache-2.0
// silhouette-capture reference: takes the images of the empty cell.
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "capture/session/reference_images.h"
#include "common/picture/picture.h"
#include "common/picture/sheet.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "db/store/schema.h"
#include "tools/cell/devices/cell_devices.h"
#include "tools/cell/devices/stop_command.h"
#include "tools/program/progress.h"
#include "tools/silhouette-capture/commands.h"
#include "tools/silhouette-capture/opened_cell.h"
#include "tools/silhouette-capture/robot_in_reference.h"

namespace silhouette {
namespace {

constexpr char kReferenceProgram[] = "silhouette-capture reference";
// Mean noise, in grey levels, that no camera has by itself.
constexpr double kMostNoise = 8;

// More of the image than this, and the light or the exposure should be looked at.
constexpr double kMostSaturated = 0.005;
constexpr double kMostUnsteady = 0.01;

double ReferenceShare(int pixels, const Reference& reference) {
  return static_cast<double>(pixels) / reference.size().area();
}

// What the person in front of the cell should know of a view; empty: nothing.
std::string RemarksOn(const Reference& reference) {
  const Reference::Figures figures = reference.Describe();
  std::string remarks;
  if (figures.mean_noise > kMostNoise) {
    absl::StrAppend(&remarks, "  - did something move? Then take them again");
  }
  if (figures.undefined > 0) {
    absl::StrAppend(
        &remarks,
        absl::StrFormat("  - %d pixels (%.1f %%) never showed the cell without the robot; "
                        "they count as covered by it, always",
                        figures.undefined, 100 * ReferenceShare(figures.undefined, reference)));
  }
  if (ReferenceShare(figures.saturated, reference) > kMostSaturated) {
    absl::StrAppend(&remarks,
                    absl::StrFormat("  - %.1f %% of the pixels are as bright as can be and "
                                    "show nothing that is brighter; shorten the exposure",
                                    100 * ReferenceShare(figures.saturated, reference)));
  }
  if (ReferenceShare(figures.unsteady, reference) > kMostUnsteady) {
    absl::StrAppend(&remarks, absl::StrFormat("  - %.1f %% of the pixels flicker and show little",
                                              100 * ReferenceShare(figures.unsteady, reference)));
  }
  return remarks;
}

// What is to be done next: no run captures what is drawn, and a model that is verified stays so.
std::string NextCommand(const CellArguments& arguments, const CellFile& file,
                        const Database& database, const Snapshot& snapshot) {
  if (!file.cell.robot.drawn) return arguments.Command("run");
  if (!HasCameraModels(snapshot)) return ImportCamerasCommand(file);
  return HasVerifiedModel(file.cell, database, snapshot) ? "" : arguments.Command("verify-model");
}

// `images`: taken of each view. `not_looked_for`: what may be in them unnoticed; empty: nothing.
std::string ReferenceText(const CellArguments& arguments, const CellFile& file, int images,
                          uint64_t robot_images, const std::string& next,
                          const std::vector<Reference>& references,
                          const std::string& not_looked_for) {
  std::string text =
      absl::StrFormat("reference images in %s: %d per view\n", file.database, images);
  text += "view                  image       noise, grey levels\n";
  for (size_t v = 0; v < references.size(); ++v) {
    const cv::Size size = references[v].size();
    absl::StrAppendFormat(&text, "  %-18s  %-10s  %.2f%s\n", file.cell.views[v].name,
                          absl::StrFormat("%dx%d", size.width, size.height),
                          references[v].Describe().mean_noise, RemarksOn(references[v]));
  }
  if (robot_images > 0) {
    absl::StrAppendFormat(&text,
                          "the %d existing records were made with the previous reference images\n",
                          robot_images);
  }
  if (!not_looked_for.empty()) {
    absl::StrAppend(&text, "not looked for: ", not_looked_for,
                    "; make sure that no view shows them, as they would be part of the empty "
                    "cell\n");
  }
  if (next.empty()) {
    return absl::StrCat(
        text, "the robot's model is verified; if what it carries or the cameras changed: ",
        arguments.Command("verify-model"), "\n");
  }
  return absl::StrCat(text, "next: ", next, "\n");
}

nlohmann::ordered_json ReferenceJson(const CellFile& file, int images, const std::string& next,
                                     const std::vector<Reference>& references,
                                     const std::string& not_looked_for) {
  nlohmann::ordered_json json = {{"database", file.database},
                                 {"images", images},
                                 {"views", nlohmann::ordered_json::array()},
                                 {"not_looked_for", not_looked_for},
                                 {"next", next}};
  for (size_t v = 0; v < references.size(); ++v) {
    const Reference::Figures figures = references[v].Describe();
    json["views"].push_back({{"name", file.cell.views[v].name},
                             {"colour", references[v].channels() == 3},
                             {"noise", figures.mean_noise},
                             {"undefined", ReferenceShare(figures.undefined, references[v])},
                             {"saturated", ReferenceShare(figures.saturated, references[v])},
                             {"unsteady", ReferenceShare(figures.unsteady, references[v])}});
  }
  return json;
}

// The views in which something is that should not be there, it in colour.
absl::Status WriteMarked(const CellFile& file, const std::vector<MovedInView>& views,
                         const std::string& title, const std::string& path) {
  std::vector<CaptionedPicture> pictures;
  for (const MovedInView& view : views) {
    const cv::Mat image = view.image.isContinuous() ? view.image : view.image.clone();
    Picture picture =
        PictureOfPixels(image.cols, image.rows, image.channels(),
                        {image.data, image.total() * static_cast<size_t>(image.channels())});
    Picture marked = picture.clone();
    marked.setTo(BgrOf(palette::kObstacle), view.moved);
    cv::addWeighted(picture, 0.4, marked, 0.6, 0, picture);
    pictures.push_back({picture, absl::StrFormat("%s: %d pixels", file.cell.views[view.view].name,
                                                 cv::countNonZero(view.moved))});
  }
  return WritePng(path, ContactSheet(pictures, {.title = title, .columns = 0, .legend = {}}));
}

std::string NamesOf(const CellFile& file, const std::vector<MovedInView>& views) {
  std::vector<std::string> names;
  for (const MovedInView& view : views) names.push_back(file.cell.views[view.view].name);
  return absl::StrCat("'", absl::StrJoin(names, "', '"), "'");
}

// Says so.
absl::StatusOr<ExitCode> RefuseMoved(const CellArguments& arguments, const CellFile& file,
                                     const std::vector<MovedInView>& moved) {
  const std::string picture = BesideDatabase(file.database, ".moved.png");
  RETURN_IF_ERROR(WriteMarked(file, moved, "Moved while reference images were taken", picture));
  std::cerr << "silhouette-capture: something moved in " << NamesOf(file, moved)
            << " while the reference images were taken (see " << picture
            << "); no reference images were stored. The robot, or a person, would be part of the "
               "empty cell: take them out of all views, then: "
            << arguments.Command("reference")
            << " (with --accept-motion where something always moves, such as a screen)"
            << std::endl;
  return kNo;
}

absl::StatusOr<ExitCode> RefuseRobot(const CellArguments& arguments, const CellFile& file,
                                     const std::vector<MovedInView>& robot) {
  const std::string picture = BesideDatabase(file.database, ".robot.png");
  RETURN_IF_ERROR(WriteMarked(file, robot, "The robot's outline by its joint values", picture));
  std::cerr << "silhouette-capture: the robot stands in " << NamesOf(file, robot) << " (see "
            << picture
            << "); no reference images were stored, as it would be part of the empty cell. Take it "
               "out of all views, or, where it cannot leave: "
            << arguments.Command("reference")
            << " --with-robot (--accept-robot: it is not there, and what looks like its outline is "
               "the cell's)"
            << std::endl;
  return kNo;
}

// What may stand in reference images unnoticed. `robot`: why it, too; empty: it does not.
std::string NotLookedFor(const std::string& robot) {
  return absl::StrCat("people and things that stand still",
                      robot.empty() ? "" : absl::StrCat(", and the robot (", robot, ")"));
}

struct ReferenceArguments {
  CellArguments cell;
  bool with_robot = false;
  bool accept_motion = false;
  bool accept_robot = false;
  int images = 0;  // 0: as the cell's file says; with the robot kImagesWithRobot
};

constexpr int kImagesWithRobot = 40;

// `travel`: made where the robot is driven.
absl::StatusOr<CellDevices> DevicesFor(const ReferenceArguments& options, const Cell& cell,
                                       std::optional<Travel>& travel) {
  if (!options.with_robot) {
    CellDevices devices;
    ASSIGN_OR_RETURN(devices.cameras, OpenCamerasOfEmptyCell(cell));
    return devices;
  }
  if (!StatesAGrid(cell)) {
    return InvalidArgument(options.cell.cell,
                           ": without a grid of all joints that move --with-robot would drive them "
                           "to their limits; state one, or take the robot out of all views");
  }
  travel.emplace(cell.grid, cell.capture.forbidden_regions);
  return OpenDevices(cell, *travel, schema::kDefaultVariant);
}

// By driving the robot if there is a `travel`; else `moved` gets the views in which something
// moved.
absl::StatusOr<storage::v1::References> TakeSets(const CellFile& file, Database& database,
                                                 const std::optional<Travel>& travel,
                                                 CellDevices& devices,
                                                 std::vector<MovedInView>& moved) {
  const int count = file.cell.capture.reference_images;
  std::optional<Progress> progress;
  progress.emplace("reference images", count, "sets");
  CaptureObserver observer;
  observer.progress = [&](uint64_t done) { progress->Update(done); };
  observer.say = [&](const std::string& line) { progress->Say(line); };
  observer.stop_requested = StopRequested;
  if (travel) {
    const HaltOnSignals halt(StopCommandTo(*devices.robot));
    return TakeReferencesWithRobot(database, *travel, *devices.robot, *devices.cameras,
                                   file.cell.capture, count, observer);
  }
  ASSIGN_OR_RETURN(auto cameras, CellCameras::Create(database.cell(), *devices.cameras,
                                                     file.cell.capture.noisy_views));
  return TakeReferences(cameras, count, observer, &moved);
}

absl::StatusOr<ExitCode> ReferenceRun(const ReferenceArguments& options) {
  const CellArguments& arguments = options.cell;
  ASSIGN_OR_RETURN(CellFile file, OpenCellFile(arguments));
  std::optional<Travel> travel;
  ASSIGN_OR_RETURN(CellDevices devices, DevicesFor(options, file.cell, travel));
  ASSIGN_OR_RETURN(auto database, OpenOrCreateDatabase(file));
  int& count = file.cell.capture.reference_images;
  if (options.with_robot) count = kImagesWithRobot;
  if (options.images > 0) count = options.images;

  CatchStopSignals();
  std::vector<MovedInView> moved;
  const auto taken = TakeSets(file, *database, travel, devices, moved);
  if (absl::IsCancelled(taken.status())) {
    std::cerr << taken.status().message() << "; take them with: " << arguments.Command("reference")
              << std::endl;
    return kNo;
  }
  if (!taken.ok()) return taken.status();
  if (!moved.empty() && !options.accept_motion) return RefuseMoved(arguments, file, moved);
  RobotInReference robot{.views = {}, .not_looked_for = "--accept-robot"};
  if (!options.with_robot && !options.accept_robot) {
    ASSIGN_OR_RETURN(robot, FindRobot(file.cell, *database, *taken));
    if (!robot.views.empty()) return RefuseRobot(arguments, file, robot.views);
  }
  const std::string not_looked_for = options.with_robot ? "" : NotLookedFor(robot.not_looked_for);
  ASSIGN_OR_RETURN(const auto snapshot, database->Read());
  RETURN_IF_ERROR(database->SetReferences(*taken, kReferenceProgram));
  ASSIGN_OR_RETURN(const auto references, ReadReferences(*database));
  const std::string next = NextCommand(arguments, file, *database, snapshot);
  const int images = taken->views(0).images();
  PrintResult(
      arguments.format, ReferenceJson(file, images, next, references, not_looked_for),
      ReferenceText(arguments, file, images, snapshot.size(), next, references, not_looked_for));
  return kDone;
}

}  // namespace

void AddReference(CLI::App& app, Work& work) {
  CLI::App* command = app.add_subcommand(
      "reference",
      "Takes the reference images: what the cameras see of the cell without the robot.\n"
      "Makes the database if it is not there. A simulated robot is taken out of the cell;\n"
      "take a real one out of all views yourself. Where it cannot leave: --with-robot.\n"
      "Refuses (exit code 1, with a picture) if something moves, or if the robot is in a view by\n"
      "its joint values, its model and the camera models.");
  command->footer(
      "Example:\n  silhouette-capture reference --cell cell.yaml --database cell.lmdb\n"
      "  silhouette-capture reference --cell cell.yaml --with-robot --images 60");
  const auto arguments = std::make_shared<ReferenceArguments>();
  AddCellOptions(*command, arguments->cell);
  command->add_flag("--with-robot", arguments->with_robot,
                    "Drive the robot to configurations spread over the grid, one set of images at "
                    "each, and\nuse what is seen where the robot is not");
  command->add_flag("--accept-motion", arguments->accept_motion,
                    "Store them although something moved in a view, such as a screen or a fan.\n"
                    "Make sure that neither the robot nor a person is in any view");
  command->add_flag("--accept-robot", arguments->accept_robot,
                    "Store them although the image has edges where the robot's outline would be by "
                    "its joint values.\nMake sure that the robot is in no view");
  command
      ->add_option("--images", arguments->images,
                   "Sets of images (default: reference_images of the cell's file; 40 with the "
                   "robot)")
      ->check(CLI::Range(2, 10000));
  command->callback(
      [arguments, &work] { work = [arguments] { return ReferenceRun(*arguments); }; });
}

}  // namespace silhouette
