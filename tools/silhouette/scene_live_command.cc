// silhouette scene live
#include <iostream>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "db/status/status_macros.h"
#include "tools/silhouette/commands.h"
#include "tools/silhouette/formats/output.h"

namespace silhouette {
namespace {

double Milliseconds(absl::Duration duration) { return absl::ToDoubleMilliseconds(duration); }

Json SceneLiveJsonOf(const client::AcquiredDevice& device) {
  Json json = Json::object();
  if (!device.view.empty()) json["view"] = device.view;
  json["serving"] = device.serving;
  json[device.view.empty() ? "samples" : "images"] = device.good;
  json["errors"] = device.errors;
  json["age_ms"] = device.age ? Json(Milliseconds(*device.age)) : Json(nullptr);
  json["fault"] = device.fault.empty() ? Json(nullptr) : Json(device.fault);
  json["last_error"] = device.last_error.empty() ? Json(nullptr) : Json(device.last_error);
  json["last_error_time"] =
      device.last_error.empty() ? Json(nullptr) : Json(Spoken(device.last_error_time));
  return json;
}

Json SceneLiveJsonOf(const client::AcquisitionLatency& latency) {
  return {{"count", latency.count},
          {"median_ms", Milliseconds(latency.median)},
          {"p99_ms", Milliseconds(latency.p99)},
          {"longest_ms", Milliseconds(latency.longest)}};
}

Json SceneLiveJsonOf(const client::Acquisition& acquisition) {
  Json json{{"serving", acquisition.serving},
            {"started", Spoken(acquisition.started)},
            {"scenes", acquisition.scenes},
            {"lost_sets", acquisition.lost_sets},
            {"fault", acquisition.fault.empty() ? Json(nullptr) : Json(acquisition.fault)},
            {"cameras", Json::array()}};
  for (const client::AcquiredDevice& camera : acquisition.cameras) {
    json["cameras"].push_back(SceneLiveJsonOf(camera));
  }
  json["robot"] = SceneLiveJsonOf(acquisition.robot);
  json["robot_variant"] = silhouette::JsonOf(acquisition.robot_variant);
  json["to_scene"] = SceneLiveJsonOf(acquisition.to_scene);
  json["to_map"] = SceneLiveJsonOf(acquisition.to_map);
  return json;
}

std::string LatencyText(const client::AcquisitionLatency& latency) {
  if (latency.count == 0) return "none yet";
  return absl::StrFormat("median %.1f ms, 99 of 100 within %.1f ms, longest %.1f ms",
                         Milliseconds(latency.median), Milliseconds(latency.p99),
                         Milliseconds(latency.longest));
}

std::string SceneLiveTitleOf(const client::AcquiredDevice& device) {
  return device.view.empty() ? "robot" : absl::StrCat("camera ", device.view);
}

std::vector<std::string> RowOf(const client::AcquiredDevice& device) {
  return {SceneLiveTitleOf(device), device.serving ? "yes" : "no", absl::StrCat(device.good),
          absl::StrCat(device.errors),
          device.age ? absl::StrFormat("%.0f ms", Milliseconds(*device.age)) : "-"};
}

std::string SceneLiveTextOf(const client::Acquisition& acquisition) {
  std::string text = absl::StrCat(
      acquisition.serving ? "serving" : "not serving", ", since ", Spoken(acquisition.started),
      ": ", acquisition.scenes, " scenes, ", acquisition.lost_sets, " lost sets of images\n",
      "from the last pixel to the scene: ", LatencyText(acquisition.to_scene),
      "\nfrom the last pixel to the map:   ", LatencyText(acquisition.to_map), "\n");
  std::vector<client::AcquiredDevice> devices = acquisition.cameras;
  devices.push_back(acquisition.robot);
  std::vector<std::vector<std::string>> rows = {{"device", "serving", "good", "errors", "age"}};
  for (const client::AcquiredDevice& device : devices) rows.push_back(RowOf(device));
  absl::StrAppend(&text, Table(rows));
  const client::RobotVariant& variant = acquisition.robot_variant;
  if (!variant.variant.empty())
    absl::StrAppend(&text, "the robot's variant: ", variant.variant, "\n");
  if (!variant.unknown.empty()) absl::StrAppend(&text, "not free: ", variant.unknown, "\n");
  if (!acquisition.fault.empty()) absl::StrAppend(&text, "no scene: ", acquisition.fault, "\n");
  for (const client::AcquiredDevice& device : devices) {
    if (!device.fault.empty())
      absl::StrAppend(&text, SceneLiveTitleOf(device), ": ", device.fault, "\n");
  }
  return text;
}

absl::StatusOr<ExitCode> Live(const Session& session) {
  const absl::StatusOr<Client> client = session.Connect();
  if (!client.ok()) return client.status();
  ASSIGN_OR_RETURN(const client::Acquisition acquisition, client->GetAcquisition());
  if (session.json()) {
    Print(SceneLiveJsonOf(acquisition));
  } else {
    std::cout << SceneLiveTextOf(acquisition) << std::flush;
  }
  return acquisition.serving ? kDone : kNo;
}

}  // namespace

void AddSceneLiveCommand(CLI::App& scene, Session& session, Run& run) {
  CLI::App* command = scene.add_subcommand(
      "live", "How the acquisition of a server goes that takes images itself (--live)");
  AddFormatOption(*command, session.format);
  command->footer(
      "Per camera and for the robot: whether what it gave last is young enough, how often it gave\n"
      "something that could be used and how often not, how old the last is, and what is wrong.\n"
      "Exit code 1 if a camera or the robot does not serve.\n\n"
      "Example:\n  silhouette scene live --format json | jq '.cameras[] | {view, age_ms, fault}'");
  command->callback([&session, &run] { run = [&session] { return Live(session); }; });
}

}  // namespace silhouette
