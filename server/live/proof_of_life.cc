// SPDX-License-Identifier: Apache-2.0
#include "server/live/proof_of_life.h"

#include <xxhash.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/numbers/numbers.h"

namespace silhouette {
namespace {

constexpr double kSamplePixels = 20'000;
// Blocks of the sample per side: what moves, or is inserted into a frozen image, is in few of them.
constexpr int kBlocks = 8;
constexpr int kFewestInBlock = 16;
constexpr size_t kFewestBlocks = 8;
// Darker and brighter pixels may be cut off, and then have no noise.
constexpr int kLifeDarkest = 10;
constexpr int kLifeBrightest = 245;
// Grey levels; less noise is lost where levels are rounded.
constexpr double kLeastReferenceNoise = 0.25;
// A pixel changed if its level did by more than this, and more than this many standard deviations
// of the difference of two images.
constexpr double kChange = 4;
constexpr double kChangeDeviations = 4;
// The robot must have come to this share of a mask's pixels, and this many: fewer could be rims, of
// which it covers little.
constexpr double kLeastMovedShare = 0.004;
constexpr double kLeastMovedPixels = 16;

constexpr char kNoNoise[] =
    "; if its source has no noise (a recording, a simulator, strong compression), state "
    "'noise: none' at its view in the cell file";

// Whether the robot covers what it covered.
bool StandsStill(const RobotCover& before, const RobotCover& now) {
  return (now.certain - before.anywhere).Empty() && (before.certain - now.anywhere).Empty();
}

}  // namespace

ProofOfLife::ProofOfLife(const LifeSettings& settings, const std::vector<bool>& has_noise)
    : settings_(settings), views_(has_noise.size()) {
  for (size_t view = 0; view < has_noise.size(); ++view) views_[view].has_noise = has_noise[view];
}

ProofOfLife::Sample ProofOfLife::SampleOf(const CameraImage& image) {
  Sample sample;
  sample.image = {image.width, image.height};
  const double pixels = static_cast<double>(image.width) * image.height;
  sample.step = std::max(1, static_cast<int>(std::lround(std::sqrt(pixels / kSamplePixels))));
  sample.channel = image.channels == 3 ? 1 : 0;
  const auto count = [&](int side) {
    return std::max(0, (side - sample.step / 2 + sample.step - 1) / sample.step);
  };
  sample.levels.create(count(image.height), count(image.width), CV_8UC1);
  for (int row = 0; row < sample.levels.rows; ++row) {
    auto* to = sample.levels.ptr<uint8_t>(row);
    const uint8_t* from = image.pixels.data() +
                          static_cast<size_t>(sample.y(row)) * static_cast<size_t>(image.width) *
                              static_cast<size_t>(image.channels) +
                          sample.channel;
    for (int column = 0; column < sample.levels.cols; ++column) {
      to[column] = from[sample.x(column) * image.channels];
    }
  }
  return sample;
}

std::optional<double> ProofOfLife::NoiseShare(const Sample& before, const Sample& now,
                                              const Reference& reference) {
  const double noise = static_cast<double>(reference.typical_noise()) / Reference::kGreyLevel;
  if (noise < kLeastReferenceNoise || before.levels.size() != now.levels.size()) {
    return std::nullopt;
  }
  std::vector<double> squares(kBlocks * kBlocks);
  std::vector<int> counts(kBlocks * kBlocks);
  const int rows = now.levels.rows;
  const int columns = now.levels.cols;
  for (int row = 0; row < rows; ++row) {
    const auto* first = before.levels.ptr<uint8_t>(row);
    const auto* second = now.levels.ptr<uint8_t>(row);
    for (int column = 0; column < columns; ++column) {
      const int a = first[column];
      const int b = second[column];
      if (std::min(a, b) < kLifeDarkest || std::max(a, b) > kLifeBrightest) continue;
      const auto block =
          static_cast<size_t>(row * kBlocks / rows * kBlocks + column * kBlocks / columns);
      squares[block] += (a - b) * (a - b);
      ++counts[block];
    }
  }
  std::vector<double> means;
  for (size_t block = 0; block < squares.size(); ++block) {
    if (counts[block] >= kFewestInBlock) means.push_back(squares[block] / counts[block]);
  }
  if (means.size() < kFewestBlocks) return std::nullopt;
  return std::sqrt(Median(std::move(means)) / 2) / noise;
}

ProofOfLife::Change ProofOfLife::ChangeOf(const Sample& before, const Sample& now,
                                          const Reference& reference, const Mask& where) {
  Change change;
  if (before.levels.size() != now.levels.size()) return change;
  const int channels = reference.channels();
  for (int row = 0; row < now.levels.rows; ++row) {
    const auto* first = before.levels.ptr<uint8_t>(row);
    const auto* second = now.levels.ptr<uint8_t>(row);
    const int y = now.y(row);
    const auto* noises = reference.noise().ptr<uint16_t>(y);
    for (int column = 0; column < now.levels.cols; ++column) {
      const int x = now.x(column);
      if (!where.at(x * where.width() / now.image.width, y * where.height() / now.image.height)) {
        continue;
      }
      const uint16_t noise = noises[x * channels + channels / 2];
      if (noise == Reference::kUndefined) continue;
      ++change.pixels;
      const double limit =
          std::max(kChange, kChangeDeviations * std::sqrt(2.0) * noise / Reference::kGreyLevel);
      change.changed += std::abs(first[column] - second[column]) > limit ? 1 : 0;
    }
  }
  return change;
}

absl::Status ProofOfLife::FaultOf(View& view, const CameraImage& image, const Sample& sample,
                                  const Reference& reference) const {
  const uint64_t digest = XXH3_64bits(image.pixels.data(), image.pixels.size());
  if (view.recent.Repeats(digest)) {
    return absl::DataLossError(
        absl::StrCat("the camera is frozen: it repeats an image byte for byte under a new time "
                     "stamp; restart the camera",
                     kNoNoise));
  }
  if (!view.captured) return absl::OkStatus();
  const std::optional<double> share = NoiseShare(view.sample, sample, reference);
  view.quiet_pairs = share && *share < settings_.least_noise ? view.quiet_pairs + 1 : 0;
  if (view.quiet_pairs < kDeadPairs) return absl::OkStatus();
  return absl::DataLossError(absl::StrFormat(
      "the camera is frozen: from image to image its pixels change by %.2f of the reference's "
      "noise, less than least_noise, %g; restart the camera, or switch off its noise reduction%s",
      *share, settings_.least_noise, kNoNoise));
}

absl::Status ProofOfLife::Judge(size_t view, const CameraImage& image, const Reference& reference) {
  View& known = views_[view];
  if (image.captured != known.captured) {
    Sample sample = SampleOf(image);
    if (known.has_noise) {
      const absl::Status fault = FaultOf(known, image, sample, reference);
      known.live_pairs = fault.ok() ? std::min(known.live_pairs + 1, kLivePairs) : 0;
      if (!fault.ok()) known.fault = fault;
    }
    known.captured = image.captured;
    known.sample = std::move(sample);
    if (known.least_changed > 0 &&
        ChangeOf(known.standing->sample, known.sample, reference, known.moved).changed >=
            known.least_changed) {
      known.least_changed = 0;
      known.standing.reset();
    }
  }
  if (known.live_pairs < kLivePairs) return known.fault;
  return known.least_changed > 0 ? known.still : absl::OkStatus();
}

absl::Status ProofOfLife::JudgeMotion(size_t view, const RobotCover& robot, const Mask& foreground,
                                      const Reference& reference) {
  View& known = views_[view];
  const auto stand = [&] { known.standing = Standing{robot, foreground, known.sample}; };
  if (!known.standing) {
    stand();
    return absl::OkStatus();
  }
  Standing& before = *known.standing;
  if (StandsStill(before.robot, robot)) {
    before.foreground = foreground;
    before.sample = known.sample;
    return absl::OkStatus();
  }
  const Mask entered = robot.certain - before.robot.anywhere - before.foreground;
  const double least =
      std::max(kLeastMovedPixels, kLeastMovedShare * static_cast<double>(entered.size().pixels()));
  if (static_cast<double>(entered.Count()) < least) return absl::OkStatus();
  const Change there = ChangeOf(before.sample, known.sample, reference, entered);
  const double least_changed = settings_.least_change * static_cast<double>(there.pixels);
  // Someone as bright as the cell may have come there meanwhile. Where the robot was the image
  // changes, too; if it does not, that proves nothing: someone may have hidden the robot.
  const Mask left = before.robot.certain - robot.anywhere;
  const Change where_it_was = ChangeOf(before.sample, known.sample, reference, left);
  const size_t changed = there.changed + where_it_was.changed;
  if (there.pixels == 0 || static_cast<double>(changed) >= least_changed) {
    stand();
    return absl::OkStatus();
  }
  known.least_changed = std::max<size_t>(1, static_cast<size_t>(std::ceil(least_changed)));
  known.moved = entered | left;
  known.still = absl::DataLossError(absl::StrFormat(
      "the camera is frozen, or the robot did not move as its driver reports: %d pixels changed "
      "where it was or is, less than least_change, %g, of the %d compared where it is; restart the "
      "camera and move the robot, or mend the driver",
      changed, settings_.least_change, there.pixels));
  return known.still;
}

void ProofOfLife::ForgetRobot() {
  for (View& view : views_) {
    if (view.least_changed == 0) view.standing.reset();
  }
}

bool ProofOfLife::AnyDead() const {
  return std::ranges::any_of(views_, [](const View& view) {
    return view.live_pairs < kLivePairs || view.least_changed > 0;
  });
}

}  // namespace silhouette
