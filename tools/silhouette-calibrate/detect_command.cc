// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate detect
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "calib/boards/tag_family.h"
#include "calib/boards/vnl_file.h"
#include "capture/session/cell_cameras.h"
#include "common/picture/files.h"
#include "common/picture/picture.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/cell/cell.h"
#include "tools/cell/devices/cell_devices.h"
#include "tools/program/program.h"
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

// Gives the corners' file the time of the oldest of the files that they come from: what it shows is
// as old, whenever it is written.
absl::Status DateBack(const std::string& out, const std::vector<std::string>& sources) {
  if (!fs::is_regular_file(out)) return absl::OkStatus();
  std::error_code error;
  for (const std::string& source : sources) {
    const fs::file_time_type taken = fs::last_write_time(source, error);
    if (!error && taken < fs::last_write_time(out, error)) fs::last_write_time(out, taken, error);
    if (error) {
      return FailedPrecondition("'", out, "' cannot have the time of '", source,
                                "': ", error.message(), "; take another --out");
    }
  }
  return absl::OkStatus();
}

absl::Status WriteCorners(const DetectArguments& arguments, const DetectSession& session) {
  RETURN_IF_ERROR(WriteSightings(session, arguments.out));
  if (!arguments.cell.empty()) return absl::OkStatus();
  std::vector<std::string> sources;
  for (const SessionImage& image : session.images()) sources.push_back(image.source);
  return DateBack(arguments.out, sources);
}

absl::Status DetectInFiles(const DetectArguments& arguments, DetectSession& session) {
  ASSIGN_OR_RETURN(const std::vector<ListedImage> images, ListImages(arguments.images));
  std::vector<std::string> views;
  for (const ListedImage& image : images) {
    if (views.empty() || views.back() != image.view) views.push_back(image.view);
  }
  ASSIGN_OR_RETURN(const DetectSettings settings, SettingsFor(arguments, views));
  ASSIGN_OR_RETURN(const size_t done, DetectAll(images, settings, [&](size_t i, ImageTags tags) {
                     return session.Add(std::move(tags), images[i].path);
                   }));
  if (done == images.size()) {
    RETURN_IF_ERROR(CheckThatTagsWereSeen(session, images, FamiliesOf(settings.boards)));
    RETURN_IF_ERROR(CheckChessboardSize(session, settings.boards));
  }
  RETURN_IF_ERROR(DrawCoverage(settings, session));
  if (done == images.size()) return absl::OkStatus();
  const std::string stopped =
      absl::StrCat("stopped after ", done, " of ", images.size(), " images; ");
  if (fs::exists(arguments.out)) {
    return absl::CancelledError(absl::StrCat(stopped, arguments.out, " is left as it was"));
  }
  session.Judge();
  RETURN_IF_ERROR(WriteCorners(arguments, session));
  return absl::CancelledError(absl::StrCat(stopped, "what they show is in ", arguments.out));
}

std::string FrameOfSet(int number) { return absl::StrFormat("%04d", number); }

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
    const std::string frame = FrameOfSet(kept_ + 1);
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

// AlreadyExists: live images would be kept among other ones.
absl::Status CheckSaveFolder(const DetectArguments& arguments, const Cell& cell) {
  if (arguments.overwrite || arguments.save.empty()) return absl::OkStatus();
  for (const ViewSettings& view : cell.views) {
    const fs::path folder = fs::path(arguments.save) / view.name;
    std::error_code error;  // the folder is not there
    if (fs::directory_iterator(folder, error) == fs::directory_iterator()) continue;
    return absl::AlreadyExistsError("'" + folder.string() +
                                    "' has files already; take another --save, or --overwrite");
  }
  return absl::OkStatus();
}

// Those of a live session, so that the folder has images of one session only.
void RemoveSavedImages(const DetectArguments& arguments, const std::vector<std::string>& views) {
  if (arguments.save.empty()) return;
  for (const std::string& view : views) {
    const fs::path folder = fs::path(arguments.save) / view;
    std::error_code error;
    for (int set = 1; fs::remove(folder / (FrameOfSet(set) + ".png"), error); ++set) continue;
  }
}

// Grabs sets of images from the cell's cameras until there are enough or a stop was asked for.
absl::Status DetectLive(const DetectArguments& arguments, DetectSession& session) {
  if (!arguments.overwrite && fs::exists(arguments.out)) {
    return absl::AlreadyExistsError("'" + arguments.out +
                                    "' is there already; take another --out, or --overwrite");
  }
  ASSIGN_OR_RETURN(const auto cell, LoadCell(arguments.cell));
  RETURN_IF_ERROR(CheckSaveFolder(arguments, cell));
  auto rig = OpenCamerasOfCell(cell, true);
  if (!rig.ok()) {
    return absl::Status(rig.status().code(),
                        absl::StrCat(rig.status().message(),
                                     "; or take the images otherwise and give them (--images)"));
  }
  ASSIGN_OR_RETURN(auto cameras, CamerasOfViews(cell, **rig));
  std::vector<std::string> views;
  for (const ViewSettings& view : cell.views) views.push_back(view.name);
  ASSIGN_OR_RETURN(const auto settings, SettingsFor(arguments, views));
  RemoveSavedImages(arguments, views);

  if (arguments.count == 0) {
    std::cerr << "Move the board; sets in which it has moved are kept. Ctrl-C ends." << std::endl;
  }
  LiveDetection detection(arguments, settings, views, session);
  while (!StopRequested() && (arguments.count == 0 || detection.kept() < arguments.count)) {
    ASSIGN_OR_RETURN(const ImageSet set, GrabSet(cameras));
    RETURN_IF_ERROR(detection.Take(set));
    if (detection.kept() != arguments.count || arguments.count == 0) Wait(arguments.interval);
  }
  RETURN_IF_ERROR(DrawCoverage(settings, session));
  if (detection.kept() >= arguments.count) return absl::OkStatus();
  return absl::CancelledError(
      absl::StrCat("stopped after ", detection.kept(), " of ", arguments.count, " sets",
                   detection.kept() == 0 ? "" : "; what they show is in " + arguments.out));
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
  RETURN_IF_ERROR(DateBack(arguments.out, {arguments.corners}));
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
  const bool stopped = absl::IsCancelled(status);
  if (stopped) {
    std::cerr << status.message() << std::endl;
    if (arguments.cell.empty() || session.images().empty()) return kNo;
  }
  session.Judge();
  if (status.ok()) status = session.CheckThatTagsWereSeen();
  if (!status.ok() && !stopped) return status;
  RETURN_IF_ERROR(WriteCorners(arguments, session));
  RETURN_IF_ERROR(WriteVnl(arguments, session));
  PrintResult(arguments.format, DetectionJson(session, arguments.out),
              DetectionText(session, arguments.out));
  return stopped ? kNo : kDone;
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
  command->add_flag("--overwrite", a->overwrite,
                    "Live: replace OUT, and the images of a live session in the --save folder");
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
