#include "tools/silhouette/formats/output.h"

#include <algorithm>
#include <cmath>
#include <iostream>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "tools/program/progress.h"
#include "tools/silhouette/formats/configuration_text.h"

namespace silhouette {

void Print(const Json& json) { std::cout << json.dump(2) << std::endl; }

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

}  // namespace

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
  return absl::StrFormat("not free at %s, %.0f %% on the way from waypoint %d: %s",
                         Spoken(check.configuration), 100 * check.fraction, check.segment,
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
  return {{"variant", variant.variant.empty() ? Json(nullptr) : Json(variant.variant)},
          {"changing", variant.changing},
          {"unknown", variant.unknown.empty() ? Json(nullptr) : Json(variant.unknown)}};
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

}  // namespace silhouette
