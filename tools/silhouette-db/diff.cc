// SPDX-License-Identifier: Apache-2.0
// silhouette-db diff: compares two databases.
#include <algorithm>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "db/store/suspects.h"
#include "tools/program/progress.h"
#include "tools/silhouette-db/commands.h"
#include "tools/silhouette-db/common.h"

namespace silhouette {
namespace {

constexpr uint64_t kShown = 20;

struct DiffOptions {
  std::string first;
  std::string variant;         // empty: all, if the second is empty, too; else the default one
  std::string second_variant;  // empty: as the first
  std::string second;
  bool masks_only = false;
  std::string format = "text";
};

// Keeps the first differences and counts all.
class Printer {
 public:
  // From now on lines are of this variant; empty: of none.
  void Of(const std::string& variant) {
    of_ = variant.empty() ? "" : absl::StrCat("variant '", variant, "': ");
  }
  void Say(const std::string& line) {
    if (++count_ <= kShown) first_.push_back(of_ + line);
  }
  ExitCode Finish(const std::string& format) const {
    std::string text;
    for (const std::string& line : first_) absl::StrAppend(&text, line, "\n");
    if (count_ > kShown) absl::StrAppend(&text, "and ", count_ - kShown, " more differences\n");
    if (count_ == 0) text = "no difference\n";
    PrintResult(format, {{"same", count_ == 0}, {"differences", count_}, {"first", first_}}, text);
    return count_ == 0 ? kDone : kNo;
  }

 private:
  std::string of_;
  uint64_t count_ = 0;
  std::vector<std::string> first_;
};

// What differs between two records of a configuration; empty: nothing.
std::string DifferenceOf(const Database& database, const RobotImage& a, const RobotImage& b,
                         bool masks_only) {
  if (a.excluded != b.excluded)
    return a.excluded ? "excluded in the first" : "excluded in the second";
  std::vector<std::string> parts;
  for (size_t i = 0; i < a.masks.size(); ++i) {
    if (a.masks[i] == b.masks[i]) continue;
    const size_t pixels = ((a.masks[i] - b.masks[i]) | (b.masks[i] - a.masks[i])).Count();
    parts.push_back(absl::StrCat(pixels, " pixels of view '",
                                 database.cell().views(static_cast<int>(i)).name(), "'"));
  }
  if (!masks_only) {
    if (a.captured != b.captured) parts.push_back("capture time");
    if (a.commanded != b.commanded) parts.push_back("commanded joints");
    if (a.measured != b.measured) parts.push_back("measured joints");
  }
  return absl::StrJoin(parts, ", ");
}

// Records of `first` against those of `second`, both ways.
absl::Status CompareRecords(const OpenedDatabase& first, const OpenedDatabase& second,
                            bool masks_only, Printer& printer) {
  const ConfigurationGrid& grid = first.database->grid();
  ASSIGN_OR_RETURN(const auto first_history, first.snapshot.CaptureHistory());
  ASSIGN_OR_RETURN(const auto second_history, second.snapshot.CaptureHistory());
  const SuspectSpans a_suspects(first_history);
  const SuspectSpans b_suspects(second_history);
  Progress progress("diff", first.snapshot.size() + second.snapshot.size(), "records");
  uint64_t done = 0;
  absl::Status failure;
  const auto name = [&](ConfigurationNumber number) {
    return absl::StrCat("configuration ", number, " (", JointText(grid, number), "): ");
  };
  absl::Status status =
      first.snapshot.ForEach([&](ConfigurationNumber number, const absl::StatusOr<RobotImage>& a) {
        const absl::StatusOr<std::optional<RobotImage>> b = second.snapshot.Find(number);
        if (!a.ok() || !b.ok()) {
          printer.Say(absl::StrCat(name(number), "damaged in the ", a.ok() ? "second" : "first"));
        } else if (!*b) {
          printer.Say(name(number) + "only in the first");
        } else if (const std::string what = DifferenceOf(*first.database, *a, **b, masks_only);
                   !what.empty()) {
          printer.Say(name(number) + what);
        } else if (!masks_only &&
                   a_suspects.Contain(a->captured) != b_suspects.Contain((*b)->captured)) {
          printer.Say(absl::StrCat(name(number), "suspect in the ",
                                   a_suspects.Contain(a->captured) ? "first" : "second"));
        }
        progress.Update(++done);
        return !StopRequested();
      });
  if (!status.ok()) return status;
  status =
      second.snapshot.ForEach([&](ConfigurationNumber number, const absl::StatusOr<RobotImage>&) {
        const absl::StatusOr<bool> there = first.snapshot.Contains(number);
        if (!there.ok()) failure = there.status();
        if (there.ok() && !*there) printer.Say(name(number) + "only in the second");
        progress.Update(++done);
        return failure.ok() && !StopRequested();
      });
  if (StopRequested()) return Stopped("run it again to compare all");
  return failure.ok() ? status : failure;
}

// In what two parts of the databases differ; empty: in nothing.
template <typename Message>
std::string DifferenceOf(const std::optional<Message>& a, const std::optional<Message>& b) {
  if (a.has_value() != b.has_value()) return a ? "only in the first" : "only in the second";
  return !a || a->SerializeAsString() == b->SerializeAsString() ? "" : "different";
}

// `part` of both databases, which `name` names.
template <typename Part>
absl::Status ComparePart(const OpenedDatabase& first, const OpenedDatabase& second, Part part,
                         const std::string& name, Printer& printer) {
  ASSIGN_OR_RETURN(const auto a, (first.snapshot.*part)());
  ASSIGN_OR_RETURN(const auto b, (second.snapshot.*part)());
  if (const std::string what = DifferenceOf(a, b); !what.empty()) {
    printer.Say(absl::StrCat(name, ": ", what));
  }
  return absl::OkStatus();
}

absl::Status CompareDrawn(const OpenedDatabase& first, const OpenedDatabase& second,
                          Printer& printer) {
  return ComparePart(first, second, &Snapshot::DrawnImages, "what robot images are drawn from",
                     printer);
}

// Of which configurations there are raw images.
absl::Status CompareRawImages(const OpenedDatabase& first, const OpenedDatabase& second,
                              Printer& printer) {
  ASSIGN_OR_RETURN(const auto a, first.snapshot.RawImageNumbers());
  ASSIGN_OR_RETURN(const auto b, second.snapshot.RawImageNumbers());
  std::vector<ConfigurationNumber> both;
  std::ranges::set_intersection(a, b, std::back_inserter(both));
  const auto say = [&](size_t more, const char* where) {
    if (more == 0) return;
    printer.Say(
        absl::StrCat("raw images of ", Counted(more, "configuration"), ": only in ", where));
  };
  say(a.size() - both.size(), "the first");
  say(b.size() - both.size(), "the second");
  return absl::OkStatus();
}

absl::Status CompareCalibrations(const OpenedDatabase& first, const OpenedDatabase& second,
                                 Printer& printer) {
  ASSIGN_OR_RETURN(const auto a, first.snapshot.Calibration());
  ASSIGN_OR_RETURN(const auto b, second.snapshot.Calibration());
  const std::string what = DifferenceOf(a, b);
  if (what.empty()) return absl::OkStatus();
  if (!a || !b || a->cameras().empty() || a->cameras_size() != b->cameras_size()) {
    printer.Say("calibration: " + what);
    return absl::OkStatus();
  }
  bool same_cameras = true;
  for (int i = 0; i < a->cameras_size(); ++i) {
    if (a->cameras(i).SerializeAsString() == b->cameras(i).SerializeAsString()) continue;
    same_cameras = false;
    printer.Say(absl::StrCat("calibration: different camera models of view '",
                             first.database->cell().views(i).name(), "'"));
  }
  if (same_cameras) printer.Say("calibration: different, with the same camera models");
  return absl::OkStatus();
}

// All variants that both have; says which only one of them has.
absl::Status CompareFurtherVariants(const OpenedDatabase& first, const OpenedDatabase& second,
                                    const DiffOptions& options, Printer& printer) {
  ASSIGN_OR_RETURN(const std::vector<std::string> a, first.database->Variants());
  ASSIGN_OR_RETURN(const std::vector<std::string> b, second.database->Variants());
  for (const std::string& name : b) {
    printer.Of(name);
    if (std::ranges::find(a, name) == a.end()) printer.Say("only in the second");
  }
  for (const std::string& name : a) {
    printer.Of(name);
    if (std::ranges::find(b, name) == b.end()) {
      printer.Say("only in the first");
    } else if (name != schema::kDefaultVariant) {
      ASSIGN_OR_RETURN(const OpenedDatabase of_first, OpenForReading(options.first, name));
      ASSIGN_OR_RETURN(const OpenedDatabase of_second, OpenForReading(options.second, name));
      if (!options.masks_only) {
        RETURN_IF_ERROR(CompareDrawn(of_first, of_second, printer));
        RETURN_IF_ERROR(CompareRawImages(of_first, of_second, printer));
      }
      RETURN_IF_ERROR(CompareRecords(of_first, of_second, options.masks_only, printer));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<ExitCode> Diff(const DiffOptions& options) {
  const bool all = options.variant.empty() && options.second_variant.empty();
  const std::string variant = options.variant.empty() ? schema::kDefaultVariant : options.variant;
  ASSIGN_OR_RETURN(const OpenedDatabase first, OpenForReading(options.first, variant));
  ASSIGN_OR_RETURN(
      const OpenedDatabase second,
      OpenForReading(options.second,
                     options.second_variant.empty() ? variant : options.second_variant));
  CatchStopSignals();
  Printer printer;
  for (const std::string& sentence :
       Differences(first.database->cell(), "the first", second.database->cell(), "the second")) {
    printer.Say(sentence);
  }
  const bool comparable = first.database->grid() == second.database->grid() &&
                          first.database->mask_sizes() == second.database->mask_sizes();
  if (!comparable) {
    printer.Say("the robot images cannot be compared: other grids or mask sizes");
    return printer.Finish(options.format);
  }
  if (!options.masks_only) {
    RETURN_IF_ERROR(ComparePart(first, second, &Snapshot::References, "reference images", printer));
    RETURN_IF_ERROR(CompareCalibrations(first, second, printer));
    RETURN_IF_ERROR(
        ComparePart(first, second, &Snapshot::Verification, "verification of the model", printer));
    RETURN_IF_ERROR(CompareDrawn(first, second, printer));
    RETURN_IF_ERROR(CompareRawImages(first, second, printer));
  }
  RETURN_IF_ERROR(CompareRecords(first, second, options.masks_only, printer));
  if (all) RETURN_IF_ERROR(CompareFurtherVariants(first, second, options, printer));
  return printer.Finish(options.format);
}

}  // namespace

void AddDiff(CLI::App& app, Work& work) {
  auto [command, options] =
      AddCommand(app, work, "diff", "Compares two databases; exit code 1 if they differ", Diff);
  command.add_option("first", options.first, "Folder of a database")->required();
  command.add_option("second", options.second, "Folder of another")->required();
  command.add_option("--variant", options.variant, "The variant, by its name; default: all");
  command.add_option(
      "--second-variant", options.second_variant,
      "Variant of the second database, if it has another name; both may be one database");
  command.add_flag(
      "--masks-only", options.masks_only,
      "Ignore capture times, joint values, reference images, calibration, the model's\n"
      "verification, what images are drawn from, which are suspect, and raw images");
  AddFormatOption(command, options.format);
  command.footer(
      "Of raw images it compares which there are, not their pixels. The visits to the control\n"
      "configurations are not compared.\n"
      "Example:\n  silhouette-db diff --masks-only monday.lmdb tuesday.lmdb\n"
      "  silhouette-db diff --masks-only cell.lmdb cell.lmdb --second-variant gripper-open");
}

}  // namespace silhouette
