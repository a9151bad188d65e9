#include "tools/silhouette-calibrate/detect_report.h"

#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace silhouette {
namespace {

constexpr double kLittleCoverage = 0.6;

int Fitted(const ImageTags& image) {
  return static_cast<int>(std::count_if(image.tags.begin(), image.tags.end(),
                                        [](const DetectedTag& tag) { return tag.fitted; }));
}

std::string ImageLine(const ImageTags& image) {
  std::string line = absl::StrFormat("%-12s %-16s ", image.view, image.frame);
  if (image.tags.empty()) return line + "none";
  const double blur = image.MedianBlur();
  return line + absl::StrFormat("%-10s %5.0f  %5s  %6.3f",
                                absl::StrCat(image.tags.size(), " of ", image.expected),
                                image.MeanSize(), blur > 0 ? absl::StrFormat("%.2f", blur) : "-",
                                image.TypicalSigma());
}

nlohmann::ordered_json DetectReportJsonOf(const SessionImage& image) {
  const auto names = [](const std::vector<DetectedTag>& tags) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const DetectedTag& tag : tags) list.push_back({{"family", tag.family}, {"tag", tag.tag}});
    return list;
  };
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
          {"warnings", image.warnings}};
}

}  // namespace

std::string CoverageLine(const DetectSession& session) {
  std::vector<std::string> views;
  for (const auto& [view, coverage] : session.coverage()) {
    views.push_back(absl::StrFormat("%s %.0f %%", view, 100 * coverage.Share()));
  }
  return "coverage " + absl::StrJoin(views, ", ");
}

void PrintDetection(const DetectSession& session, const std::string& out) {
  std::cout << "view         frame            tags        size   blur   sigma   (pixels)\n";
  for (const SessionImage& image : session.images()) {
    std::cout << ImageLine(image.tags) << (image.copy ? "  left out" : "") << '\n';
  }
  for (const SessionImage& image : session.images()) {
    for (const std::string& warning : image.warnings) {
      std::cout << "warning: " << image.source << " " << warning << '\n';
    }
  }
  for (const auto& [view, coverage] : session.coverage()) {
    if (coverage.Share() >= kLittleCoverage) continue;
    std::cout << absl::StreamFormat(
        "warning: corners in %.0f %% of view '%s' only; for its lens, show boards in all of the "
        "image, corners of the image above all\n",
        100 * coverage.Share(), view);
  }
  std::cout << CoverageLine(session) << "\nwrote " << out << ": " << session.Sightings().size()
            << " tags of " << session.images().size() << " images\n";
}

void PrintDetectionJson(const DetectSession& session, const std::string& out) {
  nlohmann::ordered_json json = {{"out", out},
                                 {"sightings", session.Sightings().size()},
                                 {"images", nlohmann::ordered_json::array()},
                                 {"views", nlohmann::ordered_json::array()}};
  for (const SessionImage& image : session.images())
    json["images"].push_back(DetectReportJsonOf(image));
  for (const auto& [view, coverage] : session.coverage()) {
    json["views"].push_back(
        {{"view", view}, {"corners", coverage.corners().size()}, {"coverage", coverage.Share()}});
  }
  std::cout << json.dump(2) << '\n';
}

}  // namespace silhouette
