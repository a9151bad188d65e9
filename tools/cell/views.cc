// SPDX-License-Identifier: Apache-2.0
// The section `views` of cell.yaml: the stationary cameras.
#include <map>
#include <set>
#include <sstream>

#include "tools/cell/sections.h"

namespace silhouette {
namespace {

// With what files have after it, no longer than the 255 bytes of a file's name.
constexpr size_t kLongestName = 100;

MaskSize ReadMaskSize(const YamlNode& node) {
  const std::vector<int> sides = node.Values<int>(2);
  const MaskSize size{sides[0], sides[1]};
  if (!size.valid()) node.Fail("each side of a mask is 1 to 1024 pixels");
  return size;
}

ViewSettings ReadView(const YamlNode& node, const Margin& margin,
                      const std::filesystem::path& folder) {
  YamlMap map(node);
  ViewSettings view;
  view.name = map.Get<std::string>("name");
  if (view.name.empty()) node.Fail("a view needs a name");
  if (const auto source = map.Optional("source")) {
    view.source = ReadImageSource(*source, view.name, folder);
  }
  map.Read("noise", view.has_noise, [](const YamlNode& noise) {
    return noise.AsWordOf({"camera", "none"}) == 0;
  });
  const auto mask_size = map.Optional("mask_size");
  view.mask_size = mask_size ? ReadMaskSize(*mask_size) : MaskSize{64, 64};
  const auto image_size = map.Optional("image_size");
  const auto own_margin = map.Optional("margin");
  view.margin = own_margin ? ReadMargin(*own_margin) : margin;
  const std::string ignore = map.Get<std::string>("ignore", "");
  if (!ignore.empty()) view.ignore = ResolvePath(folder, ignore);
  map.Finish();
  if (!image_size) {
    if (HasImages(view.source)) node.Fail("a view with a source needs its image_size");
    view.image_width = view.mask_size.width;
    view.image_height = view.mask_size.height;
    return view;
  }
  const std::vector<int> sides = image_size->Values<int>(2);
  view.image_width = sides[0];
  view.image_height = sides[1];
  if (view.image_width < view.mask_size.width || view.image_height < view.mask_size.height) {
    image_size->Fail("the image must not be smaller than its mask");
  }
  return view;
}

}  // namespace

LengthText ReadLength(const YamlNode& node) {
  std::istringstream in(node.As<std::string>());
  LengthText length;
  std::string rest;
  if (!(in >> length.number >> length.unit) || in >> rest) return {};
  return length;
}

Margin ReadMargin(const YamlNode& node) {
  const LengthText length = ReadLength(node);
  const std::map<std::string, double> metres = {{"m", 1}, {"cm", 1e-2}, {"mm", 1e-3}};
  if (length.number >= 0) {
    if (length.unit == "px") return {.pixels = length.number};
    const auto unit = metres.find(length.unit);
    if (unit != metres.end()) return {.metres = length.number * unit->second};
  }
  node.Fail("a margin with its unit is expected, as in '2 px' or '5 cm'");
}

std::vector<ViewSettings> ReadViews(const YamlNode& node, const Margin& margin,
                                    const std::filesystem::path& folder) {
  std::vector<ViewSettings> views;
  std::set<std::string> names;
  for (const YamlNode& item : node.Items()) {
    views.push_back(ReadView(item, margin, folder));
    const std::string& name = views.back().name;
    if (!names.insert(name).second) item.Fail("there is another view called '" + name + "'");
    if (name.find('/') != std::string::npos) {
      item.Fail("a view's name has no '/': files are named by it");
    }
    if (name.size() > kLongestName) {
      item.Fail("a view's name has at most " + std::to_string(kLongestName) +
                " characters: files are named by it");
    }
  }
  if (views.empty()) node.Fail("a cell has at least one view");
  return views;
}

}  // namespace silhouette
