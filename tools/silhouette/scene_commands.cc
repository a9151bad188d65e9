// SPDX-License-Identifier: Apache-2.0
// silhouette scene publish, show, live, variant
#include <algorithm>
#include <chrono>
#include <map>
#include <memory>
#include <set>

#include "absl/strings/str_cat.h"
#include "common/picture/files.h"
#include "common/picture/mask_png.h"
#include "db/status/status_macros.h"
#include "silhouette/messages.h"
#include "tools/silhouette/commands.h"
#include "tools/silhouette/formats/inputs.h"
#include "tools/silhouette/formats/output.h"
#include "tools/silhouette/formats/pictures.h"

namespace silhouette {
namespace {

struct PublishArguments {
  std::string folder;
  std::vector<std::string> views;
  std::vector<std::string> joints;
  std::string kind = "camera";
  bool now = false;
};

absl::Status GivenTwice(const char* option, const std::string& name) {
  return absl::InvalidArgumentError(absl::StrCat(option, " ", name, " stands twice; give it once"));
}

// What the folder says, and in place of that what the options say.
absl::StatusOr<ImagesFolder> ImagesOf(const PublishArguments& arguments, TypedJoints& typed) {
  ImagesFolder images;
  std::set<std::string> views;
  std::set<std::string> joints;
  if (!arguments.folder.empty()) {
    ASSIGN_OR_RETURN(auto read, ReadImagesFolder(arguments.folder));
    images = std::move(read);
  }
  for (const std::string& text : arguments.views) {
    const auto parts = SplitAtEquals(text);
    if (!parts) {
      return absl::InvalidArgumentError(
          absl::StrCat("--view '", text, "' is not name=file, as in top=top.png"));
    }
    const ImageFile image{parts->first, parts->second};
    if (!views.insert(image.view).second) return GivenTwice("--view", image.view);
    std::erase_if(images.images, [&](const ImageFile& other) { return other.view == image.view; });
    images.images.push_back(image);
  }
  for (const std::string& text : arguments.joints) {
    ASSIGN_OR_RETURN(auto joint, typed.ParseNamed(text));
    if (!joints.insert(joint.first).second) return GivenTwice("--joint", joint.first);
    std::erase_if(images.joints, [&](const auto& other) { return other.first == joint.first; });
    images.joints.push_back(std::move(joint));
  }
  if (images.images.empty()) {
    return absl::InvalidArgumentError(
        "give a folder with an images.json, or images with --view name=file");
  }
  if (arguments.now) images.time = std::nullopt;
  return images;
}

absl::StatusOr<MaskSize> MaskSizeOf(const v1::GetDatabaseResponse& database,
                                    const std::string& view) {
  std::string known;
  for (const v1::View& each : database.views()) {
    if (each.name() == view) return MaskSize{each.mask_width(), each.mask_height()};
    absl::StrAppend(&known, known.empty() ? "" : ", ", each.name());
  }
  return absl::InvalidArgumentError(
      absl::StrCat("the database has no view '", view, "'; it has ", known));
}

// `database` is needed for masks only.
absl::StatusOr<v1::ViewImage> ReadImage(const ImageFile& file, const PublishArguments& arguments,
                                        const v1::GetDatabaseResponse& database) {
  v1::ViewImage image;
  image.set_view(file.view);
  if (arguments.kind == "camera") {
    ASSIGN_OR_RETURN(*image.mutable_camera_image(), ReadWholeFile(file.path));
    return image;
  }
  ASSIGN_OR_RETURN(const auto size, MaskSizeOf(database, file.view));
  ASSIGN_OR_RETURN(const auto mask, ReadMaskPng(file.path, size));
  *(arguments.kind == "mask" ? image.mutable_scene_mask() : image.mutable_obstacle_mask()) =
      client::ToMessage(mask);
  return image;
}

absl::StatusOr<ExitCode> Publish(const Session& session, const PublishArguments& arguments) {
  const auto called = client::RunningClock::now();
  ASSIGN_OR_RETURN(const Client client, session.Connect());
  TypedJoints typed(session.unit, [&] { return client.GetDatabase(); });
  ASSIGN_OR_RETURN(const auto files, ImagesOf(arguments, typed));
  v1::GetDatabaseResponse database;
  if (arguments.kind != "camera") {
    ASSIGN_OR_RETURN(database, client.GetDatabase());
  }
  v1::PublishSceneRequest request;
  request.set_variant(session.variant);
  for (const auto& [name, position] : files.joints) {
    v1::JointPosition& joint = *request.add_joints();
    joint.set_name(name);
    joint.set_position(position);
  }
  for (const ImageFile& file : files.images) {
    v1::ViewImage& image = *request.add_views();
    ASSIGN_OR_RETURN(image, ReadImage(file, arguments, database));
    if (files.time) *image.mutable_capture_time() = client::ToMessage(*files.time);
  }
  ASSIGN_OR_RETURN(const auto scene, client.PublishScene(std::move(request), called));
  PrintResult(session.format, JsonOf(scene), TextOf(scene));
  return scene.defects().empty() ? kDone : kNo;
}

struct ShowArguments {
  uint64_t id = 0;
  std::string picture;
  std::string images;
};

absl::Status WritePicture(const v1::Scene& scene, const ShowArguments& arguments) {
  std::map<std::string, std::string> cameras;
  if (!arguments.images.empty()) {
    ASSIGN_OR_RETURN(const auto folder, ReadImagesFolder(arguments.images));
    for (const ImageFile& image : folder.images) cameras[image.view] = image.path;
  }
  ASSIGN_OR_RETURN(const auto picture, PictureOfScene(scene, cameras));
  return WritePng(arguments.picture, picture);
}

absl::StatusOr<ExitCode> Show(const Session& session, const ShowArguments& arguments) {
  ASSIGN_OR_RETURN(const Client client, session.Connect());
  ASSIGN_OR_RETURN(const auto scene, client.GetScene(arguments.id, !arguments.picture.empty()));
  if (!arguments.picture.empty()) {
    RETURN_IF_ERROR(WritePicture(scene, arguments));
  }
  PrintResult(session.format, JsonOf(scene), TextOf(scene));
  return kDone;
}

absl::StatusOr<ExitCode> Live(const Session& session) {
  ASSIGN_OR_RETURN(const Client client, session.Connect());
  ASSIGN_OR_RETURN(const auto acquisition, client.GetAcquisition());
  PrintResult(session.format, JsonOf(acquisition), TextOf(acquisition));
  return acquisition.serving() ? kDone : kNo;
}

struct VariantArguments {
  std::string name;
  bool changing = false;
};

absl::StatusOr<ExitCode> Variant(const Session& session, const VariantArguments& arguments) {
  if (arguments.changing != arguments.name.empty()) {
    return absl::InvalidArgumentError(
        "name the variant that the robot has, or say --changing while it changes");
  }
  ASSIGN_OR_RETURN(const Client client, session.Connect());
  ASSIGN_OR_RETURN(const auto change, arguments.changing ? client.BeginVariantChange()
                                                         : client.ChangeVariant(arguments.name));
  PrintResult(session.format, JsonOf(change), TextOf(change));
  return kDone;
}

void AddPublishCommand(CLI::App& scene, Session& session) {
  CLI::App* command = scene.add_subcommand(
      "publish", "Publish the images of one moment; from then on verdicts rest on them");
  auto arguments = std::make_shared<PublishArguments>();
  command->add_option("folder", arguments->folder,
                      "A folder with images.json, as silhouette-sim render writes it");
  command->add_option("--view", arguments->views, "name=file: an image; may be given several times")
      ->allow_extra_args(false);
  command
      ->add_option("--joint", arguments->joints,
                   "name=value: where a joint of the robot stood; may be given several times")
      ->allow_extra_args(false);
  command
      ->add_option("--as", arguments->kind,
                   "What the images are: camera images, masks of the difference to the reference, "
                   "or masks of obstacles; masks are black and white")
      ->check(CLI::IsMember({"camera", "mask", "obstacles"}))
      ->capture_default_str();
  command->add_option("--variant", session.variant,
                      "The variant that shows the robot as it is: with this tool, this "
                      "part. Default: the default variant");
  command->add_flag(
      "--now", arguments->now,
      "The images count as taken when this command is called, whatever images.json says");
  AddDegreesFlag(*command, session, "Values of --joint");
  AddFormatOption(*command, session.format);
  command->footer(
      "images.json: {\"time\": \"2026-01-31T12:00:00Z\", \"joints\": {\"axis_1\": 0.5},\n"
      "\"views\": {\"top\": \"top.png\"}}; the time is by a wall clock that agrees with the "
      "server's.\n"
      "Without a time, and with --view, the images count as taken when this command is called:\n"
      "call it at once, or the images are older than the server knows.\n"
      "Exit code 1 if the scene was taken but verdicts from it are not free; the output states\n"
      "why.\n\n"
      "Example:\n"
      "  silhouette scene publish images\n"
      "  silhouette scene publish --as mask --view top=top.png --joint axis_1=30deg");
  Runs(*command, session, Publish, arguments);
}

void AddShowCommand(CLI::App& scene, Session& session) {
  CLI::App* command =
      scene.add_subcommand("show", "Show a scene: counts per view, defects, a picture");
  auto arguments = std::make_shared<ShowArguments>();
  command->add_option("--id", arguments->id, "Number of the scene; default: the newest");
  AddPictureOption(*command, arguments->picture,
                   "Draw scene and obstacle image of every view as a PNG");
  command
      ->add_option("--images", arguments->images,
                   "A folder with images.json: its camera images come into the picture too")
      ->needs("--picture");
  AddFormatOption(*command, session.format);
  command->footer("Example:\n  silhouette scene show --images images --picture views.png");
  Runs(*command, session, Show, arguments);
}

void AddLiveCommand(CLI::App& scene, Session& session) {
  CLI::App* command = scene.add_subcommand(
      "live", "State of the image acquisition of a server that runs with --live");
  AddFormatOption(*command, session.format);
  command->footer(
      "For each camera and the robot: whether the last sample is recent enough, the numbers of "
      "good\n"
      "and bad samples, the age of the last one, and the error.\n"
      "Exit code 1 if a camera or the robot does not serve.\n\n"
      "Example:\n  silhouette scene live --format json | jq '.cameras[] | {view, age_ms, fault}'");
  Runs(*command, session, Live);
}

void AddVariantCommand(CLI::App& scene, Session& session) {
  CLI::App* command = scene.add_subcommand(
      "variant", "Report to a server that runs with --live which variant the robot has");
  auto arguments = std::make_shared<VariantArguments>();
  command->add_option("name", arguments->name, "The variant that the robot has now");
  command->add_flag("--changing", arguments->changing,
                    "It is being changed: nothing is free until a variant is named");
  AddFormatOption(*command, session.format);
  command->footer(
      "Report --changing before the gripper moves or the robot takes a part. Name the variant "
      "when\n"
      "that is done. From then on older images make nothing free. The first scenes with the new\n"
      "variant come 100 ms later. Reporting the same again does no harm.\n\n"
      "Example:\n"
      "  silhouette scene variant --changing\n"
      "  silhouette scene variant with-part --format json");
  Runs(*command, session, Variant, arguments);
}

}  // namespace

void AddSceneCommands(CLI::App& program, Session& session) {
  CLI::App* scene =
      program.add_subcommand("scene", "What the cameras see: publish it, or look at it");
  scene->require_subcommand(1);
  scene->footer("Example:\n  silhouette scene publish images/ && silhouette scene show");
  scene->fallthrough();
  AddPublishCommand(*scene, session);
  AddShowCommand(*scene, session);
  AddLiveCommand(*scene, session);
  AddVariantCommand(*scene, session);
}

}  // namespace silhouette
