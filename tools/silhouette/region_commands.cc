// SPDX-License-Identifier: Apache-2.0
// silhouette region allow, revoke, list
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "db/status/status_macros.h"
#include "silhouette/messages.h"
#include "tools/silhouette/commands.h"
#include "tools/silhouette/formats/inputs.h"
#include "tools/silhouette/formats/output.h"

namespace silhouette {
namespace {

struct AllowArguments {
  std::string name;
  std::vector<std::string> polygons;
  std::vector<std::string> masks;
  std::optional<absl::Duration> duration;
};

// "left 12, top 9 pixels"
std::string PixelsOf(const v1::AllowedRegion& region) {
  std::string text;
  for (const v1::RegionPixels& view : region.views()) {
    absl::StrAppend(&text, text.empty() ? "" : ", ", view.view(), " ",
                    client::FromMessage(view.mask()).Count());
  }
  return text + " pixels";
}

absl::StatusOr<ExitCode> Allow(const Session& session, const AllowArguments& arguments) {
  v1::AllowRegionRequest request;
  request.set_name(arguments.name);
  *request.mutable_duration() = client::ToMessage(*arguments.duration);
  for (const std::string& text : arguments.polygons) {
    ASSIGN_OR_RETURN(*request.add_views(), ParseRegionPolygon(text));
  }
  for (const std::string& text : arguments.masks) {
    ASSIGN_OR_RETURN(*request.add_views(), ReadRegionMask(text));
  }
  if (request.views().empty()) {
    return absl::InvalidArgumentError(
        "say where: VIEW:x,y;x,y;x,y for a polygon, or --mask VIEW=FILE");
  }
  ASSIGN_OR_RETURN(const Client client, session.Connect());
  ASSIGN_OR_RETURN(const auto region, client.AllowRegion(request));
  PrintResult(session.format, JsonOf(region),
              absl::StrFormat("obstacles are allowed in '%s' until %s: %s\n", region.name(),
                              Spoken(client::FromMessage(region.end_time())), PixelsOf(region)));
  return kDone;
}

absl::StatusOr<ExitCode> Revoke(const Session& session, const std::string& name) {
  ASSIGN_OR_RETURN(const Client client, session.Connect());
  ASSIGN_OR_RETURN(const bool was_in_force, client.RevokeRegion(name));
  PrintResult(
      session.format, {{"name", name}, {"was_in_force", was_in_force}},
      absl::StrCat("region '", name, "' ",
                   was_in_force ? "is revoked" : "was not in force: nothing is changed", "\n"));
  return was_in_force ? kDone : kNo;
}

absl::StatusOr<ExitCode> List(const Session& session) {
  ASSIGN_OR_RETURN(const Client client, session.Connect());
  ASSIGN_OR_RETURN(const auto listed, client.ListAllowedRegions());
  Json json{{"regions", Json::array()}};
  std::string text = listed.regions().empty() ? "no allowed region is in force\n" : "";
  for (const v1::AllowedRegion& region : listed.regions()) {
    json["regions"].push_back(JsonOf(region));
    absl::StrAppendFormat(&text, "'%s' for %.1f s more: %s\n", region.name(),
                          absl::ToDoubleSeconds(client::FromMessage(region.remaining())),
                          PixelsOf(region));
  }
  PrintResult(session.format, json, text);
  return kDone;
}

void AddAllowCommand(CLI::App& region, Session& session) {
  CLI::App* command = region.add_subcommand(
      "allow", "Allow obstacles in a part of the images for a while, ten minutes at most");
  auto arguments = std::make_shared<AllowArguments>();
  command
      ->add_option("name", arguments->name,
                   "A name; every verdict that the region affects reports it")
      ->required();
  command->add_option(
      "polygons", arguments->polygons,
      "VIEW:x,y;x,y;x,y: a polygon in pixels of the view's mask (not of the camera's "
      "image), integers at pixel centres");
  command
      ->add_option("--mask", arguments->masks,
                   "VIEW=FILE: an image of the mask's size, white where the region lies; may be "
                   "given several times")
      ->allow_extra_args(false);
  AddTimeOption(*command, "--for", arguments->duration, "How long: 30s, 1min30s, 500ms")
      ->required();
  AddFormatOption(*command, session.format);
  command->footer(
      "In the region obstacles are unknown: they neither count nor prove that nothing is there.\n"
      "Give it in every view that sees the part, with a margin. A region of the same name "
      "is\n"
      "replaced. It ends by itself, is not prolonged by anything but a new 'allow', and does not\n"
      "outlive the server's database.\n\n"
      "Example:\n"
      "  silhouette region allow part 'left:20,30;28,30;28,40;20,40' --mask top=part.png --for "
      "30s");
  Runs(*command, session, Allow, arguments);
}

void AddRevokeCommand(CLI::App& region, Session& session) {
  CLI::App* command = region.add_subcommand("revoke", "End an allowed region at once");
  auto name = std::make_shared<std::string>();
  command->add_option("name", *name, "The region's name")->required();
  AddFormatOption(*command, session.format);
  command->footer(
      "Exit code 1 if no region of this name was in force.\n\n"
      "Example:\n  silhouette region revoke part");
  Runs(*command, session, Revoke, name);
}

void AddListCommand(CLI::App& region, Session& session) {
  CLI::App* command = region.add_subcommand("list", "List the allowed regions in force");
  AddFormatOption(*command, session.format);
  command->footer("Example:\n  silhouette region list --format json");
  Runs(*command, session, List);
}

}  // namespace

void AddRegionCommands(CLI::App& program, Session& session) {
  CLI::App* region = program.add_subcommand(
      "region", "Where obstacles are allowed for a while, such as around a part to be grasped");
  region->require_subcommand(1);
  region->footer(
      "Example:\n  silhouette region allow part 'left:20,30;28,30;28,40;20,40' --for 30s");
  region->fallthrough();
  AddAllowCommand(*region, session);
  AddRevokeCommand(*region, session);
  AddListCommand(*region, session);
}

}  // namespace silhouette
