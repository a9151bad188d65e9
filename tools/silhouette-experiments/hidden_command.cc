// silhouette-experiments hidden
#include <unistd.h>

#include <array>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/picture/files.h"
#include "db/status/status_macros.h"
#include "tools/program/program.h"
#include "tools/program/progress.h"
#include "tools/silhouette-experiments/commands.h"
#include "tools/silhouette-experiments/hidden/picture.h"
#include "tools/silhouette-experiments/hidden/study.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;
using hidden_experiment::HiddenBall;
using hidden_experiment::HiddenCell;
using hidden_experiment::Tally;

constexpr char kHiddenName[] = "silhouette-experiments";

struct HiddenArguments {
  std::string cell;
  int scenes = 20;
  uint64_t seed = 1;
  std::string out;
  std::string format = "text";
};

struct HiddenRow {
  Preset preset = Preset::kUncalibrated;
  Tally hidden = {};  // scenes with a hidden ball
  Tally empty = {};   // the same robot positions, and nothing in the cell
};

// A folder that is gone when it is no longer needed.
class WorkFolder {
 public:
  WorkFolder()
      : path_((fs::temp_directory_path() / absl::StrCat("silhouette-hidden-", getpid())).string()) {
    Remove();
  }
  ~WorkFolder() { Remove(); }
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;
  const std::string& path() const { return path_; }

 private:
  void Remove() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  std::string path_;
};

absl::StatusOr<std::vector<HiddenRow>> HiddenMeasure(const HiddenArguments& arguments) {
  CatchStopSignals();
  const WorkFolder folder;
  std::unique_ptr<Progress> progress;
  absl::StatusOr<HiddenCell> cell = HiddenCell::Capture(
      arguments.cell, folder.path(), [&progress](uint64_t done, uint64_t total) {
        if (progress == nullptr) {
          progress = std::make_unique<Progress>("capturing", total, "configurations");
        }
        progress->Update(done);
        return !StopRequested();
      });
  progress.reset();
  if (!cell.ok()) return cell.status();
  std::vector<HiddenRow> rows;
  for (const Preset preset : AllPresets()) rows.push_back({.preset = preset});
  const std::vector<bool> none(cell->grid().tiles() * kTileSize, false);
  Progress scenes("scenes", static_cast<uint64_t>(arguments.scenes), "scenes");
  for (int i = 0; i < arguments.scenes; ++i) {
    if (StopRequested()) return absl::AbortedError("stopped; start it again to have a result");
    const uint64_t seed = arguments.seed + static_cast<uint64_t>(i);
    const auto ball = FindHiddenBall(*cell, cell->least_obstacle(), seed);
    if (!ball) {
      return absl::FailedPreconditionError(absl::StrCat(
          arguments.cell, ": there is no place for a ball of the least obstacle's size that the ",
          "robot hides from all views and can reach; state a smaller least_obstacle"));
    }
    const Served with_ball = cell->SceneAt(ball->robot, {ObstacleOf(*ball)});
    const Served without = cell->SceneAt(ball->robot, {});
    for (HiddenRow& row : rows) {
      row.hidden += Judge(*cell, with_ball, row.preset, ball->touches);
      row.empty += Judge(*cell, without, row.preset, none);
    }
    if (i == 0 && !arguments.out.empty()) {
      const std::string path = (fs::path(arguments.out) / "hidden.png").string();
      RETURN_IF_ERROR(WritePng(path, PictureOf(*cell, *ball, with_ball)));
    }
    scenes.Update(static_cast<uint64_t>(i) + 1);
  }
  return rows;
}

double HiddenPercent(int64_t part, int64_t whole) {
  return whole == 0 ? 0 : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

void HiddenPrintText(const std::vector<HiddenRow>& rows) {
  std::cout << absl::StrFormat("%-17s %22s %22s %22s\n", "preset", "collisions found",
                               "free kept (ball)", "free kept (empty)");
  for (const HiddenRow& row : rows) {
    const auto share = [](int64_t part, int64_t whole) {
      return absl::StrFormat("%d of %d (%.1f%%)", part, whole, HiddenPercent(part, whole));
    };
    std::cout << absl::StrFormat(
        "%-17s %22s %22s %22s\n", NameOf(row.preset), share(row.hidden.found, row.hidden.touching),
        share(row.hidden.kept, row.hidden.clear), share(row.empty.kept, row.empty.clear));
  }
}

nlohmann::ordered_json HiddenJsonOf(const std::vector<HiddenRow>& rows) {
  auto list = nlohmann::ordered_json::array();
  for (const HiddenRow& row : rows) {
    list.push_back({{"preset", NameOf(row.preset)},
                    {"touching", row.hidden.touching},
                    {"found", row.hidden.found},
                    {"free", row.hidden.clear},
                    {"kept", row.hidden.kept},
                    {"free_in_empty_cell", row.empty.clear},
                    {"kept_in_empty_cell", row.empty.kept}});
  }
  return list;
}

int RunHidden(const HiddenArguments& arguments) {
  if (!arguments.out.empty()) {
    if (absl::Status made = MakeFolder(arguments.out); !made.ok()) return Report(kHiddenName, made);
  }
  const absl::StatusOr<std::vector<HiddenRow>> rows = HiddenMeasure(arguments);
  if (!rows.ok()) return Report(kHiddenName, rows.status());
  if (arguments.format == "json") {
    std::cout << HiddenJsonOf(*rows).dump(2) << '\n';
  } else {
    HiddenPrintText(*rows);
  }
  return kDone;
}

}  // namespace

void AddHiddenCommand(CLI::App& program, Run& run) {
  CLI::App* command =
      program.add_subcommand("hidden",
                             "Balls of the least obstacle's size where the robot hides them from "
                             "all views: which presets\n"
                             "find them, and how many of the other configurations stay free");
  const auto arguments = std::make_shared<HiddenArguments>();
  command
      ->add_option("--cell", arguments->cell, "The file of a simulated cell with a section 'sound'")
      ->required();
  command->add_option("--scenes", arguments->scenes, "How many")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  command->add_option("--seed", arguments->seed, "Of the search for places")->capture_default_str();
  command->add_option("--out", arguments->out, "A folder for hidden.png, the first scene");
  AddFormatOption(*command, arguments->format);
  command->footer(
      "The cell is captured through the simulated cameras; the truth is exact contact.\n\n"
      "Example:\n"
      "  silhouette-experiments hidden --cell capture/sim/cells/hidden/cell.yaml --out out");
  command->callback([arguments, &run] { run = [arguments] { return RunHidden(*arguments); }; });
}

}  // namespace silhouette
