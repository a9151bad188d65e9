// SPDX-License-Identifier: Apache-2.0
#include "capture/verification/model_comparison.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/robot/drawn_cell.h"
#include "capture/verification/growth_fit.h"
#include "capture/verification/mask_shift.h"
#include "capture/verification/unmoved_joints.h"

namespace silhouette {
namespace {

// The number of samples on which the cost of a growth is counted: a tenth of it is exact enough.
constexpr size_t kCostSamples = 24;
// A robot with fewer pixels says nothing of a shift.
constexpr size_t kLeastForShift = 20;
// Fewer pixels say nothing of a link.
constexpr uint64_t kLeastOfLink = 100;
constexpr size_t kMostWorst = 8;
// Share of a view's masks.
constexpr double kMostlyDrawn = 0.1;

// Of the number of configurations that are enough.
constexpr double kSafely = 1.5;
constexpr double kMostSensible = 1e6;
// Masks that lack a pixel. Where fewer are permitted, too few are held out: that none of them lacks
// one says only that fewer than 3 of as many others do (95 % confidence).
constexpr double kLeastExpected = 3;
constexpr double kFurtherOfFew = 0.005;  // metres

// A pixel of a mask that is captured and not drawn.
struct MissingPixel {
  size_t sample = 0;
  size_t view = 0;
  int x = 0;
  int y = 0;
  GrowthFit::Needs needs;
  bool noise = false;
};

std::vector<cv::Point> PixelsOf(const Mask& mask) {
  std::vector<cv::Point> pixels;
  for (int y = 0; y < mask.height(); ++y) {
    for (int x = 0; x < mask.width(); ++x) {
      if (mask.at(x, y)) pixels.emplace_back(x, y);
    }
  }
  return pixels;
}

// Draws single links.
class LinkDrawer {
 public:
  explicit LinkDrawer(const DrawnRobot& robot) : robot_(robot) {}

  void At(std::span<const double> q) { robot_.chain().Pose(q, poses_); }

  Mask Touched(size_t view, size_t link, double growth) {
    return Draw(view, link, [&](size_t i, std::span<uint64_t> words) {
      const RobotPart& part = robot_.parts()[i];
      robot_.views()[view].AddTouched(poses_[part.moves_with], part.points, robot_.edges()[i],
                                      part.radius + growth, scratch_, words);
    });
  }
  Mask Covered(size_t view, size_t link) {
    return Draw(view, link, [&](size_t i, std::span<uint64_t> words) {
      const RobotPart& part = robot_.parts()[i];
      if (part.inner.cols() == 0) return;
      robot_.views()[view].AddCovered(poses_[part.moves_with], part.inner, scratch_, words);
    });
  }
  // By link: its growth.
  Mask Grown(size_t view, const std::vector<double>& growth) {
    const MaskSize size = robot_.views()[view].size();
    Mask all(size);
    for (size_t link = 0; link < growth.size(); ++link) {
      all = all | Touched(view, link, growth[link]);
    }
    return all;
  }

 private:
  template <typename Add>
  Mask Draw(size_t view, size_t link, const Add& add) {
    const MaskSize size = robot_.views()[view].size();
    std::vector<uint64_t> words(size.words());
    for (size_t i = 0; i < robot_.parts().size(); ++i) {
      if (robot_.parts()[i].link == link) add(i, words);
    }
    return Mask::FromWords(size, std::move(words));
  }

  const DrawnRobot& robot_;
  std::vector<Eigen::Isometry3d> poses_;
  DrawingScratch scratch_;
};

// The connected area of `mask` with a pixel, or as many pixels of it as `most` + 1.
size_t AreaAt(const Mask& mask, int x, int y, size_t most) {
  std::vector<cv::Point> area = {{x, y}};
  for (size_t i = 0; i < area.size() && area.size() <= most; ++i) {
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const cv::Point next(area[i].x + dx, area[i].y + dy);
        if (next.x < 0 || next.y < 0 || next.x >= mask.width() || next.y >= mask.height()) continue;
        if (mask.at(next.x, next.y) && std::ranges::find(area, next) == area.end()) {
          area.push_back(next);
        }
      }
    }
  }
  return area.size();
}

// One comparison. Goes once.
class Comparing {
 public:
  Comparing(const DrawnRobot& bare, std::span<const std::string> link_names,
            std::span<const std::string> view_names, std::span<const ModelSample> samples,
            const ComparisonSettings& settings, const std::function<void(uint64_t)>& progress);

  ModelComparison Go();

 private:
  size_t links() const { return link_names_.size(); }
  double GrowthOf(int steps) const { return steps * settings_.growth_step; }
  // Rounded up.
  int StepsOf(double growth) const {
    return static_cast<int>(std::ceil(growth / settings_.growth_step - 1e-9));
  }
  void Compare(size_t sample, size_t view);
  void CompareCertain(size_t sample, size_t view);
  void FindNeeds(size_t sample, size_t view, const Mask& missing);
  GrowthFit::Costs FindCosts();
  void Fit();
  int HoldOut(const std::vector<int>& fitted, const std::vector<int>& steps);
  void CountAdded();
  void Judge();
  void JudgeView(size_t view);
  std::string NearestLink(size_t view) const;

  const DrawnRobot& bare_;
  const std::span<const std::string> link_names_;
  const std::span<const std::string> view_names_;
  const std::span<const ModelSample> samples_;
  const ComparisonSettings& settings_;
  const std::function<void(uint64_t)>& progress_;
  const int steps_;
  LinkDrawer drawer_;
  std::vector<Mask> ever_captured_;  // by view
  std::vector<MissingPixel> missing_;
  std::vector<double> amounts_;  // sums, by view
  std::vector<uint64_t> shifts_;
  uint64_t drawn_ = 0;  // pixels without growth
  uint64_t done_ = 0;
  ModelComparison result_;
};

Comparing::Comparing(const DrawnRobot& bare, std::span<const std::string> link_names,
                     std::span<const std::string> view_names, std::span<const ModelSample> samples,
                     const ComparisonSettings& settings,
                     const std::function<void(uint64_t)>& progress)
    : bare_(bare),
      link_names_(link_names),
      view_names_(view_names),
      samples_(samples),
      settings_(settings),
      progress_(progress),
      steps_(GrowthSteps(settings)),
      drawer_(bare) {
  const size_t views = bare.views().size();
  for (const RobotPart& part : bare.parts()) {
    if (part.link >= links()) throw std::invalid_argument("a part is of a link without a name");
  }
  for (const ModelSample& sample : samples) {
    bool fits = sample.q.size() == bare.chain().joints().size() && sample.captured.size() == views;
    for (size_t view = 0; fits && view < views; ++view) {
      fits = sample.captured[view].size() == bare.views()[view].size();
    }
    if (!fits) throw std::invalid_argument("a captured configuration is not of this robot");
  }
  result_.views.resize(views);
  result_.links.resize(links());
  amounts_.resize(views);
  shifts_.resize(views);
  for (size_t view = 0; view < views; ++view) {
    Mask ever(bare.views()[view].size());
    for (const ModelSample& sample : samples) ever = ever | sample.captured[view];
    ever_captured_.push_back(std::move(ever));
  }
}

ModelComparison Comparing::Go() {
  for (size_t i = 0; i < samples_.size(); ++i) {
    drawer_.At(samples_[i].q);
    for (size_t view = 0; view < result_.views.size(); ++view) {
      Compare(i, view);
      progress_(++done_);
    }
  }
  for (size_t view = 0; view < result_.views.size(); ++view) {
    if (shifts_[view] == 0) continue;
    const auto count = static_cast<double>(shifts_[view]);
    result_.views[view].mean_shift /= count;
    result_.views[view].mean_amount = amounts_[view] / count;
  }
  Fit();
  CountAdded();
  std::ranges::stable_sort(result_.worst, [](const WorstMask& a, const WorstMask& b) {
    return a.missing + a.uncaptured > b.missing + b.uncaptured;
  });
  if (result_.worst.size() > kMostWorst) result_.worst.resize(kMostWorst);
  Judge();
  return std::move(result_);
}

void Comparing::Compare(size_t sample, size_t view) {
  const Mask& captured = samples_[sample].captured[view];
  const Mask drawn = drawer_.Grown(view, std::vector<double>(links()));
  ComparedView& compared = result_.views[view];
  drawn_ += drawn.Count();
  compared.captured += captured.Count();
  result_.worst.push_back({.sample = sample, .view = view});
  if (drawn.Count() >= kLeastForShift && captured.Count() >= kLeastForShift) {
    const Eigen::Vector2d shift = ShiftOf(captured, drawn);
    compared.mean_shift += shift;
    amounts_[view] += shift.norm();
    ++shifts_[view];
  }
  CompareCertain(sample, view);
  const Mask missing = captured - drawn;
  if (missing.Empty()) return;
  compared.missing += missing.Count();
  ++compared.missing_by;
  result_.worst.back().missing = missing.Count();
  FindNeeds(sample, view, missing);
}

void Comparing::CompareCertain(size_t sample, size_t view) {
  const Mask& captured = samples_[sample].captured[view];
  Mask certain(captured.size());
  std::vector<Mask> touched;
  for (size_t link = 0; link < links(); ++link) touched.push_back(drawer_.Touched(view, link, 0));
  for (size_t link = 0; link < links(); ++link) {
    const Mask all = drawer_.Covered(view, link);
    Mask of_link = all & ever_captured_[view];
    for (size_t other = 0; other < links(); ++other) {
      if (other != link) of_link = of_link - touched[other];
    }
    result_.links[link].certain += of_link.Count();
    result_.links[link].uncaptured += (of_link - captured).Count();
    certain = certain | all;
  }
  const Mask seen = certain & ever_captured_[view];
  const uint64_t uncaptured = (seen - captured).Count();
  result_.views[view].hidden += (certain - ever_captured_[view]).Count();
  result_.views[view].certain += seen.Count();
  result_.views[view].uncaptured += uncaptured;
  result_.worst.back().uncaptured = uncaptured;
}

void Comparing::FindNeeds(size_t sample, size_t view, const Mask& missing) {
  const Mask& captured = samples_[sample].captured[view];
  const std::vector<cv::Point> pixels = PixelsOf(missing);
  const auto none = static_cast<uint8_t>(steps_ + 1);
  std::vector<GrowthFit::Needs> needs(pixels.size(), GrowthFit::Needs(links(), none));
  for (size_t link = 0; link < links(); ++link) {
    const Mask most = drawer_.Touched(view, link, GrowthOf(steps_));
    const bool reaches = std::ranges::any_of(
        pixels, [&](const cv::Point& pixel) { return most.at(pixel.x, pixel.y); });
    size_t left = reaches ? pixels.size() : 0;
    for (int k = 1; k <= steps_ && left > 0; ++k) {
      const Mask grown = drawer_.Touched(view, link, GrowthOf(k));
      for (size_t i = 0; i < pixels.size(); ++i) {
        if (needs[i][link] != none || !grown.at(pixels[i].x, pixels[i].y)) continue;
        needs[i][link] = static_cast<uint8_t>(k);
        --left;
      }
    }
  }
  for (size_t i = 0; i < pixels.size(); ++i) {
    const bool reached =
        std::ranges::any_of(needs[i], [&](uint8_t need) { return need <= steps_; });
    const bool noise =
        !reached && AreaAt(captured, pixels[i].x, pixels[i].y, settings_.most_noise_pixels) <=
                        settings_.most_noise_pixels;
    if (!reached) ++(noise ? result_.views[view].noise : result_.views[view].unreached);
    missing_.push_back({.sample = sample,
                        .view = view,
                        .x = pixels[i].x,
                        .y = pixels[i].y,
                        .needs = std::move(needs[i]),
                        .noise = noise});
  }
}

// The costs of a link that reaches no missing pixel stay 0: it does not grow.
GrowthFit::Costs Comparing::FindCosts() {
  GrowthFit::Costs costs(links(), std::vector<double>(static_cast<size_t>(steps_) + 1));
  std::vector<bool> reaches(links());
  for (const MissingPixel& pixel : missing_) {
    for (size_t link = 0; link < links(); ++link) {
      if (pixel.needs[link] <= steps_) reaches[link] = true;
    }
  }
  const size_t stride = std::max<size_t>(1, samples_.size() / kCostSamples);
  for (size_t i = 0; i < samples_.size(); i += stride) {
    drawer_.At(samples_[i].q);
    for (size_t view = 0; view < result_.views.size(); ++view) {
      const Mask drawn = drawer_.Grown(view, std::vector<double>(links()));
      for (size_t link = 0; link < links(); ++link) {
        for (int k = 1; reaches[link] && k <= steps_; ++k) {
          const Mask added = drawer_.Touched(view, link, GrowthOf(k)) - drawn;
          costs[link][static_cast<size_t>(k)] += static_cast<double>(stride * added.Count());
        }
      }
    }
  }
  return costs;
}

void Comparing::Fit() {
  GrowthFit half(steps_, FindCosts());
  GrowthFit all = half;
  for (const MissingPixel& pixel : missing_) {
    if (!all.Reached(pixel.needs)) continue;
    all.Add(pixel.needs);
    if (pixel.sample % 2 == 0) half.Add(pixel.needs);
  }
  const std::vector<int> fitted = half.Steps(std::vector<int>(links()));
  std::vector<int> steps = all.Steps(fitted);
  const int further = HoldOut(fitted, steps);
  for (size_t link = 0; link < links(); ++link) {
    if (steps[link] > 0) steps[link] = std::min(steps[link] + further, steps_);
    result_.links[link].growth = GrowthOf(steps[link]);
  }
}

// The further steps of links that grow where few masks are held out: as many as they need beyond
// `fitted` for few enough of these to lack a pixel, and kFurtherOfFew; 0: none, or more than
// kMostFurther would do.
int Comparing::HoldOut(const std::vector<int>& fitted, const std::vector<int>& steps) {
  result_.held_out_masks = samples_.size() / 2 * result_.views.size();
  std::vector<int> by_pixel;
  std::map<std::pair<size_t, size_t>, int> by_mask;
  for (const MissingPixel& pixel : missing_) {
    if (pixel.sample % 2 == 0) continue;
    int needed = steps_ + 1;
    for (size_t link = 0; link < links(); ++link) {
      const bool reaches = steps[link] > 0 && pixel.needs[link] <= steps_;
      if (reaches) needed = std::min(needed, pixel.needs[link] - fitted[link]);
    }
    if (needed <= 0 || needed > steps_) continue;
    by_pixel.push_back(needed);
    int& of_mask = by_mask[{pixel.sample, pixel.view}];
    of_mask = std::max(of_mask, needed);
  }
  const auto lacking = [&](int further) {  // masks held out
    return std::ranges::count_if(by_mask, [=](const auto& mask) { return mask.second > further; });
  };
  const double permitted = settings_.most_held_out * static_cast<double>(result_.held_out_masks);
  const auto too_many = [&](int further) {
    return static_cast<double>(lacking(further)) > permitted;
  };
  const bool few = permitted < kLeastExpected;
  const int most = StepsOf(kMostFurther);
  int further = 0;
  if (few && std::ranges::any_of(steps, [](int of_link) { return of_link > 0; })) {
    while (further < most && too_many(further)) ++further;
    further = too_many(further) ? 0 : std::min(further + StepsOf(kFurtherOfFew), most);
  }
  if (further > 0 || too_many(0)) {
    // The share that lacks a pixel falls at best as the number of configurations rises.
    const double times =
        std::max(kSafely * static_cast<double>(lacking(0)), kLeastExpected) / permitted;
    const double enough = std::min(times * static_cast<double>(samples_.size()), kMostSensible);
    result_.enough = 10 * static_cast<size_t>(std::ceil(enough / 10));
  }
  result_.further = GrowthOf(further);
  result_.held_out_missing = static_cast<uint64_t>(lacking(further));
  result_.held_out_pixels = static_cast<uint64_t>(
      std::ranges::count_if(by_pixel, [=](int needed) { return needed > further; }));
  return further;
}

void Comparing::CountAdded() {
  const std::vector<double> growth = result_.LinkGrowth();
  uint64_t grown = 0;
  for (const ModelSample& sample : samples_) {
    drawer_.At(sample.q);
    for (size_t view = 0; view < result_.views.size(); ++view) {
      grown += drawer_.Grown(view, growth).Count();
      progress_(++done_);
    }
  }
  if (drawn_ == 0) return;
  result_.additional = static_cast<double>(grown) / static_cast<double>(drawn_) - 1;
}

// The link that would reach most of a view's unreached pixels first, if it grew on.
std::string Comparing::NearestLink(size_t view) const {
  LinkDrawer drawer(bare_);
  std::vector<size_t> votes(links());
  for (const MissingPixel& pixel : missing_) {
    if (pixel.view != view || pixel.noise) continue;
    if (std::ranges::any_of(pixel.needs, [&](uint8_t need) { return need <= steps_; })) continue;
    drawer.At(samples_[pixel.sample].q);
    bool found = false;
    for (double growth = 1.5 * settings_.most_growth; growth < 2 && !found; growth *= 1.5) {
      for (size_t link = 0; link < links(); ++link) {
        if (!drawer.Touched(view, link, growth).at(pixel.x, pixel.y)) continue;
        ++votes[link];
        found = true;
      }
    }
    if (*std::ranges::max_element(votes) >= 100) break;
  }
  return link_names_[static_cast<size_t>(std::ranges::max_element(votes) - votes.begin())];
}

void Comparing::JudgeView(size_t view) {
  const ComparedView& compared = result_.views[view];
  const std::string& name = view_names_[view];
  const auto fault = [&](std::string text) { result_.faults.push_back(std::move(text)); };
  if (compared.captured == 0) {
    fault(absl::StrFormat("view '%s': the robot was captured in no mask", name));
    return;
  }
  if (compared.unreached > 0) {
    fault(absl::StrFormat(
        "view '%s': %d captured pixels (%.2f %%) are farther than most_growth, %g m, from the "
        "model, nearest to the link '%s'",
        name, compared.unreached, 100 * ShareOf(compared.unreached, compared.captured),
        settings_.most_growth, NearestLink(view)));
  }
  if (ShareOf(compared.noise, compared.captured) > settings_.most_noise) {
    fault(absl::StrFormat(
        "view '%s': %.2f %% of the captured pixels are specks far from the robot, more than "
        "most_noise, %.2f %%",
        name, 100 * ShareOf(compared.noise, compared.captured), 100 * settings_.most_noise));
  }
  if (ShareOf(compared.uncaptured, compared.certain) > settings_.most_uncaptured) {
    fault(absl::StrFormat(
        "view '%s': %.1f %% of what certainly shows the robot by its model was not captured, more "
        "than most_uncaptured, %.1f %%",
        name, 100 * ShareOf(compared.uncaptured, compared.certain),
        100 * settings_.most_uncaptured));
  }
  // A camera that moved leaves captured pixels undrawn. Where none are, edges that are parallel to
  // the pixel grid all along, as a gantry's, fall between its lines alike.
  const bool moved = compared.missing_by >= kMostlyDrawn * static_cast<double>(samples_.size());
  if (moved && compared.mean_shift.norm() > settings_.most_shift) {
    fault(absl::StrFormat(
        "view '%s': captured masks are shifted by %.2f pixels to the right and %.2f down against "
        "the model, more than most_shift, %.2f",
        name, compared.mean_shift.x(), compared.mean_shift.y(), settings_.most_shift));
  }
}

void Comparing::Judge() {
  if (samples_.size() < settings_.least_configurations) {
    result_.enough = std::max(result_.enough, settings_.least_configurations);
    result_.faults.push_back(absl::StrFormat(
        "%d configurations are too few to compare, at least least_configurations, %d, are needed",
        samples_.size(), settings_.least_configurations));
  }
  for (size_t view = 0; view < result_.views.size(); ++view) JudgeView(view);
  for (size_t link = 0; link < links(); ++link) {
    const ComparedLink& compared = result_.links[link];
    const double share = ShareOf(compared.uncaptured, compared.certain);
    if (compared.certain < kLeastOfLink || share <= settings_.most_uncaptured_of_link) continue;
    result_.faults.push_back(absl::StrFormat(
        "link '%s': %.0f %% of where it certainly is by the model was not captured, more than "
        "most_uncaptured_of_link, %.0f %%: it is not there, or elsewhere",
        link_names_[link], 100 * share, 100 * settings_.most_uncaptured_of_link));
  }
  const double missing = ShareOf(result_.held_out_missing, result_.held_out_masks);
  if (missing > settings_.most_held_out) {
    result_.faults.push_back(absl::StrFormat(
        "%.1f %% of the masks held out have a captured pixel that the growth by the others lacks, "
        "more than most_held_out, %.1f %%: %d configurations are too few, %d may do",
        100 * missing, 100 * settings_.most_held_out, samples_.size(), result_.enough));
  }
}

}  // namespace

int GrowthSteps(const ComparisonSettings& settings) {
  constexpr double kMostSteps = 200;
  const double steps = std::round(settings.most_growth / settings.growth_step);
  if (steps >= 1 && steps <= kMostSteps) return static_cast<int>(steps);
  throw std::invalid_argument(
      absl::StrFormat("most_growth, %g m, must be 1 to %g times growth_step, %g m",
                      settings.most_growth, kMostSteps, settings.growth_step));
}

double ShareOf(uint64_t part, uint64_t whole) {
  return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
}

std::string Describe(const ComparisonSettings& settings) {
  return absl::StrFormat(
      "growth_step: %g\nleast_configurations: %d\nleast_moved: %g\nmost_growth: %g\nmost_held_out: "
      "%g\nmost_noise: "
      "%g\nmost_noise_pixels: %d\nmost_shift: %g\nmost_uncaptured: %g\nmost_uncaptured_of_link: "
      "%g\n",
      settings.growth_step, settings.least_configurations, settings.least_moved,
      settings.most_growth, settings.most_held_out, settings.most_noise, settings.most_noise_pixels,
      settings.most_shift, settings.most_uncaptured, settings.most_uncaptured_of_link);
}

std::vector<double> ModelComparison::LinkGrowth() const {
  std::vector<double> growth;
  for (const ComparedLink& link : links) growth.push_back(link.growth);
  return growth;
}

ModelComparison CompareModel(const DrawnRobot& bare, std::span<const GridJoint> joints,
                             std::span<const std::string> link_names,
                             std::span<const std::string> view_names,
                             std::span<const ModelSample> samples,
                             const ComparisonSettings& settings,
                             const std::function<void(uint64_t done)>& progress) {
  ModelComparison found = Comparing(bare, link_names, view_names, samples, settings, progress).Go();
  std::vector<std::string> faults =
      UnmovedJoints(bare.chain(), joints, samples, settings.least_moved);
  if (faults.empty() && settings.least_moved > 0) {
    const auto grown = Grown(bare, found.LinkGrowth());
    if (!grown.ok()) throw std::invalid_argument(std::string(grown.status().message()));
    faults = UndirectedJoints(bare, *grown, joints, samples);
  }
  std::ranges::move(faults, std::back_inserter(found.faults));
  return found;
}

}  // namespace silhouette
