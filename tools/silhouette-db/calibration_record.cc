#include "tools/silhouette-db/calibration_record.h"

#include <iostream>

#include "absl/strings/str_format.h"

namespace silhouette {

using Json = nlohmann::json;
using storage::v1::CalibrationRecord;

void PrintText(const CalibrationRecord& record) {
  if (!record.time().empty() || !record.program().empty()) {
    std::cout << absl::StreamFormat("made         %s%s%s\n", record.time(),
                                    record.program().empty() ? "" : " by ", record.program());
  }
  for (const storage::v1::CalibrationFigure& figure : record.figures()) {
    std::cout << absl::StreamFormat("figure       %s%s%s: %.4g %s\n", figure.name(),
                                    figure.of().empty() ? "" : ", ", figure.of(), figure.value(),
                                    figure.unit());
  }
  for (const std::string& warning : record.warnings()) {
    std::cout << "warning      " << warning << "\n";
  }
  if (!record.fixed_tags().empty()) {
    std::cout << absl::StreamFormat("fixed tags   %d sightings, by which a move is noticed\n",
                                    record.fixed_tags_size());
  }
}

Json JsonOf(const CalibrationRecord& record, const storage::v1::CellDescription& cell) {
  Json out = {{"time", record.time()},
              {"program", record.program()},
              {"figures", Json::array()},
              {"warnings", Json::array()},
              {"fixed_tags", Json::array()}};
  for (const storage::v1::CalibrationFigure& figure : record.figures()) {
    out["figures"].push_back({{"name", figure.name()},
                              {"of", figure.of()},
                              {"value", figure.value()},
                              {"unit", figure.unit()}});
  }
  for (const std::string& warning : record.warnings()) out["warnings"].push_back(warning);
  for (const storage::v1::FixedTag& tag : record.fixed_tags()) {
    out["fixed_tags"].push_back(
        {{"view", cell.views(tag.view()).name()}, {"family", tag.family()}, {"tag", tag.tag()}});
  }
  return out;
}

}  // namespace silhouette
