// silhouette scene variant
#include <iostream>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "tools/silhouette/commands.h"
#include "tools/silhouette/formats/output.h"

namespace silhouette {
namespace {

struct SceneVariantArguments {
  std::string name;
  bool changing = false;
};

std::string SceneVariantTextOf(const client::VariantChange& change) {
  const client::RobotVariant& variant = change.robot_variant;
  if (!variant.unknown.empty()) return absl::StrCat("not free: ", variant.unknown, "\n");
  return absl::StrCat("the robot has the variant ", variant.variant, ", in scenes after ",
                      change.last_scene_before, "\n");
}

absl::StatusOr<ExitCode> Variant(const Session& session, const SceneVariantArguments& arguments) {
  if (arguments.changing != arguments.name.empty()) {
    return absl::InvalidArgumentError(
        "name the variant that the robot has, or say --changing while it changes");
  }
  const absl::StatusOr<Client> client = session.Connect();
  if (!client.ok()) return client.status();
  ASSIGN_OR_RETURN(const client::VariantChange change, arguments.changing
                                                           ? client->BeginVariantChange()
                                                           : client->ChangeVariant(arguments.name));
  if (session.json()) {
    Json json = JsonOf(change.robot_variant);
    json["last_scene_before"] = change.last_scene_before;
    Print(json);
  } else {
    std::cout << SceneVariantTextOf(change) << std::flush;
  }
  return kDone;
}

}  // namespace

void AddSceneVariantCommand(CLI::App& scene, Session& session, Run& run) {
  CLI::App* command = scene.add_subcommand(
      "variant", "Tell a server that takes images itself (--live) which variant shows the robot");
  auto arguments = std::make_shared<SceneVariantArguments>();
  command->add_option("name", arguments->name, "The variant that the robot has now");
  command->add_flag("--changing", arguments->changing,
                    "It is being changed: nothing is free until a variant is named");
  AddFormatOption(*command, session.format);
  command->footer(
      "Tell that it is changing before the gripper moves or a part is taken, and name the variant "
      "when\n"
      "that is done. Nothing that rests on images of before is free any more; the first scenes "
      "with\n"
      "the new variant come 100 ms later. What is known already may be told again.\n\n"
      "Example:\n"
      "  silhouette scene variant --changing\n"
      "  silhouette scene variant with-part --format json");
  command->callback([arguments, &session, &run] {
    run = [arguments, &session] { return Variant(session, *arguments); };
  });
}

}  // namespace silhouette
