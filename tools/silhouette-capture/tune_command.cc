// SPDX-License-Identifier: Apache-2.0
// silhouette-capture tune: what other settings of the segmentation would find in images that there
// are.
#include <cctype>
#include <iostream>
#include <memory>
#include <stdexcept>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"
#include "tools/program/progress.h"
#include "tools/silhouette-capture/commands.h"
#include "tools/silhouette-capture/opened_cell.h"
#include "tools/silhouette-capture/tune_figures.h"
#include "tools/silhouette-capture/tune_page.h"
#include "tools/silhouette-capture/tune_pictures.h"

namespace silhouette {
namespace {

struct TuneOptions {
  CellArguments cell;
  std::vector<std::string> images;
  std::vector<std::string> empty;
  std::vector<std::string> tries;
  std::string out;
  int most = 3;
};

absl::StatusOr<std::vector<TuneImage>> ImagesOf(const TuneOptions& options,
                                                const Database& database) {
  auto images = RawImagesToTune(database, options.most);
  if (!images.ok()) return images.status();
  for (const bool empty : {false, true}) {
    for (const std::string& folder : empty ? options.empty : options.images) {
      ASSIGN_OR_RETURN(auto more, FolderImagesToTune(database, folder, empty));
      images->insert(images->end(), more.begin(), more.end());
    }
  }
  if (!images->empty()) return images;
  return absl::FailedPreconditionError(absl::StrCat(
      "the database '", database.path(),
      "' has no raw images: capture with 'raw_images: sentinels' or 'raw_images: all' of 'capture' "
      "in the cell file, or name a folder of images with --images or --empty"));
}

// A file's name for the sheet of an image.
std::string SheetName(size_t number, const std::string& name) {
  std::string file = absl::StrFormat("%02d-", number + 1);
  for (const char c : name) {
    file += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '-';
  }
  return file + ".png";
}

// How the first of what was tried is put to use.
absl::StatusOr<std::vector<std::string>> Advice(const TuneOptions& options,
                                                const Database& database,
                                                const std::vector<TuneVariant>& variants) {
  ASSIGN_OR_RETURN(const auto snapshot, database.Read());
  ASSIGN_OR_RETURN(const auto raw, snapshot.RawImageNumbers());
  std::vector<std::string> lines;
  if (options.tries.empty()) {
    lines.push_back(absl::StrCat("look closer: ", options.cell.Command("tune"), " --try '",
                                 variants.back().name, "'"));
    return lines;
  }
  for (size_t t = 0; t < options.tries.size(); ++t) {
    const TuneVariant& variant = variants[variants.size() - options.tries.size() + t];
    lines.push_back(CellFileLine(variant.settings));
  }
  if (raw.size() >= snapshot.size()) {
    lines.push_back(options.cell.Command("remask"));
  } else {
    lines.push_back(absl::StrFormat(
        "only %d of %d robot images have raw images: capture all again, into a new database: "
        "silhouette-capture run --cell %s --database NEW",
        raw.size(), snapshot.size(), options.cell.cell));
  }
  return lines;
}

// A sentence for each try that finds more in images of the empty cell than the database's settings.
std::string Worse(const TuneOptions& options, const TuneResult& result) {
  const auto share = [](const TuneFigures& sums) {
    return 100.0 * static_cast<double>(sums.false_pixels) / static_cast<double>(sums.empty_pixels);
  };
  std::string text;
  for (size_t v = result.sums.size() - options.tries.size(); v < result.sums.size(); ++v) {
    if (result.sums[v].false_pixels <= result.sums[0].false_pixels) continue;
    absl::StrAppendFormat(
        &text,
        "'%s' is worse: it finds something in %.3g %% of the empty cell's pixels, "
        "the database's settings in %.3g %%\n",
        result.variants[v].name, share(result.sums[v]), share(result.sums[0]));
  }
  return text;
}

absl::Status WritePage(const CellFile& file, const std::string& folder, const TuneResult& result) {
  for (const TuneEntry& image : result.images) {
    RETURN_IF_ERROR(WriteWholeFile(folder + "/" + image.sheet, image.sheet_png));
  }
  const std::string now = absl::FormatTime("%Y-%m-%d %H:%M", absl::Now(), absl::LocalTimeZone());
  const std::string page =
      TunePage(result, {{"cell", file.cell.name}, {"database", file.database}, {"made", now}});
  absl::Status status = WriteWholeFile(folder + "/tune.html", page);
  status.Update(WriteWholeFile(folder + "/tune.json", TuneJson(result).dump(2) + "\n"));
  return status;
}

absl::StatusOr<TuneResult> Compare(const TuneOptions& options, const CellFile& file,
                                   const Database& database) {
  ASSIGN_OR_RETURN(auto variants,
                   TuneVariants(database.cell(), file.cell.segmentation, options.tries));
  ASSIGN_OR_RETURN(const auto images, ImagesOf(options, database));
  TuneResult result{.variants = std::move(variants), .images = {}, .sums = {}, .advice = {}};
  result.sums.resize(result.variants.size());
  Progress progress("images", images.size(), "images");
  for (const TuneImage& image : images) {
    if (StopRequested()) return absl::CancelledError("stopped; nothing was written");
    const MaskSize size = file.cell.views[static_cast<size_t>(image.view)].mask_size;
    TunedImage tuned;
    try {
      tuned = Tune(image, result.variants, size);
    } catch (const std::invalid_argument& error) {
      return absl::InvalidArgumentError(error.what());
    }
    for (size_t v = 0; v < tuned.figures.size(); ++v) result.sums[v].Add(tuned.figures[v]);
    result.images.push_back({.name = image.name,
                             .empty = image.empty,
                             .figures = tuned.figures,
                             .sheet = SheetName(result.images.size(), image.name),
                             .sheet_png = EncodePng(TuneSheet(image, result.variants, tuned))});
    progress.Update(result.images.size());
  }
  ASSIGN_OR_RETURN(auto advice, Advice(options, database, result.variants));
  result.advice = std::move(advice);
  return result;
}

absl::StatusOr<ExitCode> TuneRun(const TuneOptions& options) {
  ASSIGN_OR_RETURN(const CellFile file, OpenCellFile(options.cell));
  ASSIGN_OR_RETURN(const auto database,
                   OpenDatabaseOfOtherMasks(file, Database::Access::kRead, true));
  CatchStopSignals();
  const absl::StatusOr<TuneResult> result = Compare(options, file, *database);
  if (absl::IsCancelled(result.status())) {
    std::cerr << result.status().message() << std::endl;
    return kNo;
  }
  if (!result.ok()) return result.status();
  const std::string folder =
      options.out.empty() ? BesideDatabase(file.database, ".tune") : options.out;
  RETURN_IF_ERROR(MakeFolder(folder));
  RETURN_IF_ERROR(WritePage(file, folder, *result));
  if (options.cell.json()) {
    std::cout << TuneJson(*result).dump(2) << std::endl;
    return kDone;
  }
  std::cout << TuneTable(*result) << "page: " << folder << "/tune.html\n";
  if (!options.tries.empty()) {
    std::cout << Worse(options, *result);
    std::cout << (options.tries.size() == 1
                      ? "to use it, write this line into the cell file, then:\n"
                      : "to use one of them, write its line into the cell "
                        "file, then:\n");
  }
  for (const std::string& line : result->advice) std::cout << "  " << line << "\n";
  std::cout << std::flush;
  return kDone;
}

}  // namespace

void AddTune(CLI::App& app, Work& work) {
  CLI::App* command = app.add_subcommand(
      "tune",
      "Compares settings of the segmentation on images that there are: camera images that "
      "captures\n"
      "kept (those of the sentinels, unless more was asked for), and images in folders. Nothing\n"
      "moves, and the database stays as it is. Writes a page with pictures (tune.html) and for\n"
      "programs (tune.json): what is found, what is found otherwise than with the database's "
      "settings,\n"
      "and how close the decisions are. Without --try a lower and a higher value of each setting.");
  command->footer(
      "Examples:\n"
      "  silhouette-capture tune --cell cell.yaml --try 'faint_side: 7, min_difference: 6'\n"
      "  silhouette-capture cameras --cell cell.yaml --out empty     while the cell is empty\n"
      "  silhouette-capture tune --cell cell.yaml --empty empty --try 'min_difference: 5'\n"
      "Exit codes: 0 done; 1 stopped; 2 wrong arguments or files; 3 the disk failed.");
  const auto options = std::make_shared<TuneOptions>();
  AddCellOptions(*command, options->cell);
  command
      ->add_option("--try", options->tries,
                   "Keys of the section 'segmentation' that are other than in the cell file, "
                   "'KEY: VALUE, ...';\nmay be given several times")
      ->allow_extra_args(false);
  command
      ->add_option("--images", options->images,
                   "A folder with an image for each view, VIEW.png or .jpg; may be given several "
                   "times")
      ->allow_extra_args(false);
  command
      ->add_option("--empty", options->empty,
                   "The same with images of the empty cell: all that is found there is false")
      ->allow_extra_args(false);
  command
      ->add_option("--most", options->most,
                   "The most configurations with kept images to use; 0: none")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  command->add_option("--out", options->out,
                      "The folder for the page; default: the database's name and .tune");
  command->callback([options, &work] { work = [options] { return TuneRun(*options); }; });
}

}  // namespace silhouette
