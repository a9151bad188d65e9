// silhouette scene set
#include <iostream>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"
#include "tools/silhouette/commands.h"
#include "tools/silhouette/output.h"

namespace silhouette {
namespace {

struct SceneSetArguments {
  std::string name;
  bool changing = false;
};

std::string SceneSetTextOf(const client::SetChange& change) {
  const client::RobotSet& set = change.robot_set;
  if (!set.unknown.empty()) return absl::StrCat("not free: ", set.unknown, "\n");
  return absl::StrCat("the robot has the set ", set.set, ", in scenes after ",
                      change.last_scene_before, "\n");
}

absl::StatusOr<ExitCode> Set(const Session& session, const SceneSetArguments& arguments) {
  if (arguments.changing != arguments.name.empty()) {
    return absl::InvalidArgumentError(
        "name the set that the robot has, or say --changing while it changes");
  }
  const absl::StatusOr<Client> client = session.Connect();
  if (!client.ok()) return client.status();
  ASSIGN_OR_RETURN(const client::SetChange change, arguments.changing
                                                       ? client->BeginSetChange()
                                                       : client->ChangeSet(arguments.name));
  if (session.json()) {
    Json json = JsonOf(change.robot_set);
    json["last_scene_before"] = change.last_scene_before;
    Print(json);
  } else {
    std::cout << SceneSetTextOf(change) << std::flush;
  }
  return kDone;
}

}  // namespace

void AddSceneSetCommand(CLI::App& scene, Session& session, Run& run) {
  CLI::App* command = scene.add_subcommand(
      "set", "Tell a server that takes images itself (--live) which set shows the robot");
  auto arguments = std::make_shared<SceneSetArguments>();
  command->add_option("name", arguments->name, "The set that the robot has now");
  command->add_flag("--changing", arguments->changing,
                    "It is being changed: nothing is free until a set is named");
  AddFormatOption(*command, session.format);
  command->footer(
      "Tell that it is changing before the gripper moves or a part is taken, and name the set "
      "when\n"
      "that is done. Nothing that rests on images of before is free any more; the first scenes "
      "with\n"
      "the new set come 100 ms later. What is known already may be told again.\n\n"
      "Example:\n"
      "  silhouette scene set --changing\n"
      "  silhouette scene set with-part --format json");
  command->callback([arguments, &session, &run] {
    run = [arguments, &session] { return Set(session, *arguments); };
  });
}

}  // namespace silhouette
