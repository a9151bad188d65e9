// silhouette-calibrate detect, live from a cell's cameras.
#include <filesystem>
#include <iostream>
#include <opencv2/imgproc.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "capture/session/cell_cameras.h"
#include "common/picture/picture.h"
#include "db/status/status_macros.h"
#include "tools/cell/cell.h"
#include "tools/cell/devices/cell_devices.h"
#include "tools/program/program.h"
#include "tools/silhouette-calibrate/detect_report.h"
#include "tools/silhouette-calibrate/detect_settings.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

// One set after the other.
class LiveDetection {
 public:
  LiveDetection(const DetectArguments& arguments, const DetectSettings& settings,
                const std::vector<std::string>& views, DetectSession& session)
      : arguments_(arguments),
        settings_(settings),
        views_(views),
        detector_(settings.families),
        session_(session) {}

  int kept() const { return kept_; }

  absl::Status Take(const ImageSet& set) {
    const std::string frame = absl::StrFormat("%04d", kept_ + 1);
    std::vector<ImageTags> found;
    std::vector<cv::Mat> greys;
    for (size_t v = 0; v < views_.size(); ++v) {
      cv::Mat grey = set.images[v];
      if (grey.channels() == 3) cv::cvtColor(set.images[v], grey, cv::COLOR_BGR2GRAY);
      ASSIGN_OR_RETURN(auto tags, Look(settings_, detector_, grey, views_[v], frame));
      found.push_back(std::move(tags));
      greys.push_back(grey);
    }
    if (arguments_.count == 0 && !TellsSomethingNew(found)) return absl::OkStatus();
    for (size_t v = 0; v < views_.size(); ++v) {
      RETURN_IF_ERROR(Keep(found[v], greys[v]));
    }
    ++kept_;
    last_ = found;
    std::string line = absl::StrCat("set ", kept_, ":");
    for (const ImageTags& tags : found) {
      absl::StrAppend(&line, " ", tags.view, " ", tags.tags.size(), " tags,");
    }
    std::cerr << line << " " << CoverageLine(session_) << std::endl;
    return WriteSightings(session_, arguments_.out);
  }

 private:
  bool TellsSomethingNew(const std::vector<ImageTags>& found) const {
    for (size_t v = 0; v < found.size(); ++v) {
      if (!found[v].tags.empty() && (last_.empty() || !ShowTheSame(last_[v], found[v]))) {
        return true;
      }
    }
    return false;
  }

  absl::Status Keep(const ImageTags& tags, const cv::Mat& image) {
    if (!arguments_.save.empty()) {
      const fs::path folder = fs::path(arguments_.save) / tags.view;
      std::error_code error;
      fs::create_directories(folder, error);
      RETURN_IF_ERROR(WritePng((folder / (tags.frame + ".png")).string(), image));
    }
    return session_.Add(tags, absl::StrCat(tags.view, " ", tags.frame));
  }

  const DetectArguments& arguments_;
  const DetectSettings& settings_;
  const std::vector<std::string>& views_;
  TagDetector detector_;
  DetectSession& session_;
  std::vector<ImageTags> last_;
  int kept_ = 0;
};

// Returns early if a stop was asked for.
void Wait(double seconds) {
  const absl::Time until = absl::Now() + absl::Seconds(seconds);
  while (!StopRequested() && absl::Now() < until) absl::SleepFor(absl::Milliseconds(20));
}

}  // namespace

absl::Status DetectLive(const DetectArguments& arguments, DetectSession& session) {
  if (!arguments.overwrite && fs::exists(arguments.out)) {
    return absl::AlreadyExistsError("'" + arguments.out +
                                    "' is there already; take another --out, or --overwrite");
  }
  ASSIGN_OR_RETURN(const auto cell, LoadCell(arguments.cell));
  auto rig = OpenCamerasOfCell(cell, true);
  if (!rig.ok()) {
    return absl::Status(rig.status().code(),
                        absl::StrCat(rig.status().message(),
                                     "; or take the images otherwise and give them (--images)"));
  }
  ASSIGN_OR_RETURN(auto cameras, CellCameras::Create(DescriptionOf(cell), **rig));
  std::vector<std::string> views;
  for (const ViewSettings& view : cell.views) views.push_back(view.name);
  ASSIGN_OR_RETURN(const auto settings, LoadDetectSettings(arguments, views));

  if (arguments.count == 0) {
    std::cerr << "Move the board; sets in which it has moved are kept. Ctrl-C ends." << std::endl;
  }
  LiveDetection detection(arguments, settings, views, session);
  while (!StopRequested() && (arguments.count == 0 || detection.kept() < arguments.count)) {
    auto set = cameras.Grab([](const std::string& line) { std::cerr << line << std::endl; });
    if (!set.ok()) return set.status();
    RETURN_IF_ERROR(detection.Take(*set));
    if (detection.kept() != arguments.count || arguments.count == 0) Wait(arguments.interval);
  }
  return DrawCoverage(settings, session);
}

}  // namespace silhouette
