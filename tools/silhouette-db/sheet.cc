// SPDX-License-Identifier: Apache-2.0
// silhouette-db sheet: the masks of a slice of the configuration space on one sheet.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/picture/sheet.h"
#include "db/status/status_macros.h"
#include "tools/program/joint_values.h"
#include "tools/silhouette-db/commands.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

constexpr int kMostColumns = 8;
constexpr int kMostRows = 8;
constexpr int kSheetTileSide = 128;  // about, in pixels

struct SheetArguments : DatabaseOptions {
  std::vector<std::string> along;
  std::vector<std::string> fixed;
  std::string view;
};

// Configurations along one or two joints while the others stand still.
struct Slice {
  int across = 0;              // the joint that runs from left to right
  std::optional<int> upwards;  // the joint that runs from below to above; none: one row
  GridIndex index{};           // where the others stand
  std::string others;          // the same for people; empty if there are none
};

absl::StatusOr<int> JointOf(const ConfigurationGrid& grid, const std::string& name) {
  std::vector<std::string> names;
  for (int j = 0; j < grid.dimensions(); ++j) {
    names.push_back(grid.joints()[static_cast<size_t>(j)].name);
    if (names.back() == name) return j;
  }
  return absl::InvalidArgumentError(absl::StrCat("the grid has no joint '", name,
                                                 "'; its joints are ", absl::StrJoin(names, ", ")));
}

// `along`: names of one or two joints; empty: the first two that move. `fixed`: "joint=value" for
// others; those not named stand in the middle of their range. InvalidArgument, or throws
// std::invalid_argument, for an unknown name, a joint named twice, or a value outside the grid.
absl::StatusOr<Slice> SliceOf(const ConfigurationGrid& grid, const std::vector<std::string>& along,
                              const std::vector<std::string>& fixed) {
  std::vector<int> axes;
  for (const std::string& name : along) {
    ASSIGN_OR_RETURN(const int joint, JointOf(grid, name));
    axes.push_back(joint);
  }
  if (axes.empty()) axes = MovingJoints(grid);
  if (axes.empty()) axes.push_back(0);
  if (axes.size() > 2) axes.resize(2);
  if (axes.size() == 2 && axes[0] == axes[1]) {
    return absl::InvalidArgumentError(absl::StrCat("joint '", along[0], "' is named twice"));
  }
  const auto runs = [&](int j) { return std::ranges::find(axes, j) != axes.end(); };
  Slice slice;
  slice.across = axes[0];
  if (axes.size() == 2) slice.upwards = axes[1];
  for (size_t j = 0; j < grid.joints().size(); ++j) {
    slice.index[j] = (grid.joints()[j].steps - 1) / 2;
  }
  for (const std::string& text : fixed) {
    const auto [name, value] = ParseJoint(text);
    ASSIGN_OR_RETURN(const int j, JointOf(grid, name));
    const GridJoint& joint = grid.joints()[static_cast<size_t>(j)];
    if (runs(j)) {
      return absl::InvalidArgumentError(
          absl::StrCat("joint '", name, "' cannot be fixed and run along the sheet"));
    }
    const std::optional<double> place = grid.Place(j, value);
    if (!place) {
      return absl::InvalidArgumentError(absl::StrCat(
          "joint '", name, "': ", value, " is not within ", joint.lower, " to ", joint.upper));
    }
    slice.index[static_cast<size_t>(j)] = static_cast<int>(std::lround(*place)) % joint.steps;
  }
  const Configuration q = grid.At(slice.index);
  std::vector<std::string> others;
  for (size_t j = 0; j < q.size(); ++j) {
    if (runs(static_cast<int>(j))) continue;
    others.push_back(absl::StrFormat("%s = %.4g", grid.joints()[j].name, q[j]));
  }
  slice.others = absl::StrJoin(others, ", ");
  return slice;
}

// At most `most` of 0..steps-1, evenly spread, first and last among them.
std::vector<int> Spread(int steps, int most) {
  const int count = std::min(steps, most);
  std::vector<int> chosen;
  for (int i = 0; i < count; ++i) chosen.push_back(count == 1 ? 0 : i * (steps - 1) / (count - 1));
  return chosen;
}

// The mask of a view at a configuration, or a plain square in the colour of what is there instead.
absl::StatusOr<Picture> SheetTile(const OpenedDatabase& opened, ConfigurationNumber number,
                                  int view) {
  const MaskSize size = opened.database->mask_sizes()[static_cast<size_t>(view)];
  const int side = std::max(size.width, size.height);
  const auto image = opened.snapshot.Find(number);
  if (!image.ok() && !absl::IsDataLoss(image.status())) return image.status();
  Picture picture;
  if (image.ok() && *image && !(*image)->excluded) {
    picture = PictureOf((*image)->masks[static_cast<size_t>(view)], palette::kRobot);
  } else {
    picture = BlankPicture(size.width, size.height,
                           !image.ok() ? palette::kDamaged
                           : !*image   ? palette::kPaper
                                       : palette::kExcluded);
  }
  if (side <= kSheetTileSide)
    return Enlarged(picture, std::max(1, (kSheetTileSide + side / 2) / side));
  return FittedInto(picture, kSheetTileSide * size.width / side,
                    kSheetTileSide * size.height / side);
}

// The sheet's row: a joint's value, or, along one joint only, a view.
struct Row {
  std::string name;
  int view = 0;
  std::optional<int> step;
};

std::vector<Row> RowsOf(const Database& database, const Slice& slice, int view, bool all_views) {
  std::vector<Row> rows;
  if (slice.upwards) {
    const GridJoint& joint = database.grid().joints()[static_cast<size_t>(*slice.upwards)];
    const std::vector<int> steps = Spread(joint.steps, kMostRows);
    for (auto step = steps.rbegin(); step != steps.rend(); ++step) {
      rows.push_back({absl::StrFormat("%.2f", joint.lower + *step * joint.step()), view, *step});
    }
    return rows;
  }
  for (int i = 0; i < database.cell().views_size(); ++i) {
    if (all_views || i == view) rows.push_back({database.cell().views(i).name(), i, std::nullopt});
  }
  return rows;
}

std::string TitleOf(const Database& database, const Slice& slice, int view) {
  const auto name = [&](int j) { return database.grid().joints()[static_cast<size_t>(j)].name; };
  std::string title = absl::StrCat(name(slice.across), " to the right");
  if (slice.upwards) {
    title = absl::StrCat("View ", database.cell().views(view).name(), ": ", title, ", ",
                         name(*slice.upwards), " upwards");
  }
  if (!slice.others.empty()) absl::StrAppend(&title, "; ", slice.others);
  return title;
}

absl::StatusOr<ExitCode> Sheet(const SheetArguments& options) {
  ASSIGN_OR_RETURN(const OpenedDatabase opened, OpenForReading(options.database, options.variant));
  const Database& database = *opened.database;
  const ConfigurationGrid& grid = database.grid();
  ASSIGN_OR_RETURN(const Slice slice, SliceOf(grid, options.along, options.fixed));
  ASSIGN_OR_RETURN(const int view, ViewOf(database.cell(), options.view));

  const GridJoint& across = grid.joints()[static_cast<size_t>(slice.across)];
  const std::vector<int> columns = Spread(across.steps, kMostColumns);
  std::vector<CaptionedPicture> pictures;
  for (const Row& row : RowsOf(database, slice, view, options.view.empty())) {
    for (int column : columns) {
      GridIndex index = slice.index;
      index[static_cast<size_t>(slice.across)] = column;
      if (row.step) index[static_cast<size_t>(*slice.upwards)] = *row.step;
      ASSIGN_OR_RETURN(const Picture tile, SheetTile(opened, grid.NumberOf(index), row.view));
      const std::string value = absl::StrFormat("%.2f", across.lower + column * across.step());
      pictures.push_back({tile, row.step ? absl::StrCat(value, ", ", row.name)
                                         : absl::StrCat(row.name, " ", value)});
    }
  }
  const Picture sheet = ContactSheet(pictures, {.title = TitleOf(database, slice, view),
                                                .columns = static_cast<int>(columns.size()),
                                                .legend = {{palette::kRobot, "robot"},
                                                           {palette::kPaper, "missing"},
                                                           {palette::kExcluded, "excluded"},
                                                           {palette::kDamaged, "damaged"}}});
  RETURN_IF_ERROR(WritePng(options.picture, sheet));
  std::cout << options.picture << std::endl;
  return kDone;
}

}  // namespace

void AddSheet(CLI::App& app, Work& work) {
  auto [command, options] =
      AddCommand(app, work, "sheet", "The masks along one or two joints on one sheet", Sheet);
  AddVariantOption(command, options.variant);
  AddPictureOption(command, options.picture, "The PNG file to write")->required();
  command
      .add_option("--along", options.along, "One or two joints; by default the first two that move")
      ->expected(1, 2);
  command
      .add_option("--fix", options.fixed,
                  "joint=value of the others; those not named stand in their middle")
      ->take_all();
  command.add_option("--view", options.view,
                     "Along two joints: this view instead of the first; along one: only this one");
  command.footer(
      "Example:\n"
      "  silhouette-db sheet cell.lmdb --along axis_1 axis_3 --fix axis_5=0.5 --picture sheet.png");
}

}  // namespace silhouette
