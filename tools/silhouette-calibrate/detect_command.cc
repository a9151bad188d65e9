// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate detect
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "calib/boards/tag_family.h"
#include "calib/boards/vnl_file.h"
#include "capture/session/cell_cameras.h"
#include "common/parallel/parallel.h"
#include "common/picture/files.h"
#include "common/picture/image_file.h"
#include "common/picture/picture.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/cell/cell.h"
#include "tools/cell/devices/cell_devices.h"
#include "tools/program/program.h"
#include "tools/program/progress.h"
#include "tools/silhouette-calibrate/commands.h"
#include "tools/silhouette-calibrate/detect.h"
#include "tools/silhouette-calibrate/files.h"
#include "tools/silhouette-calibrate/frame_files.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

struct DetectArguments {
  std::vector<std::string> images;  // VIEW=PATTERN
  std::string corners;              // corners.vnl; empty: the images are looked at
  std::string vnl;                  // corners.vnl to be written; empty: none
  std::string cell;
  int count = 0;        // sets of live images; 0: until Ctrl-C
  double interval = 1;  // seconds between them
  std::string save;     // folder for live images; empty: not kept
  std::vector<std::string> boards;
  std::string cameras;  // folder of .cameramodel files; empty: none
  std::string out;
  bool overwrite = false;
  std::string draw;  // folder; empty: no pictures
  std::string format = "text";
};

absl::StatusOr<DetectSettings> SettingsFor(const DetectArguments& arguments,
                                           const std::vector<std::string>& views) {
  return LoadDetectSettings(arguments.boards, arguments.cameras, views, arguments.draw);
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

// Whether a JPEG file ends before its image does: no end after the first scan's start.
bool IsCutOff(std::string_view file) {
  if (!file.starts_with("\xff\xd8")) return false;
  const auto byte = [&](size_t at) { return static_cast<size_t>(static_cast<uint8_t>(file[at])); };
  size_t at = 2;
  while (at + 4 <= file.size() && byte(at) == 0xff && byte(at + 1) != 0xda) {
    at += byte(at + 1) == 0xff ? 1 : 2 + 256 * byte(at + 2) + byte(at + 3);
  }
  return at >= file.size() || file.find("\xff\xd9", at) == std::string_view::npos;
}

// Grey, in the camera's own orientation whatever the file says of how to hold it.
absl::StatusOr<cv::Mat> ReadImage(const std::string& path) {
  ASSIGN_OR_RETURN(const std::string file, ReadWholeFile(path));
  if (IsCutOff(file)) {
    return InvalidArgument("'", path,
                           "' was cut off: its image has no end; copy it again, or remove it");
  }
  cv::Mat image = ImageOfBytes(
      file, cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION);
  if (image.empty()) {
    return InvalidArgument("'", path,
                           "' cannot be read as an image; remove it, or mend its view's "
                           "pattern");
  }
  if (image.depth() == CV_16U) return EightBits(image);
  if (image.depth() != CV_8U) {
    return InvalidArgument("'", path, "' has neither 8 nor 16 bits a pixel; convert it to such");
  }
  return image;
}

// Looks at all images with all processors. The first mistake, or a stop signal, ends it. Returns
// how many images were looked at.
absl::StatusOr<size_t> DetectAll(const std::vector<ListedImage>& images,
                                 const DetectSettings& settings, DetectSession& session) {
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
    status = tags.ok() ? session.Add(*std::move(tags), file.path) : tags.status();
    if (status.ok()) progress.Update(++done);
    return status.ok();
  });
  RETURN_IF_ERROR(status);
  return done;
}

// For those who gave the wrong boards: what the first images show of other boards, of tags of
// families that are not among `looked_for`. Empty if nothing.
std::string OtherBoards(const std::vector<ListedImage>& images,
                        const std::vector<std::string>& looked_for) {
  constexpr size_t kImages = 3;
  constexpr int kMostTags = 10000;  // larger families take seconds to prepare, and are rare
  std::vector<std::string> others;
  for (const std::string& family : TagFamily::Names()) {
    if (std::ranges::find(looked_for, family) == looked_for.end() &&
        TagFamily(family).tags() <= kMostTags) {
      others.push_back(family);
    }
  }
  TagDetector detector(others);
  std::set<std::string> seen;
  for (size_t i = 0; i < std::min(kImages, images.size()); ++i) {
    const absl::StatusOr<cv::Mat> image = ReadImage(images[i].path);
    if (!image.ok()) continue;
    for (const DetectedTag& tag : detector.Detect(*image)) {
      seen.insert(absl::StrCat("tags of ", tag.family));
    }
    if (const auto size = ChessboardIn(*image)) {
      seen.insert(
          absl::StrCat("a chessboard of ", size->columns, "x", size->rows, " inner corners"));
    }
    if (const std::string dictionary = DictionaryIn(*image); !dictionary.empty()) {
      seen.insert("markers of " + dictionary);
    }
  }
  return absl::StrJoin(seen, ", ");
}

// A smaller chessboard is found in a larger one, now and then. InvalidArgument if few images show
// the only board, a chessboard, and others a larger one.
absl::Status CheckChessboardSize(const DetectSession& session, const std::vector<Board>& boards) {
  constexpr size_t kImages = 5;
  constexpr size_t kLeast = 2;
  const BoardDescription& stated = boards.front().description();
  if (boards.size() > 1 || stated.kind != BoardKind::kChessboard) return absl::OkStatus();
  std::vector<const SessionImage*> without;
  for (const SessionImage& image : session.images()) {
    if (image.tags.tags.empty()) without.push_back(&image);
  }
  if (2 * without.size() <= session.images().size()) return absl::OkStatus();
  const int rows = std::min(stated.rows, stated.columns);
  const int columns = std::max(stated.rows, stated.columns);
  const size_t step = (without.size() + kImages - 1) / kImages;
  std::map<std::pair<int, int>, std::vector<std::string>> larger;  // images, by the size
  for (size_t i = 0; i < without.size(); i += step) {
    const absl::StatusOr<cv::Mat> image = ReadImage(without[i]->source);
    const std::optional<GridSize> size = image.ok() ? ChessboardIn(*image) : std::nullopt;
    if (!size || size->columns < columns || size->rows < rows) continue;
    larger[{size->columns, size->rows}].push_back(without[i]->source);
  }
  for (const auto& [size, images] : larger) {
    if (images.size() < kLeast || size == std::pair(columns, rows)) continue;
    return InvalidArgument(session.images().size() - without.size(), " of ",
                           session.images().size(), " images show a chessboard of ", columns, "x",
                           rows, " inner corners; others, such as '", images.front(),
                           "', show one of ", size.first, "x", size.second,
                           ": correct --boards, which counts inner corners, not squares");
  }
  return absl::OkStatus();
}

// NotFound, with the likely reason, if nothing was seen.
absl::Status CheckThatTagsWereSeen(const DetectSession& session,
                                   const std::vector<ListedImage>& images,
                                   const std::vector<std::string>& families) {
  const absl::Status status = session.CheckThatTagsWereSeen();
  const bool reason_known = std::ranges::any_of(session.images(), [](const SessionImage& image) {
    return image.tags.mirrored || !image.tags.foreign.empty();
  });
  if (status.ok() || reason_known) return status;
  const std::string others = OtherBoards(images, families);
  if (others.empty()) return status;
  return NotFound("none of ", images.size(), " images shows one of the boards; they show ", others,
                  ": is --boards the right file?");
}

absl::Status DetectInFiles(const DetectArguments& arguments, DetectSession& session) {
  ASSIGN_OR_RETURN(const std::vector<ListedImage> images, ListImages(arguments.images));
  std::vector<std::string> views;
  for (const ListedImage& image : images) {
    if (views.empty() || views.back() != image.view) views.push_back(image.view);
  }
  ASSIGN_OR_RETURN(const DetectSettings settings, SettingsFor(arguments, views));
  ASSIGN_OR_RETURN(const size_t done, DetectAll(images, settings, session));
  if (done == images.size()) {
    RETURN_IF_ERROR(CheckThatTagsWereSeen(session, images, FamiliesOf(settings.boards)));
    RETURN_IF_ERROR(CheckChessboardSize(session, settings.boards));
  }
  RETURN_IF_ERROR(DrawCoverage(settings, session));
  if (done == images.size()) return absl::OkStatus();
  session.Judge();
  RETURN_IF_ERROR(WriteSightings(session, arguments.out));
  return absl::CancelledError(absl::StrCat("stopped after ", done, " of ", images.size(),
                                           " images; what they show is in ", arguments.out));
}

// One set after the other.
class LiveDetection {
 public:
  LiveDetection(const DetectArguments& arguments, const DetectSettings& settings,
                const std::vector<std::string>& views, DetectSession& session)
      : arguments_(arguments),
        settings_(settings),
        views_(views),
        detector_(settings.boards),
        session_(session) {}

  int kept() const { return kept_; }

  absl::Status Take(const ImageSet& set) {
    const std::string frame = absl::StrFormat("%04d", kept_ + 1);
    std::vector<ImageTags> found;
    std::vector<cv::Mat> greys;
    for (size_t v = 0; v < views_.size(); ++v) {
      const cv::Mat grey = GreyOf(set.images[v]);
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
      RETURN_IF_ERROR(MakeFolder(folder.string()));
      RETURN_IF_ERROR(WritePng((folder / (tags.frame + ".png")).string(), image));
    }
    return session_.Add(tags, absl::StrCat(tags.view, " ", tags.frame));
  }

  const DetectArguments& arguments_;
  const DetectSettings& settings_;
  const std::vector<std::string>& views_;
  BoardDetector detector_;
  DetectSession& session_;
  std::vector<ImageTags> last_;
  int kept_ = 0;
};

// Returns early if a stop was asked for.
void Wait(double seconds) {
  const absl::Time until = absl::Now() + absl::Seconds(seconds);
  while (!StopRequested() && absl::Now() < until) absl::SleepFor(absl::Milliseconds(20));
}

// Grabs sets of images from the cell's cameras until there are enough or a stop was asked for.
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
  ASSIGN_OR_RETURN(const auto settings, SettingsFor(arguments, views));

  if (arguments.count == 0) {
    std::cerr << "Move the board; sets in which it has moved are kept. Ctrl-C ends." << std::endl;
  }
  LiveDetection detection(arguments, settings, views, session);
  while (!StopRequested() && (arguments.count == 0 || detection.kept() < arguments.count)) {
    ASSIGN_OR_RETURN(const ImageSet set, GrabSet(cameras));
    RETURN_IF_ERROR(detection.Take(set));
    if (detection.kept() != arguments.count || arguments.count == 0) Wait(arguments.interval);
  }
  return DrawCoverage(settings, session);
}

// The one board that a corners.vnl is of.
absl::StatusOr<Board> BoardOfVnl(const std::vector<Board>& boards) {
  if (boards.size() == 1) return boards.front();
  return InvalidArgument("corners.vnl is of one board; give one in --boards, not ", boards.size());
}

absl::Status WriteVnl(const DetectArguments& arguments, const DetectSession& session) {
  if (arguments.vnl.empty()) return absl::OkStatus();
  ASSIGN_OR_RETURN(const DetectSettings settings, LoadDetectSettings(arguments.boards));
  ASSIGN_OR_RETURN(const Board board, BoardOfVnl(settings.boards));
  std::map<std::pair<std::string, std::string>, std::string> files;
  for (const SessionImage& image : session.images()) {
    files[{image.tags.view, image.tags.frame}] = image.source;
  }
  ASSIGN_OR_RETURN(const std::string text,
                   VnlFileText(session.Sightings(), board, [&](const TagSighting& sighting) {
                     return files.at({sighting.view, sighting.frame});
                   }));
  return WriteWholeFile(arguments.vnl, text);
}

// --corners: of a corners.vnl to those of all views.
absl::StatusOr<ExitCode> Convert(const DetectArguments& arguments) {
  ASSIGN_OR_RETURN(const auto patterns, ViewPatterns(arguments.images));
  ASSIGN_OR_RETURN(const DetectSettings settings, LoadDetectSettings(arguments.boards));
  ASSIGN_OR_RETURN(const Board board, BoardOfVnl(settings.boards));
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(arguments.corners));
  ASSIGN_OR_RETURN(const auto images, SightingsFromVnl(text, arguments.corners, board));
  std::vector<TagSighting> sightings;
  size_t taken = 0;
  for (const auto& [file, of_image] : images) {
    for (const ViewPattern& view : patterns) {
      const std::optional<std::string> frame = FrameByPath(file, view.pattern);
      if (!frame) continue;
      ++taken;
      for (TagSighting sighting : of_image) {
        sighting.view = view.view;
        sighting.frame = *frame;
        sightings.push_back(std::move(sighting));
      }
      break;
    }
  }
  if (sightings.empty()) {
    return InvalidArgument(arguments.corners, ": none of its ", images.size(),
                           " images matches --images; the first is '", images.begin()->first, "'");
  }
  RETURN_IF_ERROR(WriteWholeFile(arguments.out, SightingFileText(sightings)));
  PrintResult(arguments.format,
              {{"out", arguments.out}, {"sightings", sightings.size()}, {"images", taken}},
              absl::StrCat("wrote ", arguments.out, ": ", sightings.size(), " corners or tags of ",
                           taken, " of ", images.size(), " images in ", arguments.corners, "\n"));
  return kDone;
}

absl::StatusOr<ExitCode> RunDetect(const DetectArguments& arguments) {
  if (!arguments.corners.empty()) return Convert(arguments);
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
  RETURN_IF_ERROR(status);
  RETURN_IF_ERROR(WriteSightings(session, arguments.out));
  RETURN_IF_ERROR(WriteVnl(arguments, session));
  PrintResult(arguments.format, DetectionJson(session, arguments.out),
              DetectionText(session, arguments.out));
  return kDone;
}

}  // namespace

void AddDetectCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand("detect", "Find the boards' corners in images");
  auto a = std::make_shared<DetectArguments>();
  auto* images = command->add_option(
      "--images", a->images,
      "A view's images, VIEW=PATTERN or VIEW=FOLDER; once per view. The frame is what the * "
      "matches; images of one frame were taken at once");
  auto* cell = command->add_option("--cell", a->cell,
                                   "cell.yaml: take the images from the cell's cameras, live");
  images->excludes(cell);
  command
      ->add_option(
          "--count", a->count,
          "Live: number of image sets; default: until Ctrl-C, keeping sets in which something "
          "has moved")
      ->needs(cell)
      ->check(CLI::Range(1, 100000));
  TakeTimes(command->add_option("--interval", a->interval, "Live: time between sets"), 0, 3600)
      ->needs(cell)
      ->default_str("1 s");
  command->add_option("--save", a->save, "Live: keep the images in this folder, one folder a view")
      ->needs(cell);
  command
      ->add_option("--boards", a->boards,
                   "Boards (YAML), as `board` writes them or Kalibr's target; several files")
      ->required();
  auto* corners = command->add_option(
      "--corners", a->corners,
      "mrcal's corners.vnl: take its corners, do not open the images; --images names its files");
  corners->excludes(cell)->needs(images);
  command->add_option("--vnl", a->vnl, "Also write the corners as mrcal's corners.vnl")
      ->excludes(corners);
  command->add_option("--cameras", a->cameras,
                      "Folder with a .cameramodel file per view: corners are then "
                      "more exact. Run `detect` again with it when the lenses are known");
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
