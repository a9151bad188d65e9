#include <algorithm>

#include "absl/strings/str_cat.h"
#include "common/picture/line_chart.h"
#include "tools/silhouette-experiments/paper/pictures.h"
#include "tools/silhouette-experiments/paper/report.h"

namespace silhouette::paper {
namespace {

std::string TitleOf(Experiment experiment) {
  switch (experiment) {
    case Experiment::kFigure7:
      return "Figure 7: the robot occludes nothing";
    case Experiment::kFigure7Occluded:
      return "Figure 7's scene, mean over all free places of the robot";
    case Experiment::kRandom:
      return "Random scenes";
    case Experiment::kCurrentOffGrid:
      return "Random scenes, the robot between grid points";
    case Experiment::kTestOffGrid:
      return "Random scenes, tested between grid points";
  }
  return "";
}

std::vector<LineSeries> SeriesOf(std::span<const Row> rows, bool additional) {
  std::vector<LineSeries> all;
  for (size_t i = 0; i < AllPresets().size(); ++i) {
    const Preset preset = AllPresets()[i];
    LineSeries series{
        absl::StrCat(NameOf(preset), " (", NameOf(OwnThreshold(preset)), ")"), SeriesColour(i), {}};
    for (const Row& row : rows) {
      if (row.preset != preset || row.threshold != OwnThreshold(preset)) continue;
      const Spread& spread = additional ? row.additional : row.missing;
      series.points.push_back({static_cast<double>(row.views), Percent(row, spread.mean)});
    }
    if (!series.points.empty()) all.push_back(series);
  }
  return all;
}

// By method, in the order of the rows; of the hulls those with the finest voxels.
std::vector<LineSeries> SeriesOf(std::span<const MethodRow> rows, bool additional) {
  std::vector<LineSeries> all;
  const int finest =
      std::max_element(rows.begin(), rows.end(), [](const MethodRow& a, const MethodRow& b) {
        return a.voxels < b.voxels;
      })->voxels;
  for (const MethodRow& row : rows) {
    const bool shown = row.voxels == finest || row.method == NameOf(Preset::kPaper) ||
                       row.method == NameOf(Preset::kCalibrated);
    if (!shown) continue;
    if (all.empty() || all.back().name != row.method) {
      all.push_back({row.method, SeriesColour(all.size()), {}});
    }
    const Spread& spread = additional ? row.additional : row.missing;
    all.back().points.push_back({static_cast<double>(row.views),
                                 100 * spread.mean / static_cast<double>(row.configurations)});
  }
  return all;
}

}  // namespace

Picture ErrorsChart(std::span<const Row> rows, Experiment experiment, Variant variant,
                    const std::string& rig) {
  std::vector<LineChart> panels;
  for (Raster raster : {Raster::kCentre, Raster::kTouch}) {
    std::vector<Row> own;
    std::copy_if(rows.begin(), rows.end(), std::back_inserter(own), [&](const Row& row) {
      return row.experiment == experiment && row.variant == variant && row.rig == rig &&
             row.raster == raster;
    });
    if (own.empty()) continue;
    const std::string pixels =
        raster == Raster::kCentre ? "pixel centres covered" : "pixels touched";
    panels.push_back({"Additional, " + pixels, "number of cameras", "% of the configuration space",
                      SeriesOf(own, true)});
    panels.push_back({"Missing, " + pixels, "number of cameras", "% of the configuration space",
                      SeriesOf(own, false)});
  }
  if (panels.empty()) return {};
  return Draw(panels, {.title = absl::StrCat(TitleOf(experiment), " (", NameOf(variant), ", rig ",
                                             rig, ")")});
}

Picture ReconstructionChart(std::span<const MethodRow> rows, Variant variant,
                            const std::string& rig) {
  std::vector<MethodRow> own;
  std::copy_if(rows.begin(), rows.end(), std::back_inserter(own), [&](const MethodRow& row) {
    return row.experiment == "reconstruction" && row.variant == variant && row.rig == rig;
  });
  if (own.empty()) return {};
  const std::string share = "% of the configuration space";
  return Draw({{"Additional", "number of cameras", share, SeriesOf(own, true)},
               {"Missing", "number of cameras", share, SeriesOf(own, false)}},
              {.title = absl::StrCat("Reconstruction and images, random scenes (", NameOf(variant),
                                     ", rig ", rig, ", pixels touched, min_views n)")});
}

}  // namespace silhouette::paper
