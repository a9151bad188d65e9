#include <algorithm>

#include "absl/strings/str_cat.h"
#include "tools/experiments/paper/pictures.h"
#include "tools/experiments/paper/report.h"
#include "tools/picture/line_chart.h"

namespace silhouette::paper {
namespace {

// The threshold that a preset has if nothing else is asked for.
Threshold OwnThreshold(Preset preset) {
  return preset == Preset::kUncalibrated ? Threshold::kAllButOne : Threshold::kAll;
}

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

}  // namespace silhouette::paper
