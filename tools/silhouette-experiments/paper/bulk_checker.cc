// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-experiments/paper/bulk_checker.h"

#include <array>
#include <map>
#include <stdexcept>

namespace silhouette::paper {

TransposedImages::TransposedImages(std::span<const Mask> images) : configurations_(images.size()) {
  if (images.empty()) throw std::invalid_argument("there are no images to transpose");
  mask_size_ = images[0].size();
  bits_.assign(mask_size_.pixels() * words(), 0);
  for (size_t i = 0; i < images.size(); ++i) {
    if (images[i].size() != mask_size_) {
      throw std::invalid_argument("images to transpose are of different sizes");
    }
    ForEachPixel(images[i].words(),
                 [&](size_t pixel) { bits_[pixel * words() + i / 64] |= uint64_t{1} << (i % 64); });
  }
}

LineTable::LineTable(const EpipolarBands& bands, int view, int other) {
  const MaskSize size = bands.mask_sizes()[static_cast<size_t>(other)];
  words_ = size.words();
  std::map<std::array<uint16_t, 4>, uint16_t> numbers;
  for (const EpipolarBands::Runs& runs : bands.runs(view, other)) {
    const auto pixel = static_cast<int>(line_of_.size());
    const std::array<uint16_t, 4> key = {runs[0].begin, runs[0].end, runs[1].begin, runs[1].end};
    const auto [found, is_new] = numbers.try_emplace(key, static_cast<uint16_t>(numbers.size()));
    line_of_.push_back(found->second);
    if (!is_new) continue;
    masks_.resize(masks_.size() + words_, 0);
    uint64_t* const mask = masks_.data() + masks_.size() - words_;
    for (size_t q = 0; q < size.pixels(); ++q) {
      if (bands.Meet(view, pixel, other, static_cast<int>(q))) {
        mask[q / 64] |= uint64_t{1} << (q % 64);
      }
    }
  }
}

LineTables::LineTables(const EpipolarBands& bands) : views_(bands.views()) {
  for (int view = 0; view < views_; ++view) {
    for (int other = 0; other < views_; ++other) {
      tables_.push_back(view == other ? nullptr
                                      : std::make_unique<const LineTable>(bands, view, other));
    }
  }
}

BulkChecker::BulkChecker(const LineTables& lines) : lines_(lines) {
  const auto views = static_cast<size_t>(lines.views());
  if (lines.views() > kMostViews) throw std::invalid_argument("there are too many views");
  line_places_.resize(views * views);
  direct_.resize(views);
  for (auto& showing : showing_) {
    showing.assign(views, std::vector<ConfigurationSet>(size_t{1} << views));
  }
  all_something_.resize(size_t{1} << views);
  any_convicting_.resize(size_t{1} << views);
}

void BulkChecker::Look(std::span<const ObstacleImage> images,
                       std::span<const TransposedImages> robot) {
  const auto views = static_cast<size_t>(lines_.views());
  if (images.size() != views || robot.size() != views) {
    throw std::invalid_argument("there must be one obstacle image and one set of images per view");
  }
  images_ = images;
  robot_ = robot;
  somethings_.resize(views);
  convictions_.resize(views);
  lines_used_ = 0;
  for (int view = 0; view < lines_.views(); ++view) {
    const auto i = static_cast<size_t>(view);
    const Mask something = images[i].obstacle() | images[i].unknown() | images[i].error();
    const Mask convicting = images[i].obstacle() | images[i].error();
    somethings_[i].assign(something.words().begin(), something.words().end());
    convictions_[i].assign(convicting.words().begin(), convicting.words().end());
    direct_[i].assign(robot[i].words(), 0);
    ForEachPixel(images[i].obstacle().words(),
                 [&](size_t pixel) { Add(direct_[i], robot[i].Covering(pixel)); });
    for (auto& showing : showing_) {
      for (ConfigurationSet& set : showing[i]) set = direct_[i];
    }
    for (size_t other = 0; other < views; ++other) {
      if (other == i) continue;
      line_places_[i * views + other].assign(lines_.Between(view, static_cast<int>(other)).lines(),
                                             -1);
    }
  }
  for (int view = 0; view < lines_.views(); ++view) {
    const auto i = static_cast<size_t>(view);
    const Mask unresolved = images[i].unknown() | images[i].error();
    ForEachPixel(unresolved.words(), [&](size_t pixel) {
      const ConfigurationWords covering = robot[i].Covering(pixel);
      ResolveInIntersections(view, pixel, covering);
      ResolveInObstacleImages(view, pixel, covering);
    });
  }
}

const BulkChecker::Line& BulkChecker::LineIn(int view, int other, size_t pixel) {
  const LineTable& table = lines_.Between(view, other);
  const size_t line = table.LineOf(pixel);
  int& place = line_places_[static_cast<size_t>(view * lines_.views() + other)][line];
  if (place >= 0) return line_memory_[static_cast<size_t>(place)];
  place = static_cast<int>(lines_used_++);
  if (line_memory_.size() < lines_used_) line_memory_.resize(2 * lines_used_);
  const auto j = static_cast<size_t>(other);
  const TransposedImages& robot = robot_[j];
  Line& found = line_memory_[static_cast<size_t>(place)];
  found.something.assign(robot.words(), 0);
  const MaskWords band = table.Band(line);
  const MaskWords obstacle = images_[j].obstacle().words();
  const auto add = [&](size_t word, uint64_t bits) {
    for (; bits != 0; bits &= bits - 1) {
      const size_t bit = static_cast<size_t>(std::countr_zero(bits));
      Add(found.something, robot.Covering(word * 64 + bit));
    }
  };
  for (size_t word = 0; word < band.size(); ++word) add(word, band[word] & obstacle[word]);
  found.convicting = found.something;
  for (size_t word = 0; word < band.size(); ++word) {
    add(word, band[word] & somethings_[j][word] & ~obstacle[word]);
  }
  return found;
}

void BulkChecker::ResolveInIntersections(int view, size_t pixel, ConfigurationWords covering) {
  const size_t words = covering.size();
  const ViewSet self = ViewSet{1} << view;
  const ViewSet limit = ViewSet{1} << lines_.views();
  all_something_[0].assign(words, ~uint64_t{0});
  any_convicting_[0].assign(words, 0);
  for (ViewSet others = 1; others < limit; ++others) {
    if ((others & self) != 0) continue;
    const ViewSet rest = others & (others - 1);
    const Line& line = LineIn(view, std::countr_zero(others), pixel);
    all_something_[others].resize(words);
    any_convicting_[others].resize(words);
    const uint64_t* const something = line.something.data();
    const uint64_t* const convicting = line.convicting.data();
    const uint64_t* const rest_something = all_something_[rest].data();
    const uint64_t* const rest_convicting = any_convicting_[rest].data();
    uint64_t* const all = all_something_[others].data();
    uint64_t* const any = any_convicting_[others].data();
    uint64_t* const showing = ShowingIn(kIntersection, view, others | self).data();
    for (size_t i = 0; i < words; ++i) {
      all[i] = rest_something[i] & something[i];
      any[i] = rest_convicting[i] | convicting[i];
      showing[i] |= covering[i] & all[i] & any[i];
    }
  }
}

void BulkChecker::ResolveInObstacleImages(int view, size_t pixel, ConfigurationWords covering) {
  ViewSet background = 0;  // views in which the pixel's line is all background
  ViewSet convicting = 0;
  for (int other = 0; other < lines_.views(); ++other) {
    if (other == view) continue;
    const LineTable& table = lines_.Between(view, other);
    const MaskWords band = table.Band(table.LineOf(pixel));
    const auto j = static_cast<size_t>(other);
    if (!Intersects(band, somethings_[j])) background |= ViewSet{1} << other;
    if (Intersects(band, convictions_[j])) convicting |= ViewSet{1} << other;
  }
  const ViewSet self = ViewSet{1} << view;
  for (ViewSet views = 1; views < ViewSet{1} << lines_.views(); ++views) {
    if ((views & self) == 0 || (views & background) != 0 || (views & convicting) == 0) continue;
    Add(ShowingIn(kObstacle, view, views), covering);
  }
}

ConfigurationWords BulkChecker::Showing(Preset preset, int view, ViewSet views) const {
  const auto i = static_cast<size_t>(view);
  if (!IsCalibrated(preset)) return direct_[i];
  return showing_[preset == Preset::kCalibrated ? kIntersection : kObstacle][i][views];
}

ConfigurationSet BulkChecker::Occupied(Preset preset, ViewSet views, int min_views) const {
  std::vector<ConfigurationWords> sets;
  for (int view = 0; view < lines_.views(); ++view) {
    if ((views >> view & 1) != 0) sets.push_back(Showing(preset, view, views));
  }
  return AtLeast(min_views, sets);
}

std::vector<ViewSet> SetsOf(int count, int views) {
  std::vector<ViewSet> sets;
  for (ViewSet set = 1; set < ViewSet{1} << views; ++set) {
    if (std::popcount(set) == count) sets.push_back(set);
  }
  return sets;
}

ConfigurationSet AtLeast(int least, std::span<const ConfigurationWords> sets) {
  ConfigurationSet found(sets.empty() ? 0 : sets[0].size(), 0);
  std::vector<uint64_t> reached(static_cast<size_t>(least) + 1);
  for (size_t word = 0; word < found.size(); ++word) {
    reached.assign(reached.size(), 0);
    reached[0] = ~uint64_t{0};
    for (ConfigurationWords set : sets) {
      for (size_t k = reached.size() - 1; k > 0; --k) reached[k] |= reached[k - 1] & set[word];
    }
    found[word] = reached.back();
  }
  return found;
}

}  // namespace silhouette::paper
