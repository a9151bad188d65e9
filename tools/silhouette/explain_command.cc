// silhouette explain
#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/picture/files.h"
#include "common/picture/sheet.h"
#include "db/status/status_macros.h"
#include "tools/silhouette/commands.h"
#include "tools/silhouette/formats/configuration_text.h"
#include "tools/silhouette/formats/output.h"
#include "tools/silhouette/options.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

constexpr int kPictureWidth = 256;  // pixels, on the sheet

struct ExplainArguments {
  std::string configuration;
  bool degrees = false;
  std::string out;
  PolicyOptions policy;
};

// One image of a view, and what it is called.
struct NamedPng {
  const char* name;
  const std::string& png;
};

std::vector<NamedPng> ExplainImagesOf(const client::ViewPictures& view) {
  return {{"scene", view.scene_png},
          {"obstacle", view.obstacle_png},
          {"intersection", view.intersection_png},
          {"collision", view.collision_png}};
}

Picture LargePicture(const std::string& png) {
  const std::vector<uint8_t> buffer(png.begin(), png.end());
  const Picture picture = buffer.empty() ? Picture() : cv::imdecode(buffer, cv::IMREAD_COLOR);
  if (picture.empty()) return BlankPicture(kPictureWidth, kPictureWidth);
  return Enlarged(picture, std::max(1, kPictureWidth / picture.cols));
}

// A file per image, and all of them on one sheet.
absl::Status WriteImages(const client::Explanation& explanation, const std::string& folder) {
  RETURN_IF_ERROR(MakeFolder(folder));
  std::vector<CaptionedPicture> sheet;
  for (const client::ViewPictures& view : explanation.views) {
    for (const auto& [name, png] : ExplainImagesOf(view)) {
      sheet.push_back({LargePicture(png), absl::StrCat(view.view, ": ", name, " image")});
      if (png.empty()) continue;
      const fs::path file = fs::path(folder) / absl::StrCat(view.view, "_", name, ".png");
      RETURN_IF_ERROR(WriteWholeFile(file.string(), png));
    }
  }
  if (sheet.empty()) return absl::OkStatus();
  const SheetOptions options{.title = absl::StrCat("Verdict: ", NameOf(explanation.verdict.state)),
                             .columns = 4,
                             .legend = {{palette::kInk, "foreground"},
                                        {palette::kBackground, "background"},
                                        {palette::kObstacle, "obstacle"},
                                        {palette::kUnknown, "unknown"},
                                        {palette::kError, "error"},
                                        {palette::kAllowed, "allowed region (unknown)"},
                                        {palette::kIgnored, "ignored (unknown)"}}};
  return WritePng((fs::path(folder) / "explanation.png").string(), ContactSheet(sheet, options));
}

// In how many views an obstacle is plainly seen; the policy may find one in more.
std::string PlainlySeen(const client::Verdict& verdict) {
  const auto shows = [](const client::ViewEvidence& view) {
    return view.missing || view.obstacle_pixels > 0;
  };
  return absl::StrCat(std::count_if(verdict.views.begin(), verdict.views.end(), shows), " of ",
                      verdict.views.size(),
                      " views have obstacle pixels inside the robot, or no image");
}

void ExplainPrintText(const Configuration& configuration, const client::Explanation& explanation) {
  const client::Verdict& verdict = explanation.verdict;
  std::cout << Spoken(configuration) << " is " << Spoken(verdict) << '\n';
  std::cout << Spoken(explanation.basis) << '\n';
  if (verdict.views.empty()) return;
  std::cout << PlainlySeen(verdict) << '\n';
  std::vector<std::vector<std::string>> rows = {
      {"pixels inside the robot", "obstacle", "unknown", "error"}};
  for (const client::ViewEvidence& view : verdict.views) {
    if (view.missing) {
      rows.push_back({absl::StrCat(view.view, " (no image: counts as an obstacle)")});
    } else {
      rows.push_back({view.view, absl::StrCat(view.obstacle_pixels),
                      absl::StrCat(view.unknown_pixels), absl::StrCat(view.error_pixels)});
    }
  }
  std::cout << Table(rows) << std::flush;
}

absl::StatusOr<ExitCode> Explain(const Session& session, const ExplainArguments& arguments) {
  const Configuration configuration = ParseConfiguration(
      arguments.configuration, arguments.degrees ? AngleUnit::kDegrees : AngleUnit::kRadians);
  ASSIGN_OR_RETURN(const Client client, session.Connect());
  ASSIGN_OR_RETURN(const auto explanation,
                   client.Explain(configuration, arguments.policy.policy()));
  if (!arguments.out.empty()) {
    RETURN_IF_ERROR(WriteImages(explanation, arguments.out));
  }
  if (session.json()) {
    Json json = JsonOf(explanation.basis);
    json["configuration"] = configuration;
    json.update(JsonOf(explanation.verdict));
    Print(json);
  } else {
    ExplainPrintText(configuration, explanation);
  }
  return explanation.verdict.free() ? kDone : kNo;
}

}  // namespace

void AddExplainCommand(CLI::App& program, Session& session, Run& run) {
  CLI::App* command =
      program.add_subcommand("explain", "Tell why a configuration is free or not, view by view");
  auto arguments = std::make_shared<ExplainArguments>();
  command
      ->add_option("configuration", arguments->configuration,
                   "Joint values with commas between them")
      ->required();
  command->add_flag("--degrees", arguments->degrees, "Values without a unit are degrees");
  command->add_option("--out", arguments->out,
                      "Write the images of every view into this folder: VIEW_scene.png and so on, "
                      "and explanation.png with all of them");
  AddFormatOption(*command, session.format);
  AddPolicyOptions(*command, arguments->policy);
  AddVariantOption(*command, session);
  command->footer(
      "Exit code 0 if the configuration is free, 1 if not.\n\n"
      "Example:\n"
      "  silhouette explain 30deg,-10deg --out why");
  command->callback([arguments, &session, &run] {
    run = [arguments, &session] { return Explain(session, *arguments); };
  });
}

}  // namespace silhouette
