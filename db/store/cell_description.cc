// SPDX-License-Identifier: Apache-2.0
// What is asked of a CellDescription: the grid, the mask sizes, whether two of them fit together.
#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "db/store/store.h"

namespace silhouette {
namespace {

using storage::v1::CellDescription;

// Joint values that differ by less are the same.
constexpr double kSameValue = 1e-9;

std::string Quoted(const std::string& name) { return absl::StrCat("'", name, "'"); }

// Collects sentences "<thing>: <property> is <x> in <a>, <y> in <b>".
class Comparison {
 public:
  Comparison(std::string a_name, std::string b_name)
      : a_name_(std::move(a_name)), b_name_(std::move(b_name)) {}

  void Text(const std::string& thing, const std::string& property, const std::string& a,
            const std::string& b) {
    if (a == b) return;
    sentences_.push_back(
        absl::StrCat(thing, ": ", property, " is ", a, " in ", a_name_, ", ", b, " in ", b_name_));
  }

  void Whole(const std::string& thing, const std::string& property, int64_t a, int64_t b) {
    Text(thing, property, absl::StrCat(a), absl::StrCat(b));
  }

  void Value(const std::string& thing, const std::string& property, double a, double b) {
    if (std::abs(a - b) <= kSameValue) return;
    std::string a_text = absl::StrCat(a);
    std::string b_text = absl::StrCat(b);
    if (a_text == b_text) {  // six digits are too few
      a_text = absl::StrFormat("%.12g", a);
      b_text = absl::StrFormat("%.12g", b);
    }
    Text(thing, property, a_text, b_text);
  }

  // Whether the things number `i` of both have one name; a sentence if not.
  template <typename Things>
  bool SameName(const std::string& kind, int i, const Things& a, const Things& b) {
    const std::string a_name = i < a.size() ? Quoted(a[i].name()) : "missing";
    const std::string b_name = i < b.size() ? Quoted(b[i].name()) : "missing";
    Text(absl::StrCat(kind, " ", i + 1), "name", a_name, b_name);
    return a_name == b_name;
  }

  std::vector<std::string> Take() { return std::move(sentences_); }

 private:
  std::string a_name_;
  std::string b_name_;
  std::vector<std::string> sentences_;
};

void CompareGrids(const CellDescription& a, const CellDescription& b, Comparison& comparison) {
  const int joints = std::max(a.grid_joints_size(), b.grid_joints_size());
  for (int j = 0; j < joints; ++j) {
    if (!comparison.SameName("grid joint", j, a.grid_joints(), b.grid_joints())) continue;
    const storage::v1::GridJoint& x = a.grid_joints(j);
    const storage::v1::GridJoint& y = b.grid_joints(j);
    const std::string joint = "joint " + Quoted(x.name());
    comparison.Value(joint, "lower", x.lower(), y.lower());
    comparison.Value(joint, "upper", x.upper(), y.upper());
    comparison.Whole(joint, "steps", x.steps(), y.steps());
    comparison.Text(joint, "continuous", x.continuous() ? "true" : "false",
                    y.continuous() ? "true" : "false");
  }
  const absl::StatusOr<ConfigurationGrid> a_grid = GridOf(a);
  const absl::StatusOr<ConfigurationGrid> b_grid = GridOf(b);
  if (!a_grid.ok() || !b_grid.ok() || a_grid->dimensions() != b_grid->dimensions()) return;
  for (int j = 0; j < a_grid->dimensions(); ++j) {
    comparison.Whole("joint " + Quoted(a.grid_joints(j).name()), "tile edge",
                     a_grid->tile_edges()[static_cast<size_t>(j)],
                     b_grid->tile_edges()[static_cast<size_t>(j)]);
  }
}

void CompareFixedJoints(const CellDescription& a, const CellDescription& b,
                        Comparison& comparison) {
  const auto positions_of = [](const CellDescription& cell) {
    std::map<std::string, double> positions;
    for (const auto& joint : cell.fixed_joints()) positions[joint.name()] = joint.position();
    return positions;
  };
  const std::map<std::string, double> x = positions_of(a);
  const std::map<std::string, double> y = positions_of(b);
  std::map<std::string, double> either = x;
  either.insert(y.begin(), y.end());
  bool same_names = true;
  for (const auto& [name, position] : either) {
    const bool in_a = x.contains(name);
    const bool in_b = y.contains(name);
    const std::string joint = "fixed joint " + Quoted(name);
    if (in_a && in_b) {
      comparison.Value(joint, "position", x.at(name), y.at(name));
    } else {
      same_names = false;
      comparison.Text(joint, "position", in_a ? absl::StrCat(position) : "missing",
                      in_b ? absl::StrCat(position) : "missing");
    }
  }
  const auto order_of = [](const CellDescription& cell) {
    return absl::StrJoin(cell.fixed_joints(), ", ", [](std::string* out, const auto& joint) {
      out->append(Quoted(joint.name()));
    });
  };
  if (same_names) comparison.Text("fixed joints", "order", order_of(a), order_of(b));
}

std::string SizeText(int width, int height) { return absl::StrCat(width, "x", height); }

void CompareViews(const CellDescription& a, const CellDescription& b, Comparison& comparison) {
  for (int i = 0; i < std::max(a.views_size(), b.views_size()); ++i) {
    if (!comparison.SameName("view", i, a.views(), b.views())) continue;
    const storage::v1::View& x = a.views(i);
    const storage::v1::View& y = b.views(i);
    const std::string view = "view " + Quoted(x.name());
    comparison.Text(view, "mask size", SizeText(x.mask_width(), x.mask_height()),
                    SizeText(y.mask_width(), y.mask_height()));
    const bool both_have_images = x.image_width() > 0 && y.image_width() > 0;
    if (both_have_images) {
      comparison.Text(view, "image size", SizeText(x.image_width(), x.image_height()),
                      SizeText(y.image_width(), y.image_height()));
    }
  }
}

std::map<std::string, std::string> SegmentationLines(const std::string& text) {
  std::map<std::string, std::string> lines;
  for (absl::string_view line : absl::StrSplit(text, '\n', absl::SkipWhitespace())) {
    const std::pair<absl::string_view, absl::string_view> parts =
        absl::StrSplit(line, absl::MaxSplits(':', 1));
    lines[std::string(absl::StripAsciiWhitespace(parts.first))] =
        std::string(absl::StripAsciiWhitespace(parts.second));
  }
  return lines;
}

void CompareSegmentation(const CellDescription& a, const CellDescription& b,
                         Comparison& comparison) {
  if (a.segmentation().empty() || b.segmentation().empty()) return;  // masks made elsewhere
  std::map<std::string, std::string> x = SegmentationLines(a.segmentation());
  std::map<std::string, std::string> y = SegmentationLines(b.segmentation());
  // A description leaves out what is off.
  for (const auto& [key, value] : y) x.try_emplace(key, "off");
  for (const auto& [key, value] : x) {
    y.try_emplace(key, "off");
    comparison.Text("segmentation", key, value, y[key]);
  }
}

}  // namespace

absl::StatusOr<ConfigurationGrid> GridOf(const CellDescription& cell) {
  std::vector<GridJoint> joints;
  for (const storage::v1::GridJoint& joint : cell.grid_joints()) {
    joints.push_back({.name = joint.name(),
                      .lower = joint.lower(),
                      .upper = joint.upper(),
                      .steps = joint.steps(),
                      .continuous = joint.continuous()});
  }
  try {
    return ConfigurationGrid(std::move(joints),
                             {cell.tile_edges().begin(), cell.tile_edges().end()});
  } catch (const std::invalid_argument& error) {
    return absl::InvalidArgumentError(error.what());
  }
}

absl::StatusOr<std::vector<MaskSize>> MaskSizesOf(const CellDescription& cell) {
  std::vector<MaskSize> sizes;
  for (const storage::v1::View& view : cell.views()) {
    const MaskSize size{view.mask_width(), view.mask_height()};
    if (!size.valid()) {
      return absl::InvalidArgumentError(absl::StrCat("view '", view.name(), "': mask size ",
                                                     SizeText(size.width, size.height),
                                                     " is not within 1x1 to 1024x1024"));
    }
    sizes.push_back(size);
  }
  return sizes;
}

std::vector<std::string> Differences(const CellDescription& a, const std::string& a_name,
                                     const CellDescription& b, const std::string& b_name) {
  Comparison comparison(a_name, b_name);
  comparison.Text("cell", "name", Quoted(a.name()), Quoted(b.name()));
  CompareGrids(a, b, comparison);
  CompareFixedJoints(a, b, comparison);
  CompareViews(a, b, comparison);
  CompareSegmentation(a, b, comparison);
  return comparison.Take();
}

}  // namespace silhouette
