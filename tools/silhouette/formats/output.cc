// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette/formats/output.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <ostream>
#include <sstream>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/picture/files.h"
#include "silhouette/messages.h"
#include "tools/program/progress.h"

namespace silhouette {
namespace {

// "'a', 'b'"
std::string Quoted(const std::vector<std::string>& names) {
  return absl::StrCat("'", absl::StrJoin(names, "', '"), "'");
}

// 0 if it is over.
double SecondsUntil(client::RunningClock::time_point then) {
  const std::chrono::duration<double> left = then - client::RunningClock::now();
  return std::max(0.0, left.count());
}

// "3.61 px"
std::string SpokenClearance(double pixels) {
  return std::isinf(pixels) ? "without limit" : absl::StrFormat("%.3g px", pixels);
}

// JSON has no infinity; the string is what JSON of Protobuf has for it.
Json JsonOfPixels(const std::optional<double>& pixels) {
  if (!pixels) return {};
  return std::isinf(*pixels) ? Json("Infinity") : Json(*pixels);
}

double Milliseconds(const google::protobuf::Duration& duration) {
  return absl::ToDoubleMilliseconds(client::FromMessage(duration));
}

std::string Spoken(const google::protobuf::Timestamp& time) {
  return silhouette::Spoken(client::FromMessage(time));
}

std::string Exact(const google::protobuf::Timestamp& time) {
  return silhouette::Exact(client::FromMessage(time));
}

// null if empty
Json JsonOrNull(const std::string& text) { return text.empty() ? Json(nullptr) : Json(text); }

// A camera, or the robot.
struct Device {
  std::string title;
  bool serving = false;
  uint64_t good = 0;  // images, or joint values, that could be used
  std::optional<google::protobuf::Duration> age;
};

Device DeviceOf(const v1::AcquiredCamera& camera) {
  return {"camera " + camera.view(), camera.serving(), camera.images(),
          camera.has_last_image_age() ? std::optional(camera.last_image_age()) : std::nullopt};
}

Device DeviceOf(const v1::AcquiredRobot& robot) {
  return {"robot", robot.serving(), robot.samples(),
          robot.has_last_sample_age() ? std::optional(robot.last_sample_age()) : std::nullopt};
}

// `good`: what the number of good ones is called.
template <typename Message>
Json JsonOf(const Message& message, const char* good) {
  const Device device = DeviceOf(message);
  return {{"serving", device.serving},
          {good, device.good},
          {"errors", message.errors()},
          {"age_ms", device.age ? Json(Milliseconds(*device.age)) : Json()},
          {"fault", JsonOrNull(message.fault())},
          {"last_error", JsonOrNull(message.last_error())},
          {"last_error_time",
           message.last_error().empty() ? Json() : Json(Exact(message.last_error_time()))}};
}

Json JsonOf(const v1::RobotVariant& variant) {
  return {{"variant", JsonOrNull(variant.variant())},
          {"changing", variant.changing()},
          {"unknown", JsonOrNull(variant.unknown())}};
}

Json JsonOf(const v1::AcquisitionLatency& latency) {
  return {{"count", latency.count()},
          {"median_ms", Milliseconds(latency.median())},
          {"p99_ms", Milliseconds(latency.p99())},
          {"longest_ms", Milliseconds(latency.longest())}};
}

std::string LatencyText(const v1::AcquisitionLatency& latency) {
  if (latency.count() == 0) return "none yet";
  return absl::StrFormat("median %.1f ms, 99 of 100 within %.1f ms, longest %.1f ms",
                         Milliseconds(latency.median()), Milliseconds(latency.p99()),
                         Milliseconds(latency.longest()));
}

// In how many views an obstacle is plainly seen; the policy may find one in more.
std::string PlainlySeen(const client::Verdict& verdict) {
  const auto shows = [](const client::ViewEvidence& view) {
    return view.missing || view.obstacle_pixels > 0;
  };
  return absl::StrCat(std::count_if(verdict.views.begin(), verdict.views.end(), shows), " of ",
                      verdict.views.size(),
                      " views have obstacle pixels inside the robot, or no image");
}

void WriteCsv(const client::ConfigurationSpace& space, std::ostream& out) {
  const ConfigurationGrid& grid = space.grid();
  out << "number";
  for (const GridJoint& joint : grid.joints()) out << ',' << joint.name;
  const bool levels = !space.clearance_levels().empty();
  out << (levels ? ",state,clearance_above\n" : ",state\n");
  for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
    if (!grid.Contains(number)) continue;
    out << number;
    for (double value : grid.At(number)) out << absl::StreamFormat(",%.17g", value);
    out << ',' << NameOf(space.StateAt(number));
    const std::optional<double> exceeds = space.ClearanceAt(number).exceeds;
    if (levels) out << ',' << (exceeds ? absl::StrFormat("%.17g", *exceeds) : "");
    out << '\n';
  }
}

// One line per configuration.
void WriteJson(const client::ConfigurationSpace& space, std::ostream& out) {
  const ConfigurationGrid& grid = space.grid();
  Json head = silhouette::JsonOf(space.basis());
  head["joints"] = Json::array();
  for (const GridJoint& joint : grid.joints()) head["joints"].push_back(joint.name);
  std::string text = head.dump();
  text.pop_back();
  out << text << ",\n\"configurations\":[";
  bool first = true;
  for (ConfigurationNumber number = 0; number < grid.number_limit(); ++number) {
    if (!grid.Contains(number)) continue;
    Json entry{{"number", number},
               {"configuration", grid.At(number)},
               {"state", NameOf(space.StateAt(number))}};
    if (!space.clearance_levels().empty()) {
      const std::optional<double> exceeds = space.ClearanceAt(number).exceeds;
      entry["clearance_above"] = exceeds ? Json(*exceeds) : Json();
    }
    out << (first ? "\n" : ",\n") << entry.dump();
    first = false;
  }
  out << "\n]}\n";
}

// Where on a path.
std::string SpokenPlace(const Configuration& configuration, double fraction, int segment) {
  return absl::StrFormat("%s, %.0f %% on the way from waypoint %d",
                         silhouette::Spoken(configuration), 100 * fraction, segment);
}

}  // namespace

std::string Spoken(client::Reason reason, const client::Basis& basis) {
  std::vector<std::string> messages;
  for (const client::Defect& defect : basis.defects) {
    if (defect.reason == reason || basis.scene_id == 0) messages.push_back(defect.message);
  }
  return messages.empty() ? Describe(reason) : absl::StrJoin(messages, "; ");
}

std::string Spoken(const client::Verdict& verdict, const client::Basis& basis) {
  std::string words = NameOf(verdict.state);
  if (verdict.free() && verdict.clearance) {
    absl::StrAppend(&words, ", clearance ", SpokenClearance(*verdict.clearance));
  }
  if (verdict.state == client::State::kUnknown) {
    absl::StrAppend(&words, ": ", Spoken(verdict.reason, basis));
  } else if (verdict.hidden_possible) {
    absl::StrAppend(&words, " (but an obstacle may hide there from every view)");
  }
  if (!verdict.regions.empty()) {
    absl::StrAppend(&words, " (obstacles allowed in ", Quoted(verdict.regions), ")");
  }
  return words;
}

std::string Spoken(const client::Basis& basis) {
  if (basis.scene_id == 0) {
    return absl::StrCat("no scene, database generation ", basis.database_generation);
  }
  std::string words = absl::StrCat("scene ", basis.scene_id, ", ", Spoken(basis.Age()),
                                   " old, database generation ", basis.database_generation);
  if (!basis.variant.empty() && basis.scene_variant.empty()) {
    absl::StrAppend(&words, ", the scene's variant is not known");
  } else if (basis.variant != basis.scene_variant) {
    absl::StrAppend(&words, ", tested with variant ", basis.variant, ", the scene has variant ",
                    basis.scene_variant);
  } else if (!basis.variant.empty() && basis.variant != "default") {
    absl::StrAppend(&words, ", variant ", basis.variant);
  }
  if (basis.unverified_model) absl::StrAppend(&words, ", drawn from a model that is not verified");
  if (!basis.regions.empty()) {
    absl::StrAppend(&words, ", obstacles allowed in ", Quoted(basis.regions));
  }
  // A missing view alone blocks nothing, but counts as an obstacle everywhere.
  for (const client::Defect& defect : basis.defects) {
    if (defect.reason == client::Reason::kViewMissing)
      absl::StrAppend(&words, "; ", defect.message);
  }
  return words;
}

namespace {

std::string NameOf(client::PathProof proof) {
  switch (proof) {
    case client::PathProof::kGrid:
      return "grid";
    case client::PathProof::kContinuous:
      return "continuous";
    case client::PathProof::kSampled:
      return "sampled";
    case client::PathProof::kNone:
      break;
  }
  return "none";
}

std::string SpokenProof(const client::PathCheck& check) {
  switch (check.proof) {
    case client::PathProof::kContinuous:
      return ", proven free all along";
    case client::PathProof::kSampled:
      return absl::StrFormat(
          ", in part sampled: no point moves more than %.1f mm between two places",
          1000 * check.sampled_step);
    default:
      return "";
  }
}

// If it lets the robot move and has expired, one that says that the robot must stop.
client::Separation HeldNow(const client::Separation& separation) {
  if (separation.ValidNow() || !separation.lets_move()) return separation;
  return {.unknown_reason = client::Reason::kAnswerLate};
}

std::string SpokenSeparation(const client::PathCheck& check) {
  if (!check.separation) return "";
  const client::Separation separation = HeldNow(*check.separation);
  if (separation.unknown_reason != client::Reason::kUnspecified) {
    return absl::StrCat("; stop: ", silhouette::Spoken(separation.unknown_reason, check.basis));
  }
  const std::string where = absl::StrFormat(
      "people are %.2f m away or more, least at %.0f %% of the way from waypoint %d",
      separation.distance, 100 * separation.fraction, separation.segment);
  const std::vector<double>& kept = separation.protective_distances;
  if (separation.level == 0) {
    return absl::StrFormat("; stop: %s, and the slowest level keeps %.2f m%s", where,
                           kept.empty() ? 0 : kept.front(),
                           separation.leads_away ? "; the path leads away" : "");
  }
  return absl::StrFormat("; speed level %d '%s' for %.2f s: %s", separation.level,
                         separation.level_name, SecondsUntil(separation.valid_until), where);
}

Json JsonOf(const client::Separation& answer) {
  const client::Separation separation = HeldNow(answer);
  const bool known = separation.unknown_reason == client::Reason::kUnspecified;
  return {{"level", separation.level},
          {"level_name", separation.level_name.empty() ? Json() : Json(separation.level_name)},
          {"unknown_reason", known ? Json() : Json(NameOf(separation.unknown_reason))},
          {"distance_m", known ? Json(separation.distance) : Json()},
          {"segment", separation.segment},
          {"fraction", separation.fraction},
          {"leads_away", separation.leads_away},
          {"protective_distances_m", separation.protective_distances},
          {"image_age_s", known ? Json(absl::ToDoubleSeconds(separation.image_age)) : Json()},
          {"valid_for_s", known ? Json(SecondsUntil(separation.valid_until)) : Json()}};
}

}  // namespace

std::string Spoken(const client::PathCheck& check) {
  if (check.verdict.free()) {
    return absl::StrCat(Spoken(check.verdict, check.basis), ": ", Counted(check.checked, "place"),
                        " checked", SpokenProof(check), SpokenSeparation(check));
  }
  if (check.configuration.empty()) {
    return absl::StrCat(Spoken(check.verdict, check.basis), SpokenSeparation(check));
  }
  return absl::StrCat("not free at ",
                      SpokenPlace(check.configuration, check.fraction, check.segment), ": ",
                      Spoken(check.verdict, check.basis), SpokenSeparation(check));
}

Json JsonOf(const client::Verdict& verdict, client::Clearance clearance) {
  const bool unknown = verdict.state == client::State::kUnknown;
  const bool measured = clearance == client::Clearance::kMeasure;
  Json json{{"state", NameOf(verdict.state)},
            {"reason", unknown ? Json(NameOf(verdict.reason)) : Json()}};
  if (measured) json["clearance"] = JsonOfPixels(verdict.clearance);
  json["hidden_possible"] = verdict.hidden_possible;
  json["regions"] = verdict.regions;
  json["views"] = Json::array();
  for (const client::ViewEvidence& view : verdict.views) {
    Json entry{{"view", view.view},
               {"missing", view.missing},
               {"obstacle_pixels", view.obstacle_pixels},
               {"unknown_pixels", view.unknown_pixels},
               {"error_pixels", view.error_pixels}};
    if (measured) entry["distance"] = JsonOfPixels(view.distance);
    json["views"].push_back(entry);
  }
  return json;
}

Json JsonOf(const client::Basis& basis) {
  const bool scene = basis.scene_id != 0;
  Json defects = Json::array();
  for (const client::Defect& defect : basis.defects) {
    defects.push_back({{"reason", NameOf(defect.reason)}, {"message", defect.message}});
  }
  return {{"scene_id", scene ? Json(basis.scene_id) : Json()},
          {"scene_time", scene ? Json(Exact(basis.scene_time)) : Json()},
          {"scene_age_s", scene ? Json(absl::ToDoubleSeconds(basis.Age())) : Json()},
          {"valid_for_s", SecondsUntil(basis.valid_until)},
          {"database_generation", basis.database_generation},
          {"variant", basis.variant},
          {"scene_variant", basis.scene_variant.empty() ? Json() : Json(basis.scene_variant)},
          {"scene_regions", basis.regions},
          {"unverified_model", basis.unverified_model},
          {"defects", defects}};
}

Json JsonOf(const client::PathCheck& check, client::Clearance clearance) {
  Json json = JsonOf(check.basis);
  json.update(JsonOf(check.verdict, clearance));
  json["checked"] = check.checked;
  if (check.verdict.free()) json["proof"] = NameOf(check.proof);
  if (check.proof == client::PathProof::kSampled) json["sampled_step_m"] = check.sampled_step;
  if (!check.configuration.empty() && !check.verdict.free()) {
    json["segment"] = check.segment;
    json["fraction"] = check.fraction;
    json["configuration"] = check.configuration;
  }
  if (check.separation) json["separation"] = JsonOf(*check.separation);
  if (check.narrowest) {
    json["narrowest"] = {{"segment", check.narrowest->segment},
                         {"fraction", check.narrowest->fraction},
                         {"configuration", check.narrowest->configuration}};
  }
  return json;
}

std::string Spoken(absl::Time time) {
  return absl::FormatTime("%Y-%m-%dT%H:%M:%E3SZ", time, absl::UTCTimeZone());
}

std::string Exact(absl::Time time) {
  return absl::FormatTime(absl::RFC3339_full, time, absl::UTCTimeZone());
}

Json JsonOf(const v1::ChangeVariantResponse& change) {
  Json json = JsonOf(change.robot_variant());
  json["last_scene_before"] = change.last_scene_before();
  return json;
}

std::string TextOf(const v1::ChangeVariantResponse& change) {
  const v1::RobotVariant& variant = change.robot_variant();
  if (!variant.unknown().empty()) return absl::StrCat("not free: ", variant.unknown(), "\n");
  return absl::StrCat("the robot has the variant ", variant.variant(), ", in scenes after ",
                      change.last_scene_before(), "\n");
}

Json JsonOf(const v1::Scene& scene) {
  Json json{{"scene_id", scene.id()},      {"database_generation", scene.database_generation()},
            {"time", Exact(scene.time())}, {"skew_ms", Milliseconds(scene.skew())},
            {"variant", scene.variant()},  {"joints", Json::object()},
            {"views", Json::array()},      {"defects", Json::array()}};
  for (const v1::JointPosition& joint : scene.joints()) {
    json["joints"][joint.name()] = joint.position();
  }
  for (const v1::SceneView& view : scene.views()) {
    json["views"].push_back({{"view", view.view()},
                             {"capture_time", Exact(view.capture_time())},
                             {"foreground_pixels", view.foreground_pixels()},
                             {"obstacle_pixels", view.obstacle_pixels()},
                             {"unknown_pixels", view.unknown_pixels()},
                             {"error_pixels", view.error_pixels()},
                             {"core_error_pixels", view.core_error_pixels()},
                             {"margin_pixels", view.margin()},
                             {"ignored_pixels", view.ignored_pixels()}});
  }
  for (const v1::SceneDefect& defect : scene.defects()) {
    json["defects"].push_back(
        {{"reason", NameOf(client::FromMessage(defect.reason()))}, {"message", defect.message()}});
  }
  return json;
}

std::string TextOf(const v1::Scene& scene) {
  std::string text = absl::StrFormat("scene %d of %s, skew %.1f ms, database generation %d\n",
                                     scene.id(), Spoken(scene.time()), Milliseconds(scene.skew()),
                                     scene.database_generation());
  if (!scene.variant().empty() && scene.variant() != "default") {
    absl::StrAppend(&text, "variant ", scene.variant(), "\n");
  }
  for (const v1::JointPosition& joint : scene.joints()) {
    absl::StrAppendFormat(&text, "%s = %.6g\n", joint.name(), joint.position());
  }
  Table table{.headings = {"view", "foreground", "obstacle", "unknown", "error", "core error",
                           "margin", "ignored"}};
  for (const v1::SceneView& view : scene.views()) {
    table.rows.push_back({view.view(), absl::StrCat(view.foreground_pixels()),
                          absl::StrCat(view.obstacle_pixels()), absl::StrCat(view.unknown_pixels()),
                          absl::StrCat(view.error_pixels()), absl::StrCat(view.core_error_pixels()),
                          absl::StrFormat("%.2f", view.margin()),
                          absl::StrCat(view.ignored_pixels())});
  }
  absl::StrAppend(&text, TextOf(table));
  for (const v1::SceneDefect& defect : scene.defects()) {
    absl::StrAppend(&text, "not free: ", defect.message(), "\n");
  }
  return text;
}

Json JsonOf(const v1::Acquisition& acquisition) {
  Json json{
      {"serving", acquisition.serving()},         {"started", Exact(acquisition.start_time())},
      {"scenes", acquisition.scenes()},           {"lost_sets", acquisition.lost_sets()},
      {"fault", JsonOrNull(acquisition.fault())}, {"cameras", Json::array()}};
  for (const v1::AcquiredCamera& camera : acquisition.cameras()) {
    Json entry{{"view", camera.view()}};
    entry.update(JsonOf(camera, "images"));
    json["cameras"].push_back(entry);
  }
  json["robot"] = JsonOf(acquisition.robot(), "samples");
  json["robot_variant"] = JsonOf(acquisition.robot_variant());
  json["to_scene"] = JsonOf(acquisition.to_scene());
  json["to_map"] = JsonOf(acquisition.to_map());
  return json;
}

std::string TextOf(const v1::Acquisition& acquisition) {
  std::string text =
      absl::StrCat(acquisition.serving() ? "serving" : "not serving", ", since ",
                   Spoken(acquisition.start_time()), ": ", acquisition.scenes(), " scenes, ",
                   acquisition.lost_sets(), " lost sets of images\n",
                   "from the last pixel to the scene: ", LatencyText(acquisition.to_scene()),
                   "\nfrom the last pixel to the map:   ", LatencyText(acquisition.to_map()), "\n");
  Table table{.headings = {"device", "serving", "good", "errors", "age"}};
  std::string faults;
  const auto add = [&](const auto& message) {
    const Device device = DeviceOf(message);
    table.rows.push_back(
        {device.title, device.serving ? "yes" : "no", absl::StrCat(device.good),
         absl::StrCat(message.errors()),
         device.age ? absl::StrFormat("%.0f ms", Milliseconds(*device.age)) : "-"});
    if (!message.fault().empty()) {
      absl::StrAppend(&faults, device.title, ": ", message.fault(), "\n");
    }
  };
  for (const v1::AcquiredCamera& camera : acquisition.cameras()) add(camera);
  add(acquisition.robot());
  absl::StrAppend(&text, TextOf(table));
  const v1::RobotVariant& variant = acquisition.robot_variant();
  if (!variant.variant().empty()) {
    absl::StrAppend(&text, "the robot's variant: ", variant.variant(), "\n");
  }
  if (!variant.unknown().empty()) absl::StrAppend(&text, "not free: ", variant.unknown(), "\n");
  if (!acquisition.fault().empty()) {
    absl::StrAppend(&text, "no scene: ", acquisition.fault(), "\n");
  }
  return text + faults;
}

Json JsonOf(const v1::AllowedRegion& region) {
  Json json{{"name", region.name()},
            {"remaining_s", absl::ToDoubleSeconds(client::FromMessage(region.remaining()))},
            {"end_time", Exact(region.end_time())},
            {"views", Json::array()}};
  for (const v1::RegionPixels& view : region.views()) {
    json["views"].push_back(
        {{"view", view.view()}, {"pixels", client::FromMessage(view.mask()).Count()}});
  }
  return json;
}

std::string TextOf(const client::PathCheck& check) {
  std::string text = Spoken(check) + "\n";
  if (check.narrowest) {
    absl::StrAppend(&text, "narrowest at ",
                    SpokenPlace(check.narrowest->configuration, check.narrowest->fraction,
                                check.narrowest->segment),
                    "\n");
  }
  return absl::StrCat(text, Spoken(check.basis), "\n");
}

Json JsonOf(const Configuration& configuration, const client::Explanation& explanation) {
  Json json = JsonOf(explanation.basis);
  json["configuration"] = configuration;
  json.update(JsonOf(explanation.verdict));
  return json;
}

std::string TextOf(const std::string& configuration, const std::string& hint,
                   const client::Explanation& explanation) {
  const client::Verdict& verdict = explanation.verdict;
  const std::string text = absl::StrCat(configuration, " is ", Spoken(verdict, explanation.basis),
                                        hint, "\n", Spoken(explanation.basis), "\n");
  if (verdict.views.empty()) return text;
  Table table{.headings = {"pixels inside the robot", "obstacle", "unknown", "error"}};
  for (const client::ViewEvidence& view : verdict.views) {
    if (view.missing) {
      table.rows.push_back({absl::StrCat(view.view, " (no image: counts as an obstacle)")});
    } else {
      table.rows.push_back({view.view, absl::StrCat(view.obstacle_pixels),
                            absl::StrCat(view.unknown_pixels), absl::StrCat(view.error_pixels)});
    }
  }
  return absl::StrCat(text, PlainlySeen(verdict), "\n", TextOf(table));
}

absl::Status WriteSpace(const client::ConfigurationSpace& space, const std::string& path) {
  std::ostringstream text;
  absl::EndsWith(path, ".csv") ? WriteCsv(space, text) : WriteJson(space, text);
  return WriteWholeFile(path, std::move(text).str());
}

std::string Spoken(const Configuration& configuration) {
  return absl::StrJoin(configuration, ",", [](std::string* out, double value) {
    absl::StrAppendFormat(out, "%.6g", value);
  });
}

}  // namespace silhouette
