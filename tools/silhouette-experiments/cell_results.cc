#include "tools/silhouette-experiments/cell_results.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"
#include "tools/program/program.h"
#include "tools/program/progress.h"
#include "tools/silhouette-experiments/cell/missing_picture.h"
#include "tools/silhouette-experiments/cell/report.h"

namespace silhouette::cell_experiment {
namespace {

// Writes the pictures; their names by record and missing configuration.
absl::StatusOr<std::vector<std::vector<std::string>>> WritePictures(const Experiment& experiment,
                                                                    const std::string& folder,
                                                                    size_t count) {
  std::vector<std::vector<std::string>> names;
  for (const SceneRecord& record : experiment.records) names.emplace_back(record.missing.size());
  const std::vector<Chosen> chosen = ChooseForPictures(experiment.records, count);
  if (chosen.empty()) return names;
  const TrialSetting& setting = *experiment.setting;
  Progress progress("pictures", chosen.size(), "pictures");
  for (size_t i = 0; i < chosen.size() && !StopRequested(); ++i) {
    const SceneRecord& record = experiment.records[chosen[i].record];
    ASSIGN_OR_RETURN(const auto viewed,
                     View(setting, experiment.source(record.number), record.number));
    std::string& name = names[chosen[i].record][chosen[i].missing];
    name = absl::StrFormat("%s-%03d-%d.png", experiment.name, record.number, chosen[i].missing);
    const Picture picture = Draw(setting, viewed, record.missing[chosen[i].missing]);
    RETURN_IF_ERROR(WritePng(absl::StrCat(folder, "/", name), picture));
    progress.Update(i + 1);
  }
  return names;
}

}  // namespace

absl::Status WriteResult(const std::string& folder, const std::string& name,
                         const std::string& text) {
  if (folder.empty()) return absl::OkStatus();
  return WriteWholeFile(absl::StrCat(folder, "/", name), text);
}

absl::Status WriteExperiments(std::span<const Experiment> experiments, const std::string& folder,
                              size_t pictures) {
  if (folder.empty()) return absl::OkStatus();
  for (const Experiment& experiment : experiments) {
    if (experiment.records.empty()) continue;
    absl::Status status = WriteResult(folder, experiment.name + "-scenes.csv",
                                      ScenesCsvOf(*experiment.setting, experiment.records));
    if (!status.ok()) return status;
    ASSIGN_OR_RETURN(const auto names, WritePictures(experiment, folder, pictures));
    status = WriteResult(folder, experiment.name + "-missing.csv",
                         MissingCsvOf(*experiment.setting, experiment.records, names));
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

}  // namespace silhouette::cell_experiment
