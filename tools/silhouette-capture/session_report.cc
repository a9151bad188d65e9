#include "tools/silhouette-capture/session_report.h"

#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-capture/session_page.h"
#include "tools/silhouette-capture/session_pictures.h"

namespace silhouette {
namespace {

absl::StatusOr<ReportPictures> Paint(const Database& database, const Snapshot& snapshot,
                                     const SessionFacts& facts) {
  ReportPictures pictures;
  pictures.coverage = EncodePng(CoveragePicture(database.grid(), facts));
  ASSIGN_OR_RETURN(const auto sentinels, SentinelPicture(database, snapshot, facts));
  pictures.sentinels = EncodePng(sentinels);
  ASSIGN_OR_RETURN(const auto outliers, OutlierPicture(database, snapshot, facts));
  if (outliers) pictures.outliers = EncodePng(*outliers);
  const auto history = HistoryPicture(database.cell(), facts);
  if (history) pictures.history = EncodePng(*history);
  return pictures;
}

absl::Status WriteAll(const std::string& folder, const std::string& page, const std::string& json,
                      const ReportPictures& pictures) {
  absl::Status status = WriteWholeFile(folder + "/report.html", page);
  status.Update(WriteWholeFile(folder + "/report.json", json));
  status.Update(WriteWholeFile(folder + "/coverage.png", pictures.coverage));
  status.Update(WriteWholeFile(folder + "/sentinels.png", pictures.sentinels));
  if (pictures.outliers) {
    status.Update(WriteWholeFile(folder + "/outliers.png", *pictures.outliers));
  }
  if (pictures.history) {
    status.Update(WriteWholeFile(folder + "/history.png", *pictures.history));
  }
  return status;
}

}  // namespace

std::string DefaultReportFolder(const std::string& database, const std::string& variant) {
  return BesideDatabase(
      database, absl::StrCat(variant == schema::kDefaultVariant ? "" : "." + variant, ".report"));
}

absl::StatusOr<SessionFacts> WriteSessionReport(const CellArguments& arguments,
                                                const std::string& cell_name,
                                                const Database& database, const std::string& log,
                                                const std::string& folder) {
  RETURN_IF_ERROR(MakeFolder(folder));
  ASSIGN_OR_RETURN(const auto snapshot, database.Read());
  auto facts = GatherFacts(arguments, database, snapshot, log);
  if (!facts.ok()) return facts.status();
  ASSIGN_OR_RETURN(const auto pictures, Paint(database, snapshot, *facts));
  const std::string now = absl::FormatTime("%Y-%m-%d %H:%M", absl::Now(), absl::LocalTimeZone());
  std::vector<std::pair<std::string, std::string>> origin = {{"cell", cell_name},
                                                             {"database", database.path()}};
  if (facts->variants.size() > 1) origin.emplace_back("variant", facts->variant);
  origin.emplace_back("made", now);
  const std::string page = SessionPage(*facts, database.cell(), origin, pictures);
  RETURN_IF_ERROR(
      WriteAll(folder, page, SessionJson(*facts, database.cell()).dump(2) + "\n", pictures));
  return facts;
}

}  // namespace silhouette
