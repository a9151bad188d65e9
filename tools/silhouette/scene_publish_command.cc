// silhouette scene publish
#include <algorithm>
#include <iostream>
#include <memory>

#include "absl/strings/str_cat.h"
#include "common/picture/files.h"
#include "common/picture/mask_png.h"
#include "db/status/status_macros.h"
#include "tools/silhouette/commands.h"
#include "tools/silhouette/formats/configuration_text.h"
#include "tools/silhouette/formats/images_folder.h"
#include "tools/silhouette/formats/scene_output.h"

namespace silhouette {
namespace {

struct ScenePublishArguments {
  std::string folder;
  std::vector<std::string> views;
  std::vector<std::string> joints;
  std::string kind = "camera";
  bool now = false;
  bool degrees = false;
};

// What the folder says, then what the options say: the later wins.
absl::StatusOr<ImagesFolder> ScenePublishImagesOf(const ScenePublishArguments& arguments) {
  ImagesFolder images;
  if (!arguments.folder.empty()) {
    ASSIGN_OR_RETURN(auto read, ReadImagesFolder(arguments.folder));
    images = std::move(read);
  }
  for (const std::string& text : arguments.views) {
    const size_t equals = text.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == text.size()) {
      return absl::InvalidArgumentError(
          absl::StrCat("--view '", text, "' is not name=file, as in top=top.png"));
    }
    const ImageFile image{text.substr(0, equals), text.substr(equals + 1)};
    std::erase_if(images.images, [&](const ImageFile& other) { return other.view == image.view; });
    images.images.push_back(image);
  }
  for (const std::string& text : arguments.joints) {
    const auto [name, position] =
        ParseJoint(text, arguments.degrees ? AngleUnit::kDegrees : AngleUnit::kRadians);
    std::erase_if(images.joints, [&, &joint = name](const client::JointPosition& other) {
      return other.name == joint;
    });
    images.joints.push_back({name, position});
  }
  if (images.images.empty()) {
    return absl::InvalidArgumentError(
        "give a folder with an images.json, or images with --view name=file");
  }
  if (arguments.now) images.time = std::nullopt;
  return images;
}

absl::StatusOr<MaskSize> MaskSizeOf(const client::Database& database, const std::string& view) {
  std::string known;
  for (const client::View& each : database.views) {
    if (each.name == view) return each.mask_size;
    absl::StrAppend(&known, known.empty() ? "" : ", ", each.name);
  }
  return absl::InvalidArgumentError(
      absl::StrCat("the database has no view '", view, "'; it has ", known));
}

// `database` is needed for masks only.
absl::StatusOr<client::ViewImage> ReadImage(const ImageFile& file,
                                            const ScenePublishArguments& arguments,
                                            const client::Database* database) {
  client::ViewImage image{.view = file.view, .capture_time = std::nullopt, .image = {}};
  if (database == nullptr) {
    ASSIGN_OR_RETURN(auto bytes, ReadWholeFile(file.path));
    image.image = client::CameraImage{std::move(bytes)};
    return image;
  }
  ASSIGN_OR_RETURN(const auto size, MaskSizeOf(*database, file.view));
  ASSIGN_OR_RETURN(auto mask, ReadMaskPng(file.path, size));
  if (arguments.kind == "mask") {
    image.image = client::SceneMask{std::move(mask)};
  } else {
    image.image = client::ObstacleMask{std::move(mask)};
  }
  return image;
}

absl::StatusOr<ExitCode> Publish(const Session& session, const ScenePublishArguments& arguments) {
  ASSIGN_OR_RETURN(const auto files, ScenePublishImagesOf(arguments));
  const absl::StatusOr<Client> client = session.Connect();
  if (!client.ok()) return client.status();
  absl::StatusOr<client::Database> database = absl::InternalError("not asked for");
  if (arguments.kind != "camera") {
    database = client->GetDatabase();
    if (!database.ok()) return database.status();
  }
  std::vector<client::ViewImage> images;
  for (const ImageFile& file : files.images) {
    ASSIGN_OR_RETURN(auto image, ReadImage(file, arguments, database.ok() ? &*database : nullptr));
    image.capture_time = files.time;
    images.push_back(std::move(image));
  }
  ASSIGN_OR_RETURN(const auto scene, client->PublishScene(files.joints, images));
  PrintScene(scene, session.json());
  return scene.defects.empty() ? kDone : kNo;
}

}  // namespace

void AddScenePublishCommand(CLI::App& scene, Session& session, Run& run) {
  CLI::App* command = scene.add_subcommand(
      "publish", "Publish the images of one moment; from then on verdicts rest on them");
  auto arguments = std::make_shared<ScenePublishArguments>();
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
                   "or masks of obstacles")
      ->check(CLI::IsMember({"camera", "mask", "obstacles"}))
      ->capture_default_str();
  command->add_option("--variant", session.variant,
                      "The variant that shows the robot as it is: with this tool, this "
                      "part. Default: the default variant");
  command->add_flag("--now", arguments->now,
                    "The images are of this moment, whatever images.json says");
  command->add_flag("--degrees", arguments->degrees,
                    "Values of --joint without a unit are degrees");
  AddFormatOption(*command, session.format);
  command->footer(
      "images.json: {\"time\": \"2026-01-31T12:00:00Z\", \"joints\": {\"axis_1\": 0.5},\n"
      "\"views\": {\"top\": \"top.png\"}}; without a time, and with --view, the images are of "
      "now.\n"
      "Exit code 1 if the scene was taken but verdicts from it are not free; it is said why.\n\n"
      "Example:\n"
      "  silhouette scene publish images\n"
      "  silhouette scene publish --as mask --view top=top.png --joint axis_1=30deg");
  command->callback([arguments, &session, &run] {
    run = [arguments, &session] { return Publish(session, *arguments); };
  });
}

}  // namespace silhouette
