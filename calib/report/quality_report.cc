// SPDX-License-Identifier: Apache-2.0
#include "calib/report/quality_report.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "absl/strings/str_format.h"
#include "calib/poses/pose_problem.h"

namespace silhouette {
namespace {

constexpr double kNegligible = 0.02;  // pixels: less is good, whatever was expected
constexpr int kFewFrames = 8;

bool InOnePlace(const ReportView& view) { return view.span_x < 0.25 && view.span_y < 0.25; }

// How many times what was expected.
Grade GradeOfRatio(double px, double expected, double good, double bad) {
  if (px < kNegligible) return Grade::kGood;
  if (!(expected > 0)) return Grade::kUnknown;
  if (px < good * expected) return Grade::kGood;
  return px < bad * expected ? Grade::kFair : Grade::kBad;
}

Grade GradeAbove(double value, double good, double fair) {
  if (value > good) return Grade::kGood;
  return value > fair ? Grade::kFair : Grade::kBad;
}

const HeldOutError* HeldOutOf(const QualityReport& report, const std::string& view) {
  for (const ReportView& known : report.views) {
    if (known.name == view) return &known.held_out;
  }
  return nullptr;
}

class Warnings {
 public:
  explicit Warnings(const QualityReport& report) : report_(report) {}

  std::vector<std::string> All() {
    for (const ReportView& view : report_.views) {
      OfImages(view);
      OfErrors(view);
    }
    OfHalves();
    OfPairs();
    if (report_.refusal.empty() && report_.held_out_by == HeldOutBy::kNothing) {
      Say("nothing could be held out: that needs four frames or four surveyed boards, and a "
          "calibration by the rest of them; errors are those of the fit, and promise too much");
    }
    if (report_.dof > 0 && report_.chi2_per_dof < 0.4) {
      Say("robot or survey err less than the stated sigmas explain (chi2/dof %.2f): "
          "what is predicted is too careful",
          report_.chi2_per_dof);
    }
    return all_;
  }

 private:
  template <typename... Values>
  void Say(const absl::FormatSpec<Values...>& format, const Values&... values) {
    all_.push_back(absl::StrFormat(format, values...));
  }

  void OfImages(const ReportView& view) {
    if (view.corners == 0) {
      Say("view '%s' saw no tag of a board", view.name);
      return;
    }
    const bool by_frames = report_.held_out_by == HeldOutBy::kFrames;
    if (by_frames && view.frames < kFewFrames) {
      Say("view '%s' saw boards in only %d frames; twenty make a good camera", view.name,
          view.frames);
    }
    if (InOnePlace(view)) {
      Say("all boards of view '%s' were in one place of its image, over %.0f %% of "
          "its width and %.0f %% of its height; bring them to its rim too",
          view.name, 100 * view.span_x, 100 * view.span_y);
    } else if (view.predicted.points > 0 && GradeOfCoverage(view) == Grade::kBad) {
      Say("view '%s' saw boards in only %.0f %% of where its image shows the "
          "workspace; bring them to the rest",
          view.name, 100 * view.reached);
    }
    if (GradeOfTilt(view) == Grade::kBad) {
      Say("view '%s' saw too few tilts: about one axis the boards turned by %.1f "
          "deg only; tilt them by 20 deg and more about two axes",
          view.name, *view.tilt_deg);
    }
  }

  void OfErrors(const ReportView& view) {
    if (GradeOf(view.held_out) == Grade::kBad) {
      Say("view '%s' is off by %.3f px in images that it was not calibrated from, "
          "where %.3f were to be expected; see its map of residuals, whether its "
          "lens is right, and whether it stood still",
          view.name, view.held_out.px, view.held_out.expected_px);
    }
    if (view.repeatability && GradeOf(*view.repeatability, view.predicted) == Grade::kBad) {
      Say("view '%s' is not stable: by which frames are left out, points of the "
          "workspace move by %.3f px, where %.3f are predicted",
          view.name, view.repeatability->px, view.predicted.px);
    }
    if (report_.refusal.empty() && view.predicted.points == 0) {
      Say("view '%s' shows nothing of the workspace (%s)", view.name, report_.workspace);
    }
  }

  void OfHalves() {
    std::vector<std::string> moved;
    for (const ReportView& view : report_.views) {
      if (!view.halves || GradeOf(*view.halves) != Grade::kBad) continue;
      moved.push_back(absl::StrFormat("'%s' (%.2f px, where %.2f were to be expected)", view.name,
                                      view.halves->px, view.halves->expected_px));
    }
    if (moved.empty()) return;
    const bool all = moved.size() == report_.views.size() && moved.size() > 1;
    Say("between the first half of the frames and the second, points of the workspace moved in "
        "%s: %s",
        FewOf(moved),
        all ? "did the board on the flange slip, or the robot's base move?"
            : "was the camera touched?");
  }

  void OfPairs() {
    for (const ReportView& view : report_.views) {
      if (view.on_flange || view.corners == 0 || report_.views.size() < 2) continue;
      const bool seen = std::ranges::any_of(report_.pairs, [&](const ReportPair& pair) {
        return (pair.view_a == view.name || pair.view_b == view.name) && pair.seen > 0;
      });
      if (!seen) {
        Say("view '%s' is not connected to the others: it never saw a tag at the "
            "same time as one of them, and nothing checks its epipolar lines",
            view.name);
      }
    }
    for (const ReportPair& pair : report_.pairs) {
      if (GradeOfLines(pair, report_) != Grade::kBad) continue;
      Say("corners that '%s' and '%s' saw at once are %.2f px from their epipolar "
          "lines; were the images taken at the same instant?",
          pair.view_a, pair.view_b, pair.px);
    }
  }

  const QualityReport& report_;
  std::vector<std::string> all_;
};

}  // namespace

const char* NameOf(Grade grade) {
  return std::array{"unknown", "good", "fair", "bad"}[static_cast<size_t>(grade)];
}

Grade GradeOf(const HeldOutError& error) {
  if (error.corners == 0) return Grade::kUnknown;
  return GradeOfRatio(error.px, error.expected_px, 1.4, 2);
}

Grade GradeOf(const Repeatability& repeatability, const PredictedError& predicted) {
  return GradeOfRatio(repeatability.px, predicted.px, 1.8, 2.5);
}

Grade GradeOf(const HalvesDifference& halves) {
  return GradeOfRatio(halves.px, halves.expected_px, 2, 3);
}

Grade GradeOf(const PredictedError& predicted, int width) {
  if (predicted.points == 0) return Grade::kUnknown;
  return GradeAbove(width, 2000 * predicted.px, 500 * predicted.px);
}

Grade GradeOfCoverage(const ReportView& view) {
  if (InOnePlace(view)) return Grade::kBad;
  if (view.predicted.points == 0) return Grade::kUnknown;
  return GradeAbove(view.reached, 0.7, 0.4);
}

Grade GradeOfTilt(const ReportView& view) {
  return view.tilt_deg ? GradeAbove(*view.tilt_deg, 10, 5) : Grade::kUnknown;
}

Grade GradeOfLines(const ReportPair& pair, const QualityReport& report) {
  const HeldOutError* a = HeldOutOf(report, pair.view_a);
  const HeldOutError* b = HeldOutOf(report, pair.view_b);
  if (pair.corners == 0 || a == nullptr || b == nullptr) return Grade::kUnknown;
  // A corner's distance has its own error and that of the line by the other's.
  return GradeOfRatio(pair.px, std::hypot(a->expected_px, b->expected_px), 1.5, 2.5);
}

Grade GradeOfChi2(double chi2_per_dof) {
  if (!(chi2_per_dof > 0)) return Grade::kUnknown;
  if (chi2_per_dof > 0.7 && chi2_per_dof < 1.4) return Grade::kGood;
  return chi2_per_dof > 0.3 && chi2_per_dof < 4 ? Grade::kFair : Grade::kBad;
}

Grade GradeOf(const ReportView& view) {
  Grade worst = std::max({GradeOf(view.held_out), GradeOf(view.predicted, view.width),
                          GradeOfCoverage(view), GradeOfTilt(view)});
  if (view.repeatability) worst = std::max(worst, GradeOf(*view.repeatability, view.predicted));
  if (view.halves) worst = std::max(worst, GradeOf(*view.halves));
  return worst;
}

Grade GradeOf(const QualityReport& report) {
  if (!report.refusal.empty() || !report.doubts.empty()) return Grade::kBad;
  Grade worst = report.warnings.empty() ? Grade::kGood : Grade::kFair;
  for (const ReportView& view : report.views) worst = std::max(worst, GradeOf(view));
  for (const ReportPair& pair : report.pairs) worst = std::max(worst, GradeOfLines(pair, report));
  return worst;
}

bool IsStable(const QualityReport& report) {
  return report.refusal.empty() && report.doubts.empty() &&
         std::ranges::none_of(report.views, [](const ReportView& view) {
           return (view.repeatability &&
                   GradeOf(*view.repeatability, view.predicted) == Grade::kBad) ||
                  (view.halves && GradeOf(*view.halves) == Grade::kBad);
         });
}

std::vector<std::string> WarningsOf(const QualityReport& report) { return Warnings(report).All(); }

}  // namespace silhouette
