// SPDX-License-Identifier: Apache-2.0
// Whether a camera lives: a frozen camera repeats the past under new time stamps.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "capture/devices/devices.h"
#include "capture/segmentation/reference.h"
#include "db/mask/mask.h"
#include "server/live/live_settings.h"
#include "server/scene/recent_images.h"
#include "server/scene/robot_in_scene.h"

namespace silhouette {

// Remembers the images of every view. Not thread-safe.
//
// A view is dead, and stays it until kLivePairs images in a row are like no fault, if
// - an image is, byte for byte, one of its recent ones (RecentImages) under another time stamp; or
// - kDeadPairs times in a row pixels change from image to image by less than least_noise of the
//   reference's noise.
// Both only where the source has noise. A view is dead, too, if the robot moved to where its image
// showed the empty cell, and the image changed neither there nor where the robot was; it stays dead
// until its image changes there.
class ProofOfLife {
 public:
  static constexpr int kDeadPairs = 2;
  static constexpr int kLivePairs = 3;

  // `has_noise`: by view, whether its source has.
  ProofOfLife(const LifeSettings& settings, const std::vector<bool>& has_noise);

  // An image of a view that ImageJudge let pass. DataLoss: the view is dead; one sentence that says
  // what its camera does, and the mend. An image that has the time stamp of the one before is the
  // same image.
  absl::Status Judge(size_t view, const CameraImage& image, const Reference& reference);

  // Where the robot is in the image that Judge() got last and let pass, whose foreground is
  // `foreground`. DataLoss as above.
  absl::Status JudgeMotion(size_t view, const RobotCover& robot, const Mask& foreground,
                           const Reference& reference);

  // The robot images are others from now on. A dead view stays dead.
  void ForgetRobot();

  // Whether any view is.
  bool AnyDead() const;

 private:
  // One channel of some thousand pixels that are spread evenly over the image.
  struct Sample {
    cv::Size image;
    int step = 1;
    int channel = 0;
    cv::Mat levels;  // 8-bit

    int x(int column) const { return step / 2 + column * step; }
    int y(int row) const { return step / 2 + row * step; }
  };
  // What the view saw while the robot stood there.
  struct Standing {
    RobotCover robot;
    Mask foreground;
    Sample sample;
  };
  struct View {
    bool has_noise = true;
    std::optional<absl::Time> captured;
    Sample sample;
    RecentImages recent;
    int quiet_pairs = 0;          // in a row
    int live_pairs = kLivePairs;  // in a row; fewer than kLivePairs: dead
    absl::Status fault;           // why it is
    std::optional<Standing> standing;
    size_t least_changed = 0;  // pixels of the sample; not 0: dead since the robot moved
    Mask moved;          // where they have to change: where the robot came to and where it was
    absl::Status still;  // why that is
  };

  static Sample SampleOf(const CameraImage& image);
  // The noise from one sample to the next, as a share of the reference's; nothing: it cannot be
  // known.
  static std::optional<double> NoiseShare(const Sample& before, const Sample& now,
                                          const Reference& reference);
  // How many pixels of the sample changed clearly; `where`: counted there only.
  struct Change {
    size_t changed = 0;
    size_t pixels = 0;
  };
  static Change ChangeOf(const Sample& before, const Sample& now, const Reference& reference,
                         const Mask& where);

  // By the first two rules, of another image than before.
  absl::Status FaultOf(View& view, const CameraImage& image, const Sample& sample,
                       const Reference& reference) const;

  const LifeSettings settings_;
  std::vector<View> views_;
};

}  // namespace silhouette
