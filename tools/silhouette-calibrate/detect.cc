// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-calibrate/detect.h"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <set>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "calib/boards/sighting_file.h"
#include "calib/files/camera_file.h"
#include "common/parallel/parallel.h"
#include "common/picture/files.h"
#include "common/picture/image_file.h"
#include "common/picture/picture.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/program/program.h"
#include "tools/program/progress.h"
#include "tools/silhouette-calibrate/files.h"
#include "tools/silhouette-calibrate/frame_files.h"
#include "tools/silhouette-calibrate/pictures.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

bool IsImage(const std::string& path) {
  static const std::set<std::string> extensions = {".png",  ".jpg", ".jpeg", ".bmp", ".tif",
                                                   ".tiff", ".pgm", ".ppm",  ".webp"};
  return extensions.contains(absl::AsciiStrToLower(fs::path(path).extension().string()));
}

std::string FileName(const std::string& name) { return absl::StrReplaceAll(name, {{"/", "_"}}); }

constexpr double kLittleCoverage = 0.6;

int Fitted(const ImageTags& image) {
  return static_cast<int>(std::ranges::count_if(image.tags, &DetectedTag::fitted));
}

nlohmann::ordered_json JsonOf(const SessionImage& image) {
  const auto names = [](const std::vector<DetectedTag>& tags) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const DetectedTag& tag : tags) list.push_back({{"family", tag.family}, {"tag", tag.tag}});
    return list;
  };
  nlohmann::ordered_json warnings = nlohmann::ordered_json::array();
  for (const auto& [kind, detail] : image.warnings) {
    warnings.push_back(kind + (detail.empty() ? "" : ": " + detail));
  }
  return {{"view", image.tags.view},
          {"frame", image.tags.frame},
          {"image", image.source},
          {"width", image.tags.size.width},
          {"height", image.tags.size.height},
          {"tags", image.tags.tags.size()},
          {"expected", image.tags.expected},
          {"fitted", Fitted(image.tags)},
          {"mean_size", image.tags.MeanSize()},
          {"blur", image.tags.MedianBlur()},
          {"sigma", image.tags.TypicalSigma()},
          {"foreign", names(image.tags.foreign)},
          {"ambiguous", names(image.tags.ambiguous)},
          {"mirrored", image.tags.mirrored},
          {"left_out", image.copy},
          {"warnings", warnings}};
}

// A line for each kind of warning, with some of the images.
std::string WarningsText(const DetectSession& session) {
  constexpr size_t kNamed = 5;
  std::map<std::string, std::vector<std::string>> images;  // by the kind
  for (const SessionImage& image : session.images()) {
    for (const auto& [kind, detail] : image.warnings) {
      images[kind].push_back(image.source + (detail.empty() ? "" : " (" + detail + ")"));
    }
  }
  std::string text;
  for (auto& [kind, names] : images) {
    const size_t count = names.size();
    if (count > kNamed) names.resize(kNamed);
    absl::StrAppend(&text, "warning: in ", count, " of ", session.images().size(), " images ", kind,
                    ": ", absl::StrJoin(names, ", "), count > kNamed ? ", ..." : "", "\n");
  }
  return text;
}

// The mend, if the pattern is of a ROS bag; else empty.
std::string HowToReadBag(const std::string& pattern, const std::string& view) {
  const auto extension = [](const std::string& path) { return fs::path(path).extension(); };
  const auto is_second = [&](const std::string& path) {
    return extension(path) == ".db3" || extension(path) == ".mcap";
  };
  const bool second = is_second(pattern) ||
                      std::ranges::any_of(FilesOfFrames(pattern), is_second, &FrameFile::path);
  if (!second && extension(pattern) != ".bag") return "";
  const std::string file = view + "/%04d.png";
  return absl::StrCat(
      "'", pattern, "' is a ROS bag, which is not read; extract its images first: ",
      second ? absl::StrCat("'ros2 bag play' beside 'ros2 run image_view image_saver --ros-args -r "
                            "image:=/TOPIC -p filename_format:=",
                            file, "'")
             : absl::StrCat("'rosbag play' beside 'rosrun image_view image_saver image:=/TOPIC "
                            "_filename_format:=",
                            file, "'"),
      "; then give --images '", view, "=", view, "/*.png'");
}

// Of 16 bits, of which cameras use 10, 12, 14 or all: as few as hold the image, but for a
// thousandth of its pixels.
cv::Mat EightBits(const cv::Mat& image) {
  std::vector<uint16_t> levels(image.begin<uint16_t>(), image.end<uint16_t>());
  const auto nearly_most = levels.begin() + static_cast<ptrdiff_t>(0.999 * levels.size());
  std::ranges::nth_element(levels, nearly_most);
  int bits = 10;
  while (bits < 16 && *nearly_most >> bits != 0) bits += 2;
  cv::Mat scaled;
  image.convertTo(scaled, CV_8U, 255.0 / ((1 << bits) - 1));
  return scaled;
}

}  // namespace

absl::StatusOr<std::vector<ViewPattern>> ViewPatterns(const std::vector<std::string>& arguments) {
  std::vector<ViewPattern> patterns;
  std::set<std::string> views;
  for (const std::string& argument : arguments) {
    const size_t equals = argument.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == argument.size()) {
      return InvalidArgument("--images '", argument,
                             "' is not VIEW=PATTERN, e.g. 'left=left/*.png'");
    }
    const std::string view = argument.substr(0, equals);
    const std::string pattern = argument.substr(equals + 1);
    if (!views.insert(view).second) {
      return InvalidArgument("--images has the view '", view, "' twice");
    }
    patterns.push_back({view, pattern});
  }
  return patterns;
}

absl::StatusOr<std::vector<ListedImage>> ListImages(const std::vector<std::string>& arguments) {
  ASSIGN_OR_RETURN(const auto patterns, ViewPatterns(arguments));
  std::vector<ListedImage> images;
  std::map<std::string, std::string> view_of_path;
  for (const auto& [view, pattern] : patterns) {
    if (const std::string mend = HowToReadBag(pattern, view); !mend.empty()) {
      return InvalidArgument(mend);
    }
    std::error_code error;
    const bool folder = fs::is_directory(pattern, error);
    std::map<std::string, std::string> path_of_frame;
    for (const auto& [frame, path] : FilesOfFrames(pattern)) {
      if (folder && !IsImage(path)) continue;
      if (const auto [other, fresh] = path_of_frame.emplace(frame, path); !fresh) {
        return InvalidArgument("'", other->second, "' and '", path, "' are both frame '", frame,
                               "' of view '", view, "'; put the * where the names differ");
      }
      const std::string real = fs::weakly_canonical(path, error).string();
      if (const auto [other, fresh] = view_of_path.emplace(real, view); !fresh) {
        return InvalidArgument("'", path, "' is an image of view '", other->second,
                               "' and of view '", view, "'; mend one of the patterns");
      }
      images.push_back({view, frame, path});
    }
    if (path_of_frame.empty()) {
      return InvalidArgument("no image of view '", view, "' matches '", pattern, "'");
    }
  }
  return images;
}

absl::StatusOr<DetectSettings> LoadDetectSettings(const std::vector<std::string>& boards,
                                                  const std::string& cameras,
                                                  const std::vector<std::string>& views,
                                                  const std::string& draw) {
  DetectSettings settings{.boards = {}, .draw = draw};
  for (const std::string& file : boards) {
    ASSIGN_OR_RETURN(const auto of_file, ReadBoards(file));
    settings.boards.insert(settings.boards.end(), of_file.begin(), of_file.end());
  }
  RETURN_IF_ERROR(CheckBoards(settings.boards));
  for (const std::string& view : views) {
    if (!cameras.empty()) {
      ASSIGN_OR_RETURN(const CameraModel camera,
                       ReadCameraFile((fs::path(cameras) / CameraFileName(view)).string()));
      settings.lenses.emplace(view, camera);
    }
    if (!draw.empty()) {
      RETURN_IF_ERROR(MakeFolder((fs::path(draw) / FileName(view)).string()));
    }
  }
  return settings;
}

absl::StatusOr<ImageTags> Look(const DetectSettings& settings, BoardDetector& detector,
                               const cv::Mat& image, const std::string& view,
                               const std::string& frame) {
  std::optional<CameraModel> lens;
  if (const auto known = settings.lenses.find(view); known != settings.lenses.end()) {
    lens = known->second;
    const CameraIntrinsics& k = lens->intrinsics();
    if (cv::Size(k.width, k.height) != image.size()) {
      return InvalidArgument("frame '", frame, "' of view '", view, "' has ", image.cols, "x",
                             image.rows, " pixels, but its camera model is for ", k.width, "x",
                             k.height, "; give images of that size, or leave --cameras out");
    }
  }
  const cv::Mat grey = GreyOf(image);
  ImageTags tags = FindTags(detector, grey, lens);
  tags.view = view;
  tags.frame = frame;
  if (!settings.draw.empty()) {
    const fs::path file = fs::path(settings.draw) / FileName(view) / (FileName(frame) + ".png");
    RETURN_IF_ERROR(WritePng(file.string(), PictureOfTags(grey, tags)));
  }
  return tags;
}

absl::StatusOr<cv::Mat> ReadImage(const std::string& path) {
  ASSIGN_OR_RETURN(const std::string file, ReadWholeFile(path));
  cv::Mat image = ImageOfBytes(file, cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH);
  if (image.empty()) {
    return InvalidArgument("'", path,
                           "' cannot be read as an image, or is cut off; copy it again, remove it, "
                           "or mend its view's pattern");
  }
  if (image.depth() == CV_16U) return EightBits(image);
  if (image.depth() != CV_8U) {
    return InvalidArgument("'", path, "' has neither 8 nor 16 bits a pixel; convert it to such");
  }
  return image;
}

absl::StatusOr<size_t> DetectAll(const std::vector<ListedImage>& images,
                                 const DetectSettings& settings, const TakeTags& take) {
  Progress progress("detect", images.size(), "images");
  std::mutex mutex;                 // guards all below
  std::vector<BoardDetector> idle;  // slow to make; one thread at a time may use each
  absl::Status status;
  size_t done = 0;
  ParallelWhile(images.size(), [&](size_t i) {
    if (StopRequested()) return false;
    const ListedImage& file = images[i];
    std::optional<BoardDetector> detector;
    std::unique_lock lock(mutex);
    if (!idle.empty()) {
      detector = std::move(idle.back());
      idle.pop_back();
    }
    lock.unlock();
    if (!detector) detector.emplace(settings.boards);
    const absl::StatusOr<cv::Mat> image = ReadImage(file.path);
    absl::StatusOr<ImageTags> tags = image.ok()
                                         ? Look(settings, *detector, *image, file.view, file.frame)
                                         : absl::StatusOr<ImageTags>(image.status());
    lock.lock();
    idle.push_back(*std::move(detector));
    if (!status.ok()) return false;
    status = tags.ok() ? take(i, *std::move(tags)) : tags.status();
    if (status.ok()) progress.Update(++done);
    return status.ok();
  });
  RETURN_IF_ERROR(status);
  return done;
}

absl::Status DrawCoverage(const DetectSettings& settings, const DetectSession& session) {
  if (settings.draw.empty()) return absl::OkStatus();
  for (const auto& [view, coverage] : session.coverage()) {
    const fs::path file = fs::path(settings.draw) / ("coverage-" + FileName(view) + ".png");
    RETURN_IF_ERROR(WritePng(file.string(), PictureOfCoverage(view, coverage)));
  }
  return absl::OkStatus();
}

absl::Status WriteSightings(const DetectSession& session, const std::string& out) {
  return WriteWholeFile(out, SightingFileText(session.Sightings()));
}

cv::Mat GreyOf(const cv::Mat& image) {
  if (image.channels() == 1) return image;
  cv::Mat grey;
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  return grey;
}

absl::StatusOr<CellCameras> CamerasOfViews(const Cell& cell, CameraRig& rig) {
  std::set<std::string> noisy;
  for (const ViewSettings& view : cell.views) {
    if (view.has_noise) noisy.insert(view.name);
  }
  return CellCameras::Create(DescriptionOf(cell), rig, std::move(noisy));
}

absl::StatusOr<ImageSet> GrabSet(CellCameras& cameras) {
  return cameras.Grab([](const std::string& line) { std::cerr << line << std::endl; });
}

std::string CoverageLine(const DetectSession& session) {
  std::vector<std::string> views;
  for (const auto& [view, coverage] : session.coverage()) {
    views.push_back(absl::StrFormat("%s %.0f %%", view, 100 * coverage.Share()));
  }
  return "coverage " + absl::StrJoin(views, ", ");
}

std::string DetectionText(const DetectSession& session, const std::string& out) {
  Table table{{"view", "frame", "tags", "size", "blur", "sigma (pixels)", ""}};
  for (const SessionImage& image : session.images()) {
    const ImageTags& tags = image.tags;
    const double blur = tags.MedianBlur();
    const bool none = tags.tags.empty();
    table.rows.push_back({tags.view, tags.frame,
                          none ? "none" : absl::StrCat(tags.tags.size(), " of ", tags.expected),
                          none ? "" : absl::StrFormat("%.0f", tags.MeanSize()),
                          none       ? ""
                          : blur > 0 ? absl::StrFormat("%.2f", blur)
                                     : "-",
                          none ? "" : absl::StrFormat("%.3f", tags.TypicalSigma()),
                          image.copy ? "left out" : ""});
  }
  std::string text = TextOf(table) + WarningsText(session);
  std::vector<std::string> little;
  for (const auto& [view, coverage] : session.coverage()) {
    if (coverage.Share() < kLittleCoverage) little.push_back("'" + view + "'");
  }
  if (!little.empty()) {
    absl::StrAppendFormat(&text,
                          "warning: corners in less than %.0f %% of %s; for lenses, show boards in "
                          "all of the image, corners of the image above all\n",
                          100 * kLittleCoverage, absl::StrJoin(little, ", "));
  }
  return absl::StrCat(text, CoverageLine(session), "\nwrote ", out, ": ",
                      session.Sightings().size(), " tags of ", session.images().size(),
                      " images\n");
}

nlohmann::ordered_json DetectionJson(const DetectSession& session, const std::string& out) {
  nlohmann::ordered_json json = {{"out", out},
                                 {"sightings", session.Sightings().size()},
                                 {"images", nlohmann::ordered_json::array()},
                                 {"views", nlohmann::ordered_json::array()}};
  for (const SessionImage& image : session.images()) json["images"].push_back(JsonOf(image));
  for (const auto& [view, coverage] : session.coverage()) {
    json["views"].push_back(
        {{"view", view}, {"corners", coverage.corners().size()}, {"coverage", coverage.Share()}});
  }
  return json;
}

}  // namespace silhouette
