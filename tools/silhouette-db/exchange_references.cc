#include <filesystem>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-db/exchange.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
constexpr char kHeader[] = "view,images,time,mean,noise";

absl::Time ExchangeReferencesTimeOf(const storage::v1::Reference& reference) {
  return absl::FromUnixSeconds(reference.time().seconds()) +
         absl::Nanoseconds(reference.time().nanos());
}

absl::StatusOr<storage::v1::Reference> ReadReference(const std::string& folder,
                                                     const std::vector<std::string>& cells) {
  storage::v1::Reference reference;
  int images = 0;
  if (!absl::SimpleAtoi(cells[1], &images)) {
    return absl::InvalidArgumentError(absl::StrCat("images: '", cells[1], "' is not a number"));
  }
  reference.set_images(images);
  absl::Time time;
  std::string why;
  if (!cells[2].empty()) {
    if (!absl::ParseTime(absl::RFC3339_full, cells[2], &time, &why)) {
      return absl::InvalidArgumentError(absl::StrCat("time: '", cells[2], "' is not a time"));
    }
    const int64_t nanoseconds = absl::ToUnixNanos(time);
    reference.mutable_time()->set_seconds(nanoseconds / 1'000'000'000);
    reference.mutable_time()->set_nanos(static_cast<int32_t>(nanoseconds % 1'000'000'000));
  }
  ASSIGN_OR_RETURN(std::string mean, ReadWholeFile((fs::path(folder) / cells[3]).string()));
  reference.set_mean_png(std::move(mean));
  ASSIGN_OR_RETURN(std::string noise, ReadWholeFile((fs::path(folder) / cells[4]).string()));
  reference.set_noise_png(std::move(noise));
  return reference;
}

}  // namespace

absl::Status ExportReferences(const std::string& folder, const storage::v1::CellDescription& cell,
                              const storage::v1::References& references) {
  RETURN_IF_ERROR(MakeFolder(absl::StrCat(folder, "/references")));
  std::string table = absl::StrCat(kHeader, "\n");
  for (int i = 0; i < references.views_size(); ++i) {
    const storage::v1::Reference& reference = references.views(i);
    const std::string& view = cell.views(i).name();
    const std::string stem = "references/" + PathPart(view);
    absl::Status status =
        WriteWholeFile((fs::path(folder) / (stem + "-mean.png")).string(), reference.mean_png());
    if (!status.ok()) return status;
    status =
        WriteWholeFile((fs::path(folder) / (stem + "-noise.png")).string(), reference.noise_png());
    if (!status.ok()) return status;
    const std::string time =
        reference.has_time()
            ? absl::FormatTime("%Y-%m-%dT%H:%M:%E*SZ", ExchangeReferencesTimeOf(reference),
                               absl::UTCTimeZone())
            : "";
    absl::StrAppend(&table,
                    CsvLine({view, absl::StrCat(reference.images()), time, stem + "-mean.png",
                             stem + "-noise.png"}),
                    "\n");
  }
  return WriteWholeFile((fs::path(folder) / kReferencesFile).string(), table);
}

absl::StatusOr<std::optional<storage::v1::References>> ImportReferences(
    const std::string& folder, const storage::v1::CellDescription& cell) {
  const std::string path = (fs::path(folder) / kReferencesFile).string();
  const absl::StatusOr<std::string> table = ReadWholeFile(path);
  if (absl::IsNotFound(table.status())) return std::optional<storage::v1::References>();
  if (!table.ok()) return table.status();
  storage::v1::References references;
  int line = 0;
  for (absl::string_view text : absl::StrSplit(*table, '\n', absl::SkipWhitespace())) {
    const auto fault = [&](auto... parts) {
      return absl::InvalidArgumentError(absl::StrCat(path, ":", line, ": ", parts...));
    };
    if (++line == 1) {
      if (absl::StripAsciiWhitespace(text) != kHeader) return fault("the header is not ", kHeader);
      continue;
    }
    const absl::StatusOr<std::vector<std::string>> cells =
        ParseCsvLine(std::string(absl::StripAsciiWhitespace(text)));
    if (!cells.ok()) return fault(cells.status().message());
    const int view = references.views_size();
    if (cells->size() != 5 || view >= cell.views_size() || (*cells)[0] != cell.views(view).name()) {
      return fault("there must be one row of 5 cells per view, in the order of the cell file");
    }
    absl::StatusOr<storage::v1::Reference> reference = ReadReference(folder, *cells);
    if (!reference.ok()) return fault(reference.status().message());
    *references.add_views() = *std::move(reference);
  }
  if (references.views_size() != cell.views_size()) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": there are ", references.views_size(),
                                                   " rows for ", cell.views_size(), " views"));
  }
  return std::optional<storage::v1::References>(std::move(references));
}

}  // namespace silhouette
