#include "tools/silhouette-capture/run_plan.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <set>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "capture/session/history.h"
#include "capture/session/raw_archive.h"
#include "db/status/status_macros.h"
#include "db/store/outliers.h"

namespace silhouette {
namespace {

using Numbers = std::vector<ConfigurationNumber>;

// Robot images that a new capture may mend: one that touches the border stays as it is.
absl::StatusOr<Numbers> Outliers(const Database& database) {
  ASSIGN_OR_RETURN(const auto snapshot, database.Read());
  ASSIGN_OR_RETURN(const auto outliers, FindOutliers(snapshot, database.grid()));
  std::set<ConfigurationNumber> numbers;
  for (const Outlier& outlier : outliers) {
    if (outlier.reason != OutlierReason::kTouchesBorder) numbers.insert(outlier.number);
  }
  return Numbers(numbers.begin(), numbers.end());
}

absl::StatusOr<Numbers> Suspects(const Database& database) {
  ASSIGN_OR_RETURN(const auto snapshot, database.Read());
  return SuspectNumbers(snapshot);
}

// Nothing if they are not numbers.
std::optional<Numbers> ParseNumbers(const std::string& text) {
  Numbers numbers;
  for (const absl::string_view word : absl::StrSplit(text, ',')) {
    uint64_t number = 0;
    if (!absl::SimpleAtoi(word, &number)) return std::nullopt;
    numbers.push_back(number);
  }
  return numbers;
}

absl::StatusOr<CaptureSelection> Select(const PlanArguments& arguments, const Database* database) {
  using Kind = CaptureSelection::Kind;
  CaptureSelection selection{.new_sentinels = arguments.new_sentinels,
                             .exclude_captured = arguments.exclude_captured};
  if (arguments.only == "missing" || database == nullptr) return selection;
  if (arguments.only == "all") {
    selection.kind = Kind::kAll;
    return selection;
  }
  if (arguments.only == "sentinels") {
    selection.kind = Kind::kNothing;
    return selection;
  }
  absl::StatusOr<Numbers> listed = Numbers();
  if (arguments.only == "outliers") {
    listed = Outliers(*database);
  } else if (arguments.only == "suspect") {
    listed = Suspects(*database);
  } else {
    listed = ParseNumbers(arguments.only).value_or(Numbers());
  }
  if (!listed.ok()) return listed.status();
  selection.kind = Kind::kListed;
  selection.listed = *std::move(listed);
  return selection;
}

// The sentinels that the database knows, to be captured anew, too.
absl::Status AddSentinels(const Database& database, CaptureSelection& selection) {
  ASSIGN_OR_RETURN(const auto snapshot, database.Read());
  ASSIGN_OR_RETURN(const auto history, snapshot.CaptureHistory());
  selection.kind = CaptureSelection::Kind::kListed;
  for (const ConfigurationNumber number : history.sentinels()) {
    if (database.grid().Contains(number)) selection.listed.push_back(number);
  }
  return absl::OkStatus();
}

}  // namespace

std::string CheckOnly(const std::string& only) {
  static const std::set<std::string> words = {"missing", "outliers", "suspect", "all", "sentinels"};
  if (words.contains(only) || ParseNumbers(only)) return "";
  return absl::StrCat("'", only,
                      "': missing, outliers, suspect, all, sentinels, or configuration numbers "
                      "with commas are expected");
}

absl::StatusOr<CapturePlan> MakePlan(const PlanArguments& arguments,
                                     const CellArguments& cell_arguments, const Cell& cell,
                                     const Travel& travel, const Database* database) {
  ASSIGN_OR_RETURN(CaptureSelection selection, Select(arguments, database));
  std::vector<StoredRecord> records = NoRecords(travel.grid());
  if (database != nullptr) {
    ASSIGN_OR_RETURN(auto stored, ReadRecords(*database));
    records = std::move(stored);
    if (arguments.new_sentinels && selection.kind != CaptureSelection::Kind::kAll) {
      RETURN_IF_ERROR(AddSentinels(*database, selection));
    }
  }
  auto plan = PlanCapture(DescriptionOf(cell), travel, records, cell.capture, selection);
  if (absl::IsFailedPrecondition(plan.status())) {
    return absl::FailedPreconditionError(absl::StrCat(
        plan.status().message(), "; change the region, or drop these robot images and have the ",
        "configurations excluded: ", cell_arguments.Command("run"), " --exclude-captured"));
  }
  return plan;
}

DiskRoom RoomFor(const CapturePlan& plan, const CellFile& file, const Database* database) {
  DiskRoom room{
      .raw_bytes = 0, .available = std::nullopt, .keep_free = file.cell.capture.keep_free};
  const CaptureSettings& settings = file.cell.capture;
  uint64_t images = plan.captures.size();
  if (settings.raw_images == RawImages::kNone) images = 0;
  if (settings.raw_images == RawImages::kSentinels) {
    images = std::min<uint64_t>(images, static_cast<uint64_t>(settings.sentinels.count));
  }
  if (images > 0) room.raw_bytes = images * EstimateRawBytes(DescriptionOf(file.cell), database);
  // Where the folder is, or will be.
  std::error_code error;
  std::filesystem::path folder = std::filesystem::absolute(file.database, error);
  while (!std::filesystem::exists(folder, error) && folder.has_relative_path()) {
    folder = folder.parent_path();
  }
  const auto space = std::filesystem::space(folder, error);
  if (!error) room.available = space.available;
  return room;
}

}  // namespace silhouette
