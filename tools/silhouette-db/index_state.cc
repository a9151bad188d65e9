#include "tools/silhouette-db/index_state.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace silhouette {

std::string StateName(const CollisionIndexSummary& summary) {
  if (summary.tiles == 0) return "no robot images";
  if (summary.missing == summary.tiles) return "none";
  if (summary.fresh == summary.tiles) return "fresh";
  return summary.damaged > 0 ? "damaged" : "stale";
}

std::string StateText(const CollisionIndexSummary& summary, const std::string& database) {
  const std::string name = StateName(summary);
  if (summary.tiles == 0) return "none, there are no robot images";
  const std::string mend = absl::StrCat("silhouette-db index ", database);
  if (name == "none") return absl::StrCat("none; build it with: ", mend);
  std::string text;
  if (name == "fresh") {
    text = absl::StrFormat("fresh, %d tiles, %.1f MiB", summary.tiles,
                           static_cast<double>(summary.bytes) / (1 << 20));
    if (summary.unreadable > 0) {
      absl::StrAppend(&text, "; without ", summary.unreadable, " records that could not be read");
    }
    return text;
  }
  std::vector<std::string> parts;
  const auto count = [&](uint64_t tiles, const char* what) {
    if (tiles > 0) parts.push_back(absl::StrCat(tiles, " ", what));
  };
  count(summary.damaged, "damaged");
  count(summary.stale, "stale");
  count(summary.missing, "missing");
  return absl::StrCat("of ", summary.tiles, " tiles ", absl::StrJoin(parts, ", "),
                      "; build them with: ", mend);
}

nlohmann::json StateJson(const CollisionIndexSummary& summary) {
  return {{"state", StateName(summary)},      {"tiles", summary.tiles},
          {"fresh", summary.fresh},           {"stale", summary.stale},
          {"missing", summary.missing},       {"damaged", summary.damaged},
          {"unreadable", summary.unreadable}, {"bytes", summary.bytes}};
}

}  // namespace silhouette
