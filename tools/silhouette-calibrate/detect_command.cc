// silhouette-calibrate detect
#include <algorithm>
#include <atomic>
#include <iostream>
#include <memory>
#include <mutex>
#include <opencv2/imgcodecs.hpp>
#include <set>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "calib/boards/tag_family.h"
#include "db/status/status_macros.h"
#include "tools/program/program.h"
#include "tools/program/progress.h"
#include "tools/silhouette-calibrate/commands.h"
#include "tools/silhouette-calibrate/detect_images.h"
#include "tools/silhouette-calibrate/detect_report.h"
#include "tools/silhouette-calibrate/detect_settings.h"

namespace silhouette {
namespace {

constexpr char kDetectProgram[] = "silhouette-calibrate";

// Grey, in the camera's own orientation whatever the file says of how to hold it.
absl::StatusOr<cv::Mat> ReadImage(const std::string& path) {
  cv::Mat image = cv::imread(path, cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
  if (image.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("'", path,
                     "' cannot be read as an image; remove it, or mend its view's "
                     "pattern"));
  }
  return image;
}

// Looks at all images with all processors. The first mistake ends it.
class FileDetection {
 public:
  FileDetection(const std::vector<ListedImage>& images, const DetectSettings& settings,
                DetectSession& session)
      : images_(images),
        settings_(settings),
        session_(session),
        progress_("detect", images.size(), "images") {}

  absl::Status Run() {
    std::vector<std::jthread> helpers;
    for (unsigned i = 1; i < std::thread::hardware_concurrency(); ++i) {
      helpers.emplace_back([this] { Work(); });
    }
    Work();
    helpers.clear();
    return status_;
  }

  size_t done() const { return done_; }

 private:
  void Work() {
    TagDetector detector(settings_.families);
    for (size_t i = next_++; i < images_.size() && !StopRequested(); i = next_++) {
      absl::StatusOr<ImageTags> tags = LookAt(images_[i], detector);
      const std::lock_guard lock(mutex_);
      if (!status_.ok()) return;
      status_ = tags.ok() ? session_.Add(*std::move(tags), images_[i].path) : tags.status();
      if (!status_.ok()) return;
      progress_.Update(++done_);
    }
  }

  absl::StatusOr<ImageTags> LookAt(const ListedImage& file, TagDetector& detector) const {
    ASSIGN_OR_RETURN(const cv::Mat image, ReadImage(file.path));
    return Look(settings_, detector, image, file.view, file.frame);
  }

  const std::vector<ListedImage>& images_;
  const DetectSettings& settings_;
  std::atomic<size_t> next_ = 0;
  std::mutex mutex_;  // guards all below
  DetectSession& session_;
  Progress progress_;
  size_t done_ = 0;
  absl::Status status_;
};

// For those who gave the wrong boards: whose tags the first images show, of the families that are
// not among `looked_for`. Empty if of none.
std::string OtherFamilies(const std::vector<ListedImage>& images,
                          const std::vector<std::string>& looked_for) {
  constexpr size_t kImages = 3;
  constexpr int kMostTags = 10000;  // larger families take seconds to prepare, and are rare
  std::vector<std::string> others;
  for (const std::string& family : TagFamily::Names()) {
    if (std::find(looked_for.begin(), looked_for.end(), family) == looked_for.end() &&
        TagFamily(family).tags() <= kMostTags) {
      others.push_back(family);
    }
  }
  TagDetector detector(others);
  std::set<std::string> seen;
  for (size_t i = 0; i < std::min(kImages, images.size()); ++i) {
    const absl::StatusOr<cv::Mat> image = ReadImage(images[i].path);
    if (!image.ok()) continue;
    for (const DetectedTag& tag : detector.Detect(*image)) seen.insert(tag.family);
  }
  return absl::StrJoin(seen, ", ");
}

// NotFound, with the likely reason, if nothing was seen.
absl::Status CheckThatTagsWereSeen(const DetectSession& session,
                                   const std::vector<ListedImage>& images,
                                   const std::vector<std::string>& families) {
  const absl::Status status = session.CheckThatTagsWereSeen();
  const bool reason_known = std::any_of(
      session.images().begin(), session.images().end(),
      [](const SessionImage& image) { return image.tags.mirrored || !image.tags.foreign.empty(); });
  if (status.ok() || reason_known) return status;
  const std::string others = OtherFamilies(images, families);
  if (others.empty()) return status;
  return absl::NotFoundError(absl::StrCat("none of ", images.size(),
                                          " images shows a tag of the boards; they show tags of ",
                                          others, ": is --boards the right file?"));
}

absl::Status DetectInFiles(const DetectArguments& arguments, DetectSession& session) {
  ASSIGN_OR_RETURN(const std::vector<ListedImage> images, ListImages(arguments.images));
  std::vector<std::string> views;
  for (const ListedImage& image : images) {
    if (views.empty() || views.back() != image.view) views.push_back(image.view);
  }
  ASSIGN_OR_RETURN(const DetectSettings settings, LoadDetectSettings(arguments, views));
  size_t done = 0;
  {
    FileDetection detection(images, settings, session);
    RETURN_IF_ERROR(detection.Run());
    done = detection.done();
  }
  if (done == images.size()) {
    RETURN_IF_ERROR(CheckThatTagsWereSeen(session, images, settings.families));
  }
  RETURN_IF_ERROR(DrawCoverage(settings, session));
  if (done == images.size()) return absl::OkStatus();
  session.Judge();
  RETURN_IF_ERROR(WriteSightings(session, arguments.out));
  return absl::CancelledError(absl::StrCat("stopped after ", done, " of ", images.size(),
                                           " images; what they show is in ", arguments.out));
}

int RunDetect(const DetectArguments& arguments) {
  CatchStopSignals();
  DetectSession session;
  absl::Status status =
      arguments.cell.empty() ? DetectInFiles(arguments, session) : DetectLive(arguments, session);
  if (absl::IsCancelled(status)) {
    std::cerr << status.message() << std::endl;
    return kNo;
  }
  session.Judge();
  if (status.ok()) status = session.CheckThatTagsWereSeen();
  if (status.ok()) status = WriteSightings(session, arguments.out);
  if (!status.ok()) return Report(kDetectProgram, status);
  if (arguments.format == "json") {
    PrintDetectionJson(session, arguments.out);
  } else {
    PrintDetection(session, arguments.out);
  }
  return kDone;
}

}  // namespace

void AddDetectCommand(CLI::App& program, Run& run) {
  CLI::App* command =
      program.add_subcommand("detect", "Find the corners of the boards' tags in images");
  auto a = std::make_shared<DetectArguments>();
  auto* images = command->add_option(
      "--images", a->images,
      "A view's images, VIEW=PATTERN or VIEW=FOLDER; once per view. Images of one frame, which is "
      "what the * matches, were taken at once");
  auto* cell = command->add_option("--cell", a->cell,
                                   "cell.yaml: take the images from the cell's cameras, live");
  images->excludes(cell);
  command
      ->add_option("--count", a->count,
                   "Live: how many sets of images; until Ctrl-C if not said, of those in which "
                   "something has moved")
      ->needs(cell)
      ->check(CLI::Range(1, 100000));
  command->add_option("--interval", a->interval, "Live: seconds between sets")
      ->needs(cell)
      ->check(CLI::Range(0.0, 3600.0))
      ->capture_default_str();
  command->add_option("--save", a->save, "Live: keep the images in this folder, one folder a view")
      ->needs(cell);
  command->add_option("--boards", a->boards, "Boards (YAML), as `board` writes them; several files")
      ->required();
  command->add_option("--cameras", a->cameras,
                      "Folder with a .cameramodel file per view: edges are then straight, corners "
                      "better. Run `detect` again with it when the lenses are known");
  command->add_option("--out", a->out, "Corners (CSV)")->required();
  command->add_flag("--overwrite", a->overwrite, "Live: replace OUT if it is there");
  command->add_option("--draw", a->draw, "Folder for pictures of what was seen, and of coverage");
  AddFormatOption(*command, a->format);
  command->footer(
      "Examples:\n"
      "  silhouette-calibrate detect --images 'left=left/*.png' --images 'right=right/*.png' \\\n"
      "      --boards wall.yaml --out corners.csv --draw seen\n"
      "  silhouette-calibrate detect --cell cell.yaml --boards wall.yaml --out corners.csv --save "
      "images");
  command->callback([a, &run] {
    if (a->images.empty() && a->cell.empty()) {
      throw CLI::ValidationError("detect", "give --images for each view, or --cell");
    }
    run = [a] { return RunDetect(*a); };
  });
}

}  // namespace silhouette
