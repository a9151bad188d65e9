// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette/formats/output.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iostream>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "tools/program/progress.h"

namespace silhouette {
namespace {

// "'a', 'b'"
std::string Quoted(const std::vector<std::string>& names) {
  return absl::StrCat("'", absl::StrJoin(names, "', '"), "'");
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

double Milliseconds(absl::Duration duration) { return absl::ToDoubleMilliseconds(duration); }

// null if empty
Json JsonOrNull(const std::string& text) { return text.empty() ? Json(nullptr) : Json(text); }

Json JsonOf(const client::AcquiredDevice& device) {
  Json json = Json::object();
  if (!device.view.empty()) json["view"] = device.view;
  json["serving"] = device.serving;
  json[device.view.empty() ? "samples" : "images"] = device.good;
  json["errors"] = device.errors;
  json["age_ms"] = device.age ? Json(Milliseconds(*device.age)) : Json(nullptr);
  json["fault"] = JsonOrNull(device.fault);
  json["last_error"] = JsonOrNull(device.last_error);
  json["last_error_time"] =
      device.last_error.empty() ? Json(nullptr) : Json(Spoken(device.last_error_time));
  return json;
}

Json JsonOf(const client::AcquisitionLatency& latency) {
  return {{"count", latency.count},
          {"median_ms", Milliseconds(latency.median)},
          {"p99_ms", Milliseconds(latency.p99)},
          {"longest_ms", Milliseconds(latency.longest)}};
}

std::string LatencyText(const client::AcquisitionLatency& latency) {
  if (latency.count == 0) return "none yet";
  return absl::StrFormat("median %.1f ms, 99 of 100 within %.1f ms, longest %.1f ms",
                         Milliseconds(latency.median), Milliseconds(latency.p99),
                         Milliseconds(latency.longest));
}

std::string TitleOf(const client::AcquiredDevice& device) {
  return device.view.empty() ? "robot" : absl::StrCat("camera ", device.view);
}

std::vector<std::string> RowOf(const client::AcquiredDevice& device) {
  return {TitleOf(device), device.serving ? "yes" : "no", absl::StrCat(device.good),
          absl::StrCat(device.errors),
          device.age ? absl::StrFormat("%.0f ms", Milliseconds(*device.age)) : "-"};
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

// One line per configuration, without the whole of it in memory.
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
  return absl::StrFormat("%s, %.0f %% on the way from waypoint %d", Spoken(configuration),
                         100 * fraction, segment);
}

}  // namespace

void PrintResult(const std::string& format, const Json& json, const std::string& text) {
  std::cout << (format == "json" ? json.dump(2) + "\n" : text) << std::flush;
}

std::string Spoken(const client::Verdict& verdict) {
  std::string words = NameOf(verdict.state);
  if (verdict.free() && verdict.clearance) {
    absl::StrAppend(&words, ", clearance ", SpokenClearance(*verdict.clearance));
  }
  if (verdict.state == client::State::kUnknown) {
    absl::StrAppend(&words, ": ", Describe(verdict.reason));
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
  if (!basis.regions.empty()) {
    absl::StrAppend(&words, ", obstacles allowed in ", Quoted(basis.regions));
  }
  return words;
}

std::string Spoken(const client::PathCheck& check) {
  if (check.verdict.free()) {
    return absl::StrCat(Spoken(check.verdict), ": ", check.checked, " places checked");
  }
  return absl::StrCat("not free at ",
                      SpokenPlace(check.configuration, check.fraction, check.segment), ": ",
                      Spoken(check.verdict));
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
  return {{"scene_id", scene ? Json(basis.scene_id) : Json()},
          {"scene_time", scene ? Json(Spoken(basis.scene_time)) : Json()},
          {"scene_age_s", scene ? Json(absl::ToDoubleSeconds(basis.Age())) : Json()},
          {"database_generation", basis.database_generation},
          {"variant", basis.variant},
          {"scene_variant", basis.scene_variant.empty() ? Json() : Json(basis.scene_variant)},
          {"scene_regions", basis.regions}};
}

Json JsonOf(const client::PathCheck& check, client::Clearance clearance) {
  Json json = JsonOf(check.basis);
  json.update(JsonOf(check.verdict, clearance));
  json["checked"] = check.checked;
  if (!check.verdict.free()) {
    json["segment"] = check.segment;
    json["fraction"] = check.fraction;
    json["configuration"] = check.configuration;
  }
  if (check.narrowest) {
    json["narrowest"] = {{"segment", check.narrowest->segment},
                         {"fraction", check.narrowest->fraction},
                         {"configuration", check.narrowest->configuration}};
  }
  return json;
}

Json JsonOf(const client::RobotVariant& variant) {
  return {{"variant", JsonOrNull(variant.variant)},
          {"changing", variant.changing},
          {"unknown", JsonOrNull(variant.unknown)}};
}

std::string Table(const std::vector<std::vector<std::string>>& rows) {
  std::vector<size_t> widths;
  for (const std::vector<std::string>& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  std::string table;
  for (const std::vector<std::string>& row : rows) {
    for (size_t i = 0; i < row.size(); ++i) {
      const std::string padding(widths[i] - row[i].size(), ' ');
      if (i == 0) {
        absl::StrAppend(&table, row[i], padding);
      } else {
        absl::StrAppend(&table, "  ", padding, row[i]);
      }
    }
    absl::StrAppend(&table, "\n");
  }
  return table;
}

double Percent(uint64_t part, uint64_t whole) {
  return whole == 0 ? 0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

std::string Spoken(absl::Time time) {
  return absl::FormatTime(absl::RFC3339_full, time, absl::UTCTimeZone());
}

Json JsonOf(const client::VariantChange& change) {
  Json json = JsonOf(change.robot_variant);
  json["last_scene_before"] = change.last_scene_before;
  return json;
}

std::string TextOf(const client::VariantChange& change) {
  const client::RobotVariant& variant = change.robot_variant;
  if (!variant.unknown.empty()) return absl::StrCat("not free: ", variant.unknown, "\n");
  return absl::StrCat("the robot has the variant ", variant.variant, ", in scenes after ",
                      change.last_scene_before, "\n");
}

Json JsonOf(const client::Scene& scene) {
  Json json{{"scene_id", scene.id},       {"database_generation", scene.database_generation},
            {"time", Spoken(scene.time)}, {"skew_ms", absl::ToDoubleMilliseconds(scene.skew)},
            {"variant", scene.variant},   {"joints", Json::object()},
            {"views", Json::array()},     {"defects", Json::array()}};
  for (const client::JointPosition& joint : scene.joints) {
    json["joints"][joint.name] = joint.position;
  }
  for (const client::SceneView& view : scene.views) {
    json["views"].push_back({{"view", view.view},
                             {"capture_time", Spoken(view.capture_time)},
                             {"foreground_pixels", view.foreground_pixels},
                             {"obstacle_pixels", view.obstacle_pixels},
                             {"unknown_pixels", view.unknown_pixels},
                             {"error_pixels", view.error_pixels},
                             {"core_error_pixels", view.core_error_pixels},
                             {"margin_pixels", view.margin},
                             {"ignored_pixels", view.ignored_pixels}});
  }
  for (const client::SceneDefect& defect : scene.defects) {
    json["defects"].push_back({{"reason", NameOf(defect.reason)}, {"message", defect.message}});
  }
  return json;
}

std::string TextOf(const client::Scene& scene) {
  std::string text = absl::StrFormat(
      "scene %d of %s, skew %.1f ms, database generation %d\n", scene.id, Spoken(scene.time),
      absl::ToDoubleMilliseconds(scene.skew), scene.database_generation);
  if (!scene.variant.empty() && scene.variant != "default") {
    absl::StrAppend(&text, "variant ", scene.variant, "\n");
  }
  for (const client::JointPosition& joint : scene.joints) {
    absl::StrAppendFormat(&text, "%s = %.6g\n", joint.name, joint.position);
  }
  std::vector<std::vector<std::string>> rows = {
      {"view", "foreground", "obstacle", "unknown", "error", "core error", "margin", "ignored"}};
  for (const client::SceneView& view : scene.views) {
    rows.push_back({view.view, absl::StrCat(view.foreground_pixels),
                    absl::StrCat(view.obstacle_pixels), absl::StrCat(view.unknown_pixels),
                    absl::StrCat(view.error_pixels), absl::StrCat(view.core_error_pixels),
                    absl::StrFormat("%.2f", view.margin), absl::StrCat(view.ignored_pixels)});
  }
  absl::StrAppend(&text, Table(rows));
  for (const client::SceneDefect& defect : scene.defects) {
    absl::StrAppend(&text, "not free: ", defect.message, "\n");
  }
  return text;
}

Json JsonOf(const client::Acquisition& acquisition) {
  Json json{{"serving", acquisition.serving},         {"started", Spoken(acquisition.started)},
            {"scenes", acquisition.scenes},           {"lost_sets", acquisition.lost_sets},
            {"fault", JsonOrNull(acquisition.fault)}, {"cameras", Json::array()}};
  for (const client::AcquiredDevice& camera : acquisition.cameras) {
    json["cameras"].push_back(JsonOf(camera));
  }
  json["robot"] = JsonOf(acquisition.robot);
  json["robot_variant"] = JsonOf(acquisition.robot_variant);
  json["to_scene"] = JsonOf(acquisition.to_scene);
  json["to_map"] = JsonOf(acquisition.to_map);
  return json;
}

std::string TextOf(const client::Acquisition& acquisition) {
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
    if (!device.fault.empty()) absl::StrAppend(&text, TitleOf(device), ": ", device.fault, "\n");
  }
  return text;
}

Json JsonOf(const client::AllowedRegion& region) {
  Json json{{"name", region.name},
            {"remaining_s", absl::ToDoubleSeconds(region.remaining)},
            {"end_time", Spoken(region.end_time)},
            {"views", Json::array()}};
  for (const auto& [view, mask] : region.views) {
    json["views"].push_back({{"view", view}, {"pixels", mask.Count()}});
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

std::string TextOf(const Configuration& configuration, const client::Explanation& explanation) {
  const client::Verdict& verdict = explanation.verdict;
  const std::string text = absl::StrCat(Spoken(configuration), " is ", Spoken(verdict), "\n",
                                        Spoken(explanation.basis), "\n");
  if (verdict.views.empty()) return text;
  std::vector<std::vector<std::string>> rows = {
      {"pixels inside the robot", "obstacle", "unknown", "error"}};
  for (const client::ViewEvidence& view : verdict.views) {
    if (view.missing) {
      rows.push_back({absl::StrCat(view.view, " (no image: counts as an obstacle)")});
    } else {
      rows.push_back({view.view, absl::StrCat(view.obstacle_pixels),
                      absl::StrCat(view.unknown_pixels), absl::StrCat(view.error_pixels)});
    }
  }
  return absl::StrCat(text, PlainlySeen(verdict), "\n", Table(rows));
}

absl::Status WriteSpace(const client::ConfigurationSpace& space, const std::string& path) {
  std::ofstream out(path);
  if (!out) return absl::FailedPreconditionError("the file '" + path + "' cannot be written");
  absl::EndsWith(path, ".csv") ? WriteCsv(space, out) : WriteJson(space, out);
  out.close();
  if (out) return absl::OkStatus();
  return absl::ResourceExhaustedError("cannot write all of '" + path + "'; is the disk full?");
}

std::string Spoken(const Configuration& configuration) {
  return absl::StrJoin(configuration, ",", [](std::string* out, double value) {
    absl::StrAppendFormat(out, "%.6g", value);
  });
}

}  // namespace silhouette
