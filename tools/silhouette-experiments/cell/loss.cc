#include "tools/silhouette-experiments/cell/loss.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace silhouette::cell_experiment {
namespace {

bool SameTests(const Row& a, const Row& b) {
  return a.experiment == b.experiment && a.policy == b.policy && a.where == b.where;
}

// The count's own sign would be lost in the difference of two unsigned ones.
int64_t MoreMissing(const Comparison& both) {
  return static_cast<int64_t>(both.found.tally.missing) -
         static_cast<int64_t>(both.truth.tally.missing);
}

}  // namespace

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
