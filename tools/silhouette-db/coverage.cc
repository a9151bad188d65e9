// SPDX-License-Identifier: Apache-2.0
// silhouette-db coverage: which configurations are there.
#include <algorithm>
#include <array>
#include <memory>
#include <nlohmann/json.hpp>
#include <unordered_map>

#include "absl/strings/str_format.h"
#include "common/numbers/numbers.h"
#include "common/picture/chart.h"
#include "common/picture/sheet.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/silhouette-db/commands.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

constexpr int kMostSlices = 24;

enum State : uint8_t { kMissing, kCaptured, kExcluded, kDamaged };
constexpr size_t kStates = 4;

std::vector<LegendEntry> StateClasses() {
  return {{palette::kMissing, "missing"},
          {palette::kCaptured, "captured"},
          {palette::kExcluded, "excluded"},
          {palette::kDamaged, "damaged"}};
}

// Of configurations that have a record.
using States = std::unordered_map<ConfigurationNumber, State>;

// The states of the slice along joint `x` and, unless it is -1, joint `y`.
std::vector<uint8_t> CellsOf(const ConfigurationGrid& grid, const States& states, int x, int y,
                             GridIndex index) {
  const auto steps = [&](int j) { return j < 0 ? 1 : grid.joints()[static_cast<size_t>(j)].steps; };
  std::vector<uint8_t> cells;
  for (int b = 0; b < steps(y); ++b) {
    if (y >= 0) index[static_cast<size_t>(y)] = b;
    for (int a = 0; a < steps(x); ++a) {
      index[static_cast<size_t>(x)] = a;
      const auto found = states.find(grid.NumberOf(index));
      cells.push_back(found == states.end() ? kMissing : found->second);
    }
  }
  return cells;
}

ChartAxis AxisOf(const ConfigurationGrid& grid, int j) {
  if (j < 0) return {.label = "", .unit = "", .cells = 1};
  const GridJoint& joint = grid.joints()[static_cast<size_t>(j)];
  return {.label = joint.name,
          .unit = "rad or m",  // the grid does not know which
          .first = joint.lower,
          .last = joint.lower + joint.step() * (joint.steps - 1),
          .cells = joint.steps};
}

Picture Chart(const ConfigurationGrid& grid, const States& states, int x, int y) {
  ConfigurationChart chart;
  chart.title = "Configurations in the database";
  chart.x = AxisOf(grid, x);
  chart.y = AxisOf(grid, y);
  chart.classes = StateClasses();
  chart.cells = CellsOf(grid, states, x, y, {});
  return Draw(chart);
}

// One small picture per value of joint `z`.
Picture Slices(const ConfigurationGrid& grid, const States& states, int x, int y, int z) {
  const std::vector<LegendEntry> classes = StateClasses();
  const GridJoint& along = grid.joints()[static_cast<size_t>(z)];
  const int width = grid.joints()[static_cast<size_t>(x)].steps;
  const int height = grid.joints()[static_cast<size_t>(y)].steps;
  const int slices = std::min(along.steps, kMostSlices);
  std::vector<CaptionedPicture> pictures;
  for (int i = 0; i < slices; ++i) {
    GridIndex index{};
    const int step = slices == 1 ? 0 : i * (along.steps - 1) / (slices - 1);
    index[static_cast<size_t>(z)] = step;
    const std::vector<uint8_t> cells = CellsOf(grid, states, x, y, index);
    Picture picture = BlankPicture(width, height);
    for (int b = 0; b < height; ++b) {
      for (int a = 0; a < width; ++a) {
        const Colour colour = classes[cells[static_cast<size_t>(b * width + a)]].colour;
        picture.at<cv::Vec3b>(height - 1 - b, a) = {colour.blue, colour.green, colour.red};
      }
    }
    pictures.push_back(
        {EnlargedTo(160, picture),
         absl::StrFormat("%s = %.4g", along.name, along.lower + step * along.step())});
  }
  return ContactSheet(pictures,
                      {.title = absl::StrFormat("Configurations in the database: %s to the right, "
                                                "%s upwards",
                                                grid.joints()[static_cast<size_t>(x)].name,
                                                grid.joints()[static_cast<size_t>(y)].name),
                       .columns = 0,
                       .legend = classes});
}

absl::StatusOr<Picture> CoveragePaint(const ConfigurationGrid& grid, const States& states) {
  std::vector<int> moving = MovingJoints(grid);
  if (moving.empty()) moving.push_back(0);
  if (moving.size() > 3) {
    return absl::InvalidArgumentError(
        absl::StrFormat("a picture shows the coverage of at most 3 joints, this grid has %d that "
                        "move; leave --picture away",
                        moving.size()));
  }
  if (moving.size() == 1) return Chart(grid, states, moving[0], -1);
  if (moving.size() == 2) return Chart(grid, states, moving[0], moving[1]);
  // The joint with the fewest values runs over the slices.
  std::stable_sort(moving.begin(), moving.end(), [&](int a, int b) {
    return grid.joints()[static_cast<size_t>(a)].steps >
           grid.joints()[static_cast<size_t>(b)].steps;
  });
  return Slices(grid, states, moving[0], moving[1], moving[2]);
}

absl::StatusOr<ExitCode> Coverage(const DatabaseOptions& options) {
  ASSIGN_OR_RETURN(const OpenedDatabase opened, OpenForReading(options.database, options.variant));
  const ConfigurationGrid& grid = opened.database->grid();
  std::array<uint64_t, kStates> counts{};
  counts[kMissing] = grid.size();
  States states;  // for the picture
  const auto visit = [&](ConfigurationNumber number, const absl::StatusOr<RobotImage>& image) {
    const State state = !image.ok() ? kDamaged : image->excluded ? kExcluded : kCaptured;
    --counts[kMissing];
    ++counts[state];
    if (!options.picture.empty()) states[number] = state;
    return true;
  };
  const absl::Status status = opened.snapshot.ForEach(visit);
  if (!status.ok() && !absl::IsDataLoss(status)) return status;
  if (!options.picture.empty()) {
    ASSIGN_OR_RETURN(const Picture picture, CoveragePaint(grid, states));
    RETURN_IF_ERROR(WritePng(options.picture, picture));
  }
  std::string text;
  nlohmann::ordered_json json = {{"configurations", grid.size()}};
  for (const auto& [name, state] : {std::pair("captured", kCaptured),
                                    {"excluded", kExcluded},
                                    {"damaged", kDamaged},
                                    {"missing", kMissing}}) {
    json[name] = counts[state];
    absl::StrAppendFormat(&text, "%-10s %12d  %6.2f %%\n", name, counts[state],
                          Percent(counts[state], grid.size()));
  }
  PrintResult(options.format, json, text);
  return kDone;
}

}  // namespace

void AddCoverage(CLI::App& app, Work& work) {
  auto [command, options] =
      AddCommand(app, work, "coverage", "Which configurations are in a database", Coverage);
  AddVariantOption(command, options.variant);
  AddPictureOption(command, options.picture,
                   "Write a picture of them to this PNG file; for 1 to 3 joints that move");
  AddFormatOption(command, options.format);
  command.footer("Example:\n  silhouette-db coverage cell.lmdb --picture coverage.png");
}

}  // namespace silhouette
