// SPDX-License-Identifier: Apache-2.0
#include "tools/cell/segmentation_text.h"

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "tools/cell/sections.h"

namespace silhouette {
namespace {

absl::StatusOr<SegmentationSettings> Read(const std::string& yaml, const std::string& source,
                                          const SegmentationSettings& usual) {
  try {
    return ReadSegmentation(YamlNode::FromText(yaml, source), usual);
  } catch (const YamlError& error) {
    return absl::InvalidArgumentError(error.what());
  }
}

}  // namespace

absl::StatusOr<SegmentationSettings> SegmentationIn(const std::string& text,
                                                    const std::string& source,
                                                    const SegmentationSettings& usual) {
  const absl::string_view words = absl::StripAsciiWhitespace(text);
  const bool braces = absl::StartsWith(words, "{");
  return Read(braces ? std::string(words) : absl::StrCat("{", words, "}"), source, usual);
}

absl::StatusOr<SegmentationSettings> SegmentationOf(const storage::v1::CellDescription& cell) {
  if (cell.segmentation().empty()) {
    return absl::NotFoundError("the database's masks were made elsewhere: it has no settings");
  }
  return Read(cell.segmentation(), "the database's settings", LeftOutOfDescriptions());
}

std::string SegmentationAdvice(const SegmentationSettings& of_cell_file,
                               const storage::v1::CellDescription& database) {
  const absl::StatusOr<SegmentationSettings> settings = SegmentationOf(database);
  if (!settings.ok() || Describe(*settings) == Describe(of_cell_file)) return "";
  return absl::StrCat("; for the database's settings write '", CellFileLine(*settings),
                      "' into the cell file; for the cell file's make the masks again from kept "
                      "camera images: 'silhouette-capture remask'");
}

}  // namespace silhouette
