// silhouette scene show
#include <iostream>
#include <memory>

#include "db/status/status_macros.h"
#include "tools/silhouette/commands.h"
#include "tools/silhouette/formats/images_folder.h"
#include "tools/silhouette/formats/scene_output.h"

namespace silhouette {
namespace {

struct SceneShowArguments {
  uint64_t id = 0;
  std::string picture;
  std::string images;
};

absl::Status SceneShowWritePicture(const client::Scene& scene,
                                   const SceneShowArguments& arguments) {
  std::map<std::string, std::string> cameras;
  if (!arguments.images.empty()) {
    ASSIGN_OR_RETURN(const auto folder, ReadImagesFolder(arguments.images));
    for (const ImageFile& image : folder.images) cameras[image.view] = image.path;
  }
  ASSIGN_OR_RETURN(const auto picture, PictureOfScene(scene, cameras));
  return WritePng(arguments.picture, picture);
}

absl::StatusOr<ExitCode> Show(const Session& session, const SceneShowArguments& arguments) {
  ASSIGN_OR_RETURN(const Client client, session.Connect());
  ASSIGN_OR_RETURN(const auto scene, client.GetScene(arguments.id, !arguments.picture.empty()));
  if (!arguments.picture.empty()) {
    RETURN_IF_ERROR(SceneShowWritePicture(scene, arguments));
  }
  PrintScene(scene, session.json());
  return kDone;
}

}  // namespace

void AddSceneShowCommand(CLI::App& scene, Session& session, Run& run) {
  CLI::App* command =
      scene.add_subcommand("show", "Show a scene: counts per view, defects, a picture");
  auto arguments = std::make_shared<SceneShowArguments>();
  command->add_option("--id", arguments->id, "Number of the scene; default: the newest");
  command->add_option("--picture", arguments->picture,
                      "Draw scene and obstacle image of every view as a PNG");
  command
      ->add_option("--images", arguments->images,
                   "A folder with images.json: its camera images come into the picture too")
      ->needs("--picture");
  AddFormatOption(*command, session.format);
  command->footer("Example:\n  silhouette scene show --images images --picture views.png");
  command->callback([arguments, &session, &run] {
    run = [arguments, &session] { return Show(session, *arguments); };
  });
}

}  // namespace silhouette
