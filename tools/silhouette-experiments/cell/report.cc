// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/cell/report.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "common/numbers/numbers.h"
#include "common/result/result.h"

namespace silhouette::cell_experiment {
namespace {

using Json = nlohmann::ordered_json;

const std::vector<Column> kFigures = {
    {"preset", "preset"},
    {"views", "min_views"},
    {"tests", "where"},
    {"tested", "tested"},
    {"occupied", "occupied_percent", 2, " %"},
    {"additional", "additional_percent", 2, " %"},
    {"missing", "missing_percent", 4, " %"},
    {"count", "missing_count"},
    {"of occupied", "missed_collisions_percent", 2, " %"},
    {"flagged", "missing_hidden_possible"},
};

// Their names, for columns; the JSON has them in an object of their own.
Json FlatJsonOf(std::span<const Row> rows) {
  Json flat = JsonOf(rows);
  for (Json& row : flat) {
    row.erase("seed");
    row.update(Json(row["causes"]));
    row.erase("causes");
  }
  return flat;
}

// The rows of one experiment.
std::string ExperimentText(std::span<const Row> rows) {
  std::string text = absl::StrCat(rows[0].experiment, ": ", rows[0].scenes, " scenes");
  if (rows[0].refused > 0) absl::StrAppend(&text, ", ", rows[0].refused, " more refused");
  std::vector<Column> causes(kFigures.begin(), kFigures.begin() + 3);
  for (size_t i = 0; i < kCauses; ++i) {
    const std::string name = NameOf(static_cast<Cause>(i));
    causes.push_back({name, name});
  }
  const Json json = FlatJsonOf(rows);
  return absl::StrCat(text, "\n", silhouette::TextOf(TableOf(json, kFigures)),
                      "\ncauses of missing\n", silhouette::TextOf(TableOf(json, causes)));
}

Json PolicyJson(const TrialSetting& setting, size_t policy) {
  return {{"preset", NameOf(setting.policies[policy].preset)},
          {"min_views", MinViews(setting.policies[policy], setting.database.views())}};
}

bool SameTests(const Row& a, const Row& b) {
  return a.experiment == b.experiment && a.policy == b.policy && a.where == b.where;
}

Json LossJsonOf(std::span<const Comparison> comparisons, const OtherWay& way) {
  Json rows = Json::array();
  for (const Comparison& both : comparisons) {
    rows.push_back({{"experiment", both.usual.experiment},
                    {"preset", NameOf(both.usual.policy.preset)},
                    {"min_views", both.usual.min_views},
                    {"where", NameOf(both.usual.where)},
                    {"additional_percent", both.usual.AdditionalPercent()},
                    {way.name + "_additional_percent", both.other.AdditionalPercent()},
                    {"additional_loss_percent", both.AdditionalLoss()},
                    {"missing_percent", both.usual.MissingPercent()},
                    {way.name + "_missing_percent", both.other.MissingPercent()},
                    {"missing_loss_percent", both.MissingLoss()},
                    {"missing_loss_count", both.MissingLossCount()}});
  }
  return rows;
}

}  // namespace

double Row::AdditionalPercent() const { return Percent(tally.additional, tally.tested); }

double Row::MissingPercent() const { return Percent(tally.missing, tally.tested); }

double Row::MissedCollisionsPercent() const { return Percent(tally.missing, tally.occupied); }

std::string NameOf(Where where) { return where == kOnGrid ? "on_grid" : "off_grid"; }

std::vector<Row> RowsOf(const std::string& experiment, const TrialSetting& setting,
                        const std::vector<SceneRecord>& records) {
  std::vector<Row> rows;
  for (size_t p = 0; p < setting.policies.size(); ++p) {
    for (const Where where : {kOnGrid, kOffGrid}) {
      Row row{.seed = setting.seed,
              .experiment = experiment,
              .policy = setting.policies[p],
              .min_views = MinViews(setting.policies[p], setting.database.views()),
              .where = where,
              .tally = {}};
      for (const SceneRecord& record : records) {
        ++(record.blocked == Reason::kNone ? row.scenes : row.refused);
        row.tally.Add(record.tallies[p][where]);
        for (const auto& [missed, explanations] : record.missing) {
          for (size_t i = 0; i < missed.policies.size(); ++i) {
            if (missed.policies[i] != p || missed.where != where) continue;
            ++row.causes[static_cast<size_t>(explanations[i].cause)];
          }
        }
      }
      if (row.tally.tested > 0) rows.push_back(row);
    }
  }
  return rows;
}

std::string TextOf(std::span<const Row> rows) {
  std::string text;
  while (!rows.empty()) {
    const auto same = [&](const Row& row) { return row.experiment == rows[0].experiment; };
    const auto end = std::find_if_not(rows.begin(), rows.end(), same);
    const auto count = static_cast<size_t>(end - rows.begin());
    absl::StrAppend(&text, text.empty() ? "" : "\n", ExperimentText(rows.first(count)));
    rows = rows.subspan(count);
  }
  return text;
}

Json JsonOf(std::span<const Row> rows) {
  Json json = Json::array();
  for (const Row& row : rows) {
    Json causes = Json::object();
    for (size_t i = 0; i < kCauses; ++i) causes[NameOf(static_cast<Cause>(i))] = row.causes[i];
    json.push_back({{"seed", row.seed},
                    {"experiment", row.experiment},
                    {"preset", NameOf(row.policy.preset)},
                    {"min_views", row.min_views},
                    {"where", NameOf(row.where)},
                    {"scenes", row.scenes},
                    {"refused_scenes", row.refused},
                    {"tested", row.tally.tested},
                    {"occupied_percent", Percent(row.tally.occupied, row.tally.tested)},
                    {"additional_percent", row.AdditionalPercent()},
                    {"missing_percent", row.MissingPercent()},
                    {"missing_count", row.tally.missing},
                    {"missed_collisions_percent", row.MissedCollisionsPercent()},
                    {"missing_hidden_possible", row.tally.flagged},
                    {"causes", causes}});
  }
  return json;
}

std::string CsvOf(std::span<const Row> rows) { return silhouette::CsvOf(FlatJsonOf(rows)); }

std::string ScenesCsvOf(const TrialSetting& setting, const std::vector<SceneRecord>& records) {
  Json rows = Json::array();
  for (const SceneRecord& record : records) {
    for (size_t p = 0; p < record.tallies.size(); ++p) {
      for (const Where where : {kOnGrid, kOffGrid}) {
        const Tally& tally = record.tallies[p][where];
        Json& row = rows.emplace_back(
            Json{{"scene", record.number},
                 {"robot", record.robot_on_grid ? "on_grid" : "off_grid"},
                 {"blocked", record.blocked == Reason::kNone ? "" : NameOf(record.blocked)}});
        row.update(PolicyJson(setting, p));
        row.update(Json{{"where", NameOf(where)},
                        {"tested", tally.tested},
                        {"occupied", tally.occupied},
                        {"additional", tally.additional},
                        {"missing", tally.missing}});
      }
    }
  }
  return silhouette::CsvOf(rows);
}

std::string MissingCsvOf(const TrialSetting& setting, const std::vector<SceneRecord>& records,
                         const std::vector<std::vector<std::string>>& pictures) {
  const std::span<const GridJoint> joints = setting.database.grid().joints();
  std::vector<std::string> keys = {"scene", "where"};
  for (const GridJoint& joint : joints) keys.push_back(joint.name);
  for (const char* key : {"preset", "min_views", "cause", "sentence", "picture"}) {
    keys.push_back(key);
  }
  Json rows = Json::array();
  for (size_t r = 0; r < records.size(); ++r) {
    for (size_t m = 0; m < records[r].missing.size(); ++m) {
      const auto& [missed, explanations] = records[r].missing[m];
      Json at = {{"scene", records[r].number}, {"where", NameOf(missed.where)}};
      for (size_t j = 0; j < joints.size(); ++j) at[joints[j].name] = missed.configuration[j];
      at["picture"] = pictures[r][m];
      for (size_t i = 0; i < explanations.size(); ++i) {
        at.update(PolicyJson(setting, missed.policies[i]));
        at["cause"] = NameOf(explanations[i].cause);
        at["sentence"] = explanations[i].sentence;
        rows.push_back(at);
      }
    }
  }
  return silhouette::CsvOf(rows, keys);
}

std::vector<Comparison> Compare(std::span<const Row> usual, std::span<const Row> other) {
  std::vector<Comparison> comparisons;
  for (const Row& row : usual) {
    const auto same =
        std::ranges::find_if(other, [&](const Row& each) { return SameTests(row, each); });
    if (same != other.end()) comparisons.push_back({row, *same});
  }
  return comparisons;
}

std::string LossTextOf(std::span<const Comparison> comparisons, const OtherWay& way) {
  return absl::StrCat(way.heading, ", percent of the configurations\n",
                      silhouette::TextOf(TableOf(LossJsonOf(comparisons, way),
                                                 {{"experiment", "experiment"},
                                                  {"preset", "preset"},
                                                  {"views", "min_views"},
                                                  {"tests", "where"},
                                                  {"additional", "additional_percent", 2},
                                                  {way.name, way.name + "_additional_percent", 2},
                                                  {"loss", "additional_loss_percent", 4},
                                                  {"missing", "missing_percent", 4},
                                                  {way.name, way.name + "_missing_percent", 4},
                                                  {"loss", "missing_loss_percent", 4},
                                                  {"count", "missing_loss_count"}})));
}

std::string LossCsvOf(std::span<const Comparison> comparisons, const OtherWay& way) {
  return silhouette::CsvOf(LossJsonOf(comparisons, way));
}

Json JsonOf(std::span<const Row> rows, std::span<const Comparison> comparisons,
            const OtherWay& way) {
  Json json = JsonOf(rows);
  for (const Comparison& both : comparisons) {
    for (size_t i = 0; i < rows.size(); ++i) {
      if (!SameTests(rows[i], both.usual)) continue;
      json[i][way.name] = JsonOf({&both.other, 1})[0];
      json[i]["loss"] = {{"additional_percent", both.AdditionalLoss()},
                         {"missing_percent", both.MissingLoss()},
                         {"missing_count", both.MissingLossCount()}};
    }
  }
  return json;
}

}  // namespace silhouette::cell_experiment
