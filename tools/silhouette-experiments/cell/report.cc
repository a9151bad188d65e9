// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/cell/report.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/numbers/numbers.h"

namespace silhouette::cell_experiment {
namespace {

// Why configurations are missing, one line per policy, of the rows of one experiment.
std::string CausesTable(std::span<const Row> rows) {
  std::string text = absl::StrFormat("\ncauses of missing\n%-17s %-5s", "preset", "views");
  for (size_t i = 0; i < kCauses; ++i) {
    absl::StrAppendFormat(&text, " %11s", NameOf(static_cast<Cause>(i)));
  }
  text += '\n';
  for (size_t first = 0; first < rows.size();) {
    size_t end = first;
    std::array<uint64_t, kCauses> causes{};
    for (; end < rows.size() && rows[end].policy == rows[first].policy; ++end) {
      for (size_t i = 0; i < kCauses; ++i) causes[i] += rows[end].causes[i];
    }
    absl::StrAppendFormat(&text, "%-17s %5d", NameOf(rows[first].policy.preset),
                          rows[first].min_views);
    for (const uint64_t count : causes) absl::StrAppendFormat(&text, " %11d", count);
    text += '\n';
    first = end;
  }
  return text;
}

// The rows of one experiment.
std::string ExperimentTable(std::span<const Row> rows) {
  std::string text = absl::StrFormat("%s: %d scenes", rows[0].experiment, rows[0].scenes);
  if (rows[0].refused > 0) absl::StrAppendFormat(&text, ", %d more refused", rows[0].refused);
  absl::StrAppendFormat(&text, "\n%-17s %-5s %-8s %10s %10s %12s %11s %8s\n", "preset", "views",
                        "tests", "tested", "occupied", "additional", "missing", "count");
  for (const Row& row : rows) {
    absl::StrAppendFormat(&text, "%-17s %5d %-8s %10d %8.2f %% %10.2f %% %9.4f %% %8d\n",
                          NameOf(row.policy.preset), row.min_views, NameOf(row.where),
                          row.tally.tested, Percent(row.tally.occupied, row.tally.tested),
                          AdditionalPercent(row), MissingPercent(row), row.tally.missing);
  }
  return text + CausesTable(rows);
}

std::string PolicyColumns(const TrialSetting& setting, size_t policy) {
  return absl::StrCat(NameOf(setting.policies[policy].preset), ",",
                      MinViews(setting.policies[policy], setting.database.views()));
}

bool SameTests(const Row& a, const Row& b) {
  return a.experiment == b.experiment && a.policy == b.policy && a.where == b.where;
}

// The count's own sign would be lost in the difference of two unsigned ones.
int64_t MoreMissing(const Comparison& both) {
  return static_cast<int64_t>(both.found.tally.missing) -
         static_cast<int64_t>(both.truth.tally.missing);
}

}  // namespace

double AdditionalPercent(const Row& row) { return Percent(row.tally.additional, row.tally.tested); }

double MissingPercent(const Row& row) { return Percent(row.tally.missing, row.tally.tested); }

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

std::string TableOf(std::span<const Row> rows) {
  std::string text;
  for (size_t first = 0; first < rows.size();) {
    size_t end = first;
    while (end < rows.size() && rows[end].experiment == rows[first].experiment) ++end;
    absl::StrAppend(&text, text.empty() ? "" : "\n",
                    ExperimentTable(rows.subspan(first, end - first)));
    first = end;
  }
  return text;
}

nlohmann::ordered_json JsonOf(std::span<const Row> rows) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const Row& row : rows) {
    nlohmann::ordered_json causes = nlohmann::ordered_json::object();
    for (size_t i = 0; i < kCauses; ++i) {
      causes[NameOf(static_cast<Cause>(i))] = row.causes[i];
    }
    json.push_back({{"seed", row.seed},
                    {"experiment", row.experiment},
                    {"preset", NameOf(row.policy.preset)},
                    {"min_views", row.min_views},
                    {"where", NameOf(row.where)},
                    {"scenes", row.scenes},
                    {"refused_scenes", row.refused},
                    {"tested", row.tally.tested},
                    {"occupied_percent", Percent(row.tally.occupied, row.tally.tested)},
                    {"additional_percent", AdditionalPercent(row)},
                    {"missing_percent", MissingPercent(row)},
                    {"missing_count", row.tally.missing},
                    {"causes", causes}});
  }
  return json;
}

std::string CsvOf(std::span<const Row> rows) {
  std::string text =
      "experiment,preset,min_views,where,scenes,refused_scenes,tested,occupied_percent,"
      "additional_percent,missing_percent,missing_count";
  for (size_t i = 0; i < kCauses; ++i) absl::StrAppend(&text, ",", NameOf(static_cast<Cause>(i)));
  text += '\n';
  for (const Row& row : rows) {
    absl::StrAppend(&text, row.experiment, ",", NameOf(row.policy.preset), ",", row.min_views, ",",
                    NameOf(row.where), ",", row.scenes, ",", row.refused, ",", row.tally.tested,
                    ",", Percent(row.tally.occupied, row.tally.tested), ",", AdditionalPercent(row),
                    ",", MissingPercent(row), ",", row.tally.missing);
    for (const uint64_t count : row.causes) absl::StrAppend(&text, ",", count);
    text += '\n';
  }
  return text;
}

std::string ScenesCsvOf(const TrialSetting& setting, const std::vector<SceneRecord>& records) {
  std::string text =
      "scene,robot,blocked,preset,min_views,where,tested,occupied,additional,missing\n";
  for (const SceneRecord& record : records) {
    for (size_t p = 0; p < record.tallies.size(); ++p) {
      for (const Where where : {kOnGrid, kOffGrid}) {
        const Tally& tally = record.tallies[p][where];
        absl::StrAppend(&text, record.number, ",", record.robot_on_grid ? "on_grid" : "off_grid",
                        ",", record.blocked == Reason::kNone ? "" : NameOf(record.blocked), ",",
                        PolicyColumns(setting, p), ",", NameOf(where), ",", tally.tested, ",",
                        tally.occupied, ",", tally.additional, ",", tally.missing, "\n");
      }
    }
  }
  return text;
}

std::string MissingCsvOf(const TrialSetting& setting, const std::vector<SceneRecord>& records,
                         const std::vector<std::vector<std::string>>& pictures) {
  std::string text = "scene,where";
  for (const GridJoint& joint : setting.database.grid().joints()) {
    absl::StrAppend(&text, ",", joint.name);
  }
  text += ",preset,min_views,cause,sentence,picture\n";
  for (size_t r = 0; r < records.size(); ++r) {
    for (size_t m = 0; m < records[r].missing.size(); ++m) {
      const auto& [missed, explanations] = records[r].missing[m];
      std::string head = absl::StrCat(records[r].number, ",", NameOf(missed.where));
      for (const double value : missed.configuration) {
        absl::StrAppendFormat(&head, ",%.17g", value);
      }
      for (size_t i = 0; i < explanations.size(); ++i) {
        // Sentences have no quotation marks.
        absl::StrAppend(&text, head, ",", PolicyColumns(setting, missed.policies[i]), ",",
                        NameOf(explanations[i].cause), ",\"", explanations[i].sentence, "\",",
                        pictures[r][m], "\n");
      }
    }
  }
  return text;
}

double Comparison::AdditionalLoss() const {
  return AdditionalPercent(found) - AdditionalPercent(truth);
}

double Comparison::MissingLoss() const { return MissingPercent(found) - MissingPercent(truth); }

std::vector<Comparison> Compare(std::span<const Row> truth, std::span<const Row> found) {
  std::vector<Comparison> comparisons;
  for (const Row& row : truth) {
    const auto other = std::find_if(found.begin(), found.end(),
                                    [&](const Row& each) { return SameTests(row, each); });
    if (other != found.end()) comparisons.push_back({row, *other});
  }
  return comparisons;
}

std::string LossTableOf(std::span<const Comparison> comparisons) {
  std::string text = absl::StrFormat(
      "with the true calibration and with the one found, percent of the configurations\n"
      "%-10s %-17s %-5s %-8s | %-10s %7s %8s | %-8s %8s %8s %6s\n",
      "experiment", "preset", "views", "tests", "additional", "found", "loss", "missing", "found",
      "loss", "count");
  for (const Comparison& both : comparisons) {
    absl::StrAppendFormat(
        &text, "%-10s %-17s %5d %-8s | %10.2f %7.2f %+8.4f | %8.4f %8.4f %+8.4f %+6d\n",
        both.truth.experiment, NameOf(both.truth.policy.preset), both.truth.min_views,
        NameOf(both.truth.where), AdditionalPercent(both.truth), AdditionalPercent(both.found),
        both.AdditionalLoss(), MissingPercent(both.truth), MissingPercent(both.found),
        both.MissingLoss(), MoreMissing(both));
  }
  return text;
}

std::string LossCsvOf(std::span<const Comparison> comparisons) {
  std::string text =
      "experiment,preset,min_views,where,additional_percent,found_additional_percent,"
      "additional_loss_percent,missing_percent,found_missing_percent,missing_loss_percent,"
      "missing_loss_count\n";
  for (const Comparison& both : comparisons) {
    absl::StrAppend(&text, both.truth.experiment, ",", NameOf(both.truth.policy.preset), ",",
                    both.truth.min_views, ",", NameOf(both.truth.where), ",",
                    AdditionalPercent(both.truth), ",", AdditionalPercent(both.found), ",",
                    both.AdditionalLoss(), ",", MissingPercent(both.truth), ",",
                    MissingPercent(both.found), ",", both.MissingLoss(), ",", MoreMissing(both),
                    "\n");
  }
  return text;
}

nlohmann::ordered_json JsonOf(std::span<const Row> rows, std::span<const Comparison> comparisons) {
  nlohmann::ordered_json json = JsonOf(rows);
  for (const Comparison& both : comparisons) {
    for (size_t i = 0; i < rows.size(); ++i) {
      if (!SameTests(rows[i], both.truth)) continue;
      json[i]["found"] = JsonOf({&both.found, 1})[0];
      json[i]["loss"] = {{"additional_percent", both.AdditionalLoss()},
                         {"missing_percent", both.MissingLoss()},
                         {"missing_count", MoreMissing(both)}};
    }
  }
  return json;
}

}  // namespace silhouette::cell_experiment
