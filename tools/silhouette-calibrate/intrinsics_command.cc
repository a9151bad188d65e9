// SPDX-License-Identifier: Apache-2.0
// silhouette-calibrate intrinsics
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "calib/files/camera_file.h"
#include "calib/files/foreign_camera_file.h"
#include "calib/intrinsics/lens_doubts.h"
#include "calib/intrinsics/solve_lenses.h"
#include "common/picture/files.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/program/program.h"
#include "tools/program/progress.h"
#include "tools/silhouette-calibrate/commands.h"
#include "tools/silhouette-calibrate/files.h"
#include "tools/silhouette-calibrate/pictures.h"
#include "tools/silhouette-calibrate/results.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

struct IntrinsicsArguments {
  std::string corners;
  double sigma = 0;
  std::string boards;
  std::vector<std::string> board_names;
  std::vector<std::string> views;
  std::vector<std::string> image_sizes;
  std::string fixed;
  std::string from;
  std::string camera;
  bool fisheye = false;
  bool unconnected = false;
  bool flat = false;
  bool not_simultaneous = false;
  LensSettings settings;
  std::string out;
  std::string draw;
  std::string format = "text";
};

// The size that is given for a view; nothing if none is.
absl::StatusOr<std::optional<PixelSize>> SizeGivenFor(const IntrinsicsArguments& arguments,
                                                      const std::string& view) {
  std::optional<PixelSize> size;
  for (const std::string& given : arguments.image_sizes) {
    const size_t sign = given.rfind('=');
    if (sign != std::string::npos && given.substr(0, sign) != view) continue;
    ASSIGN_OR_RETURN(
        const PixelSize read,
        SizeFromText(sign == std::string::npos ? given : given.substr(sign + 1), "--image-size"));
    // One for all is what the others are not.
    if (sign != std::string::npos || !size) size = read;
  }
  return size;
}

// "fx,fy,cx,cy" and distortion coefficients, as OpenCV's YAML; empty: `text` is no such list.
std::string CameraOfNumbers(const std::string& text) {
  const std::vector<std::string> numbers =
      absl::StrSplit(text, absl::ByAnyChar(", "), absl::SkipEmpty());
  double value = 0;
  const auto is_number = [&](const std::string& one) { return absl::SimpleAtod(one, &value); };
  if (numbers.size() < 4 || !std::ranges::all_of(numbers, is_number)) return "";
  return absl::StrCat("camera_matrix: [", numbers[0], ", 0, ", numbers[2], ", 0, ", numbers[1],
                      ", ", numbers[3], ", 0, 0, 1]\ndistortion_coefficients: [",
                      absl::StrJoin(numbers.begin() + 4, numbers.end(), ", "), "]\n");
}

absl::StatusOr<ForeignCamera> ReadCamera(const std::string& file,
                                         const std::optional<PixelSize>& size,
                                         const std::string& camera, bool fisheye) {
  ForeignCameraOptions options{.camera = camera, .fisheye = fisheye};
  if (size) options.image_size = {size->width, size->height};
  if (const std::string numbers = CameraOfNumbers(file); !numbers.empty()) {
    return CameraFromForeignText(numbers, "--from", options);
  }
  ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(file));
  return CameraFromForeignText(text, file, options);
}

// --from: one file to a .cameramodel.
absl::StatusOr<ExitCode> Convert(const IntrinsicsArguments& arguments) {
  if (arguments.views.size() != 1) {
    return InvalidArgument("--from needs --view, one view's name");
  }
  const std::string& view = arguments.views[0];
  ASSIGN_OR_RETURN(const auto size, SizeGivenFor(arguments, view));
  ASSIGN_OR_RETURN(const ForeignCamera read,
                   ReadCamera(arguments.from, size, arguments.camera, arguments.fisheye));
  ASSIGN_OR_RETURN(const std::string file,
                   WriteCameraFile(arguments.out, view, read.camera, read.known));
  const CameraIntrinsics& k = read.camera.intrinsics();
  if (read.format != "mrcal" &&
      std::ranges::all_of(k.distortion, [](double c) { return c == 0; })) {
    std::cerr << "silhouette-calibrate: warning: '" << arguments.from
              << "' has no distortion; if the lens has some, give its coefficients too"
              << std::endl;
  }
  PrintResult(
      arguments.format,
      {{"from", read.format},
       {"focal_lengths", {k.fx, k.fy}},
       {"image_size", {k.width, k.height}},
       {"converted_px", read.converted},
       {"may_be_fisheye", read.may_be_fisheye},
       {"file", file}},
      absl::StrCat(read.format, "'s camera of ", k.width, "x", k.height, " pixels, focal lengths ",
                   k.fx, ", ", k.fy, "; wrote ", file, "\n",
                   read.converted == 0
                       ? ""
                       : absl::StrFormat("Converted from an equidistant lens: off by at most %.2g "
                                         "pixels.\n",
                                         read.converted),
                   read.may_be_fisheye
                       ? "Its four coefficients were read as k1, k2, p1, p2; if they are of "
                         "cv2.fisheye, give --fisheye.\n"
                       : "",
                   read.format == "mrcal" ? "" : "Its pose is not set; `poses` finds it.\n"));
  return kDone;
}

struct Input {
  std::vector<LensCamera> cameras;
  std::vector<Board> boards;
  std::vector<TagSighting> sightings;
};

absl::Status TakeBoards(const IntrinsicsArguments& arguments, Input& input) {
  ASSIGN_OR_RETURN(std::vector<Board> boards, ReadBoards(arguments.boards));
  for (const std::string& name : arguments.board_names) {
    const bool there = std::ranges::any_of(
        boards, [&](const Board& board) { return board.description().name == name; });
    if (!there) {
      return InvalidArgument("there is no board '", name, "' in ", arguments.boards);
    }
  }
  for (Board& board : boards) {
    const auto& names = arguments.board_names;
    if (names.empty() || std::ranges::find(names, board.description().name) != names.end()) {
      input.boards.push_back(std::move(board));
    }
  }
  return absl::OkStatus();
}

absl::Status AddCamera(const IntrinsicsArguments& arguments, const std::string& view,
                       Input& input) {
  ASSIGN_OR_RETURN(const auto size, SizeGivenFor(arguments, view));
  LensCamera camera{.name = view};
  if (!arguments.fixed.empty()) {
    const std::string file = (fs::path(arguments.fixed) / CameraFileName(view)).string();
    ASSIGN_OR_RETURN(const auto read, ReadCamera(file, size, "", false));
    camera.fixed = read.camera.intrinsics();
    camera.known = read.known;
    camera.width = camera.fixed->width;
    camera.height = camera.fixed->height;
  } else {
    const auto known = size ? size : ImageSizeOf(input.sightings, view);
    if (!known) {
      return InvalidArgument(arguments.corners, " has no sizes of images: give that of the view '",
                             view, "', as --image-size ", view, "=1280x960");
    }
    camera.width = known->width;
    camera.height = known->height;
  }
  input.cameras.push_back(camera);
  return absl::OkStatus();
}

absl::StatusOr<Input> ReadInput(const IntrinsicsArguments& arguments) {
  if (arguments.corners.empty() || arguments.boards.empty()) {
    return InvalidArgument(
        "give --corners and --boards to solve for lenses, or --from FILE --view NAME to read one");
  }
  Input input;
  RETURN_IF_ERROR(TakeBoards(arguments, input));
  ASSIGN_OR_RETURN(input.sightings, ReadSightings(arguments.corners, arguments.sigma));
  std::set<std::string> seen;
  for (const TagSighting& sighting : input.sightings) seen.insert(sighting.view);
  std::vector<std::string> views = arguments.views;
  if (views.empty()) views.assign(seen.begin(), seen.end());
  for (const std::string& view : views) {
    if (!seen.contains(view)) {
      return InvalidArgument("there is no corner of the view '", view, "' in ", arguments.corners);
    }
    RETURN_IF_ERROR(AddCamera(arguments, view, input));
  }
  std::erase_if(input.sightings, [&](const TagSighting& sighting) {
    return std::ranges::find(views, sighting.view) == views.end();
  });
  return input;
}

absl::StatusOr<std::vector<std::string>> Write(const IntrinsicsArguments& arguments,
                                               const LensSolution& solution) {
  std::vector<std::string> files;
  RETURN_IF_ERROR(MakeFolder(arguments.out));
  for (const SolvedCamera& camera : solution.cameras) {
    files.push_back((fs::path(arguments.out) / CameraFileName(camera.name)).string());
    RETURN_IF_ERROR(WriteWholeFile(files.back(), LensFileText(camera)));
  }
  if (arguments.draw.empty()) return files;
  RETURN_IF_ERROR(MakeFolder(arguments.draw));
  for (size_t i = 0; i < solution.cameras.size(); ++i) {
    const SolvedCamera& camera = solution.cameras[i];
    const fs::path name = fs::path(CameraFileName(camera.name)).stem();
    files.push_back((fs::path(arguments.draw) / (name.string() + "-residuals.png")).string());
    std::vector<LensResidual> residuals = solution.residuals;
    std::erase_if(residuals, [&](const LensResidual& r) { return r.camera != i; });
    const std::string caption = absl::StrFormat(
        "%d images, %d corners, %d left out; rms %.3f px per axis; %.0f %% of the image seen",
        camera.images, camera.corners, camera.outliers, camera.rms, 100 * camera.covered);
    RETURN_IF_ERROR(
        WritePng(files.back(), PictureOfResiduals(camera.name, {camera.width, camera.height},
                                                  camera.rms, residuals, caption)));
    if (camera.map.sigmas.empty()) continue;
    files.push_back((fs::path(arguments.draw) / (name.string() + "-known.png")).string());
    RETURN_IF_ERROR(WritePng(files.back(), PictureOfLensMap(camera)));
  }
  return files;
}

absl::StatusOr<ExitCode> RunIntrinsics(IntrinsicsArguments arguments) {
  if (!arguments.from.empty()) return Convert(arguments);
  ASSIGN_OR_RETURN(const Input input, ReadInput(arguments));
  RETURN_IF_ERROR(CheckFirstIds(input.boards, input.sightings));
  arguments.settings.board_warp = !arguments.flat;
  arguments.settings.simultaneous = !arguments.not_simultaneous;
  std::optional<Steps> steps(std::in_place, "intrinsics");
  arguments.settings.step = [&](const std::string& step) { steps->Begin(step); };
  const absl::StatusOr<LensSolution> solution =
      SolveLenses(input.cameras, input.boards, input.sightings, arguments.settings);
  const absl::Status fit = solution.ok() ? CheckFit(input.cameras, input.boards, input.sightings,
                                                    arguments.settings, *solution)
                                         : absl::OkStatus();
  steps.reset();
  if (!solution.ok()) {
    const ExitCode code = Report("silhouette-calibrate", solution.status());
    const std::string wrong = WrongGaps(input.boards, input.sightings);
    if (!wrong.empty()) std::cerr << "silhouette-calibrate: " << wrong << std::endl;
    return absl::IsFailedPrecondition(solution.status()) ? kNo : code;
  }
  if (!fit.ok()) {
    Report("silhouette-calibrate", fit);
    return kNo;
  }
  if (solution->groups.size() > 1 && !arguments.unconnected && arguments.settings.simultaneous) {
    Report("silhouette-calibrate",
           FailedPrecondition(solution->warnings.back(),
                              "; take images in which they see a board at once, or accept lenses "
                              "without common poses by --unconnected"));
    return kNo;
  }
  ASSIGN_OR_RETURN(const auto files, Write(arguments, *solution));
  PrintResult(arguments.format, LensJson(*solution, files), LensText(*solution, files));
  return kDone;
}

}  // namespace

void AddIntrinsicsCommand(CLI::App& program, Run& run) {
  CLI::App* command = program.add_subcommand(
      "intrinsics",
      "Find the cameras' lenses from images of boards, or read them from other files");
  auto a = std::make_shared<IntrinsicsArguments>();
  command->add_option("--corners", a->corners, "The corners that `detect` found, CSV");
  AddSigmaOption(*command, a->sigma);
  command->add_option("--boards", a->boards, "The boards that were seen, YAML");
  command->add_option("--board", a->board_names, "Use these boards only")->delimiter(',');
  command->add_option("--view", a->views, "Use these views only")->delimiter(',');
  command
      ->add_option("--image-size", a->image_sizes,
                   "Size of a view's images, left=1280x960, or of all, 1280x960; default: as "
                   "`detect` wrote it into --corners")
      ->check(SizeInPixels());
  command->add_option("--out", a->out, "The folder for the .cameramodel files")->required();
  command->add_option("--model", a->settings.lens_model, "Lens model, by mrcal's name")
      ->capture_default_str();
  auto* fixed = command->add_option(
      "--fix-intrinsics", a->fixed,
      "A folder of .cameramodel files whose lenses are kept; only poses are solved for");
  command->add_flag("--flat", a->flat, "Assume a flat board");
  command->add_flag("--unconnected", a->unconnected,
                    "Accept cameras that no board connects: their poses then have no common frame");
  command
      ->add_flag("--not-simultaneous", a->not_simultaneous,
                 "The images of a frame were not taken at one instant, e.g. of a board held by "
                 "hand: find each lens by itself, and no poses")
      ->excludes(fixed);
  command
      ->add_option("--least-images", a->settings.least_images, "Least number of images per camera")
      ->check(CLI::Range(3, 100000))
      ->capture_default_str();
  command
      ->add_option("--most-uncertain", a->settings.most_uncertain,
                   "Where a lens is known: up to this standard deviation of a projection, as a "
                   "share of the image's width")
      ->check(CLI::Range(1e-6, 0.1))
      ->capture_default_str();
  command
      ->add_option("--least-known", a->settings.least_known,
                   "Refuse a lens that is known in a smaller share of the image")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  command->add_option(
      "--draw", a->draw,
      "A folder for pictures of each camera's residuals, and of where its lens is known");
  command
      ->add_option("--from", a->from,
                   "Read a camera instead: a .cameramodel, OpenCV's YAML or XML, ROS's or Kalibr's "
                   "YAML, or a 3 x 3 matrix or fx,fy,cx,cy, and after it OpenCV's coefficients "
                   "k1,k2,p1,p2[,k3[,k4,k5,k6]]")
      ->excludes(fixed);
  command
      ->add_flag("--fisheye", a->fisheye,
                 "OpenCV's four coefficients of --from are cv2.fisheye's k1,k2,k3,k4")
      ->needs("--from");
  command->add_option("--camera", a->camera,
                      "Which camera of the file: cam0 of Kalibr's, 1 or 2 of OpenCV's stereo");
  AddFormatOption(*command, a->format);
  command->footer(
      "Examples:\n"
      "  silhouette-calibrate intrinsics --corners corners.csv --boards wall.yaml \\\n"
      "      --out cameras --draw residuals\n"
      "  silhouette-calibrate intrinsics --from camera_info.yaml --view left --out cameras\n"
      "  silhouette-calibrate intrinsics --from 615.3,615.1,319.5,239.5 --image-size 640x480 \\\n"
      "      --view left --out cameras");
  command->callback([a, &run] { run = [a] { return RunIntrinsics(*a); }; });
}

}  // namespace silhouette
