// SPDX-License-Identifier: Apache-2.0
// The report's page and JSON.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <regex>
#include <string>
#include <vector>

#include "calib/report/quality_report.h"
#include "calib/report/report_page.h"
#include "tests/calib/poses/pose_rig.h"

namespace silhouette {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

// Of a session with an outlier; a view has a name that is HTML.
const QualityReport& SomeReport() {
  static const QualityReport report = [] {
    PoseRig rig(2, 3);
    rig.problem.views[1].name = "<b>\"east\" & 'west'";
    rig.AddFlangeBoard();
    rig.Drive(24);
    rig.problem.sightings[3].corners[1].x() += 5;
    return *MakeReport(rig.problem, {.workspace_name{}, .groups = 3});
  }();
  return report;
}

// Whether every element is closed, in the right order. Elements without content: meta, br.
std::string FirstFault(const std::string& html) {
  static const std::regex tag(R"(<(/?)([a-zA-Z0-9]+)[^<>]*?(/?)>)");
  std::vector<std::string> open;
  for (std::sregex_iterator it(html.begin(), html.end(), tag), end; it != end; ++it) {
    const std::string name = (*it)[2];
    if ((*it)[3] == "/" || name == "meta" || name == "br") continue;
    if ((*it)[1] != "/") {
      open.push_back(name);
    } else if (open.empty() || open.back() != name) {
      return it->str();
    } else {
      open.pop_back();
    }
  }
  return open.empty() ? "" : open.back();
}

TEST(ReportPage, IsOneWellFormedPageThatNeedsNothingElse) {
  const std::string html = ReportHtml(SomeReport(), {{"corners", "a<b>.csv"}});
  EXPECT_EQ(FirstFault(html), "");
  EXPECT_THAT(html, Not(HasSubstr("http")));
  EXPECT_THAT(html,
              AllOf(Not(HasSubstr("<script")), Not(HasSubstr("src=")), Not(HasSubstr("nan"))));
  EXPECT_THAT(html, AllOf(HasSubstr("a&lt;b&gt;.csv"), Not(HasSubstr("a<b>"))));
}

TEST(ReportPage, NamesCannotBecomeHtml) {
  const std::string html = ReportHtml(SomeReport(), {});
  EXPECT_THAT(html, HasSubstr("&lt;b&gt;&quot;east&quot; &amp; &#39;west&#39;"));
  EXPECT_THAT(html, Not(HasSubstr("<b>\"east")));
}

TEST(ReportPage, WarningsComeFirst) {
  const QualityReport& report = SomeReport();
  ASSERT_FALSE(report.warnings.empty());
  const std::string html = ReportHtml(report, {});
  EXPECT_LT(html.find("tags that do not fit were left out"), html.find("Held-out corners"));
}

TEST(ReportPage, OfARefusalSaysWhyAndWhatWasSeen) {
  PoseRig rig(3, 1);
  rig.AddFlangeBoard();
  rig.Drive(2);
  const std::string html = ReportHtml(*MakeReport(rig.problem), {});
  EXPECT_EQ(FirstFault(html), "");
  EXPECT_THAT(html, AllOf(HasSubstr("No calibration: "), HasSubstr("Where corners were seen"),
                          Not(HasSubstr("Predicted error"))));
}

TEST(ReportJson, HasEverythingThatThePageShows) {
  const QualityReport& report = SomeReport();
  const nlohmann::ordered_json json = ReportJson(report);
  EXPECT_TRUE(json["refusal"].is_null());
  EXPECT_EQ(json["warnings"].size(), report.warnings.size());
  EXPECT_EQ(json["held_out_by"], "frames");
  ASSERT_EQ(json["views"].size(), 3u);
  const auto& view = json["views"][1];
  EXPECT_EQ(view["name"], report.views[1].name);
  EXPECT_EQ(view["held_out"]["px"], report.views[1].held_out.px);
  EXPECT_EQ(view["held_out"]["expected_px"], report.views[1].held_out.expected_px);
  EXPECT_EQ(view["predicted"]["worst_px"], report.views[1].predicted.worst_px);
  EXPECT_EQ(view["repeatability"]["mm"], report.views[1].repeatability->mm);
  EXPECT_EQ(view["halves"]["px"], report.views[1].halves->px);
  EXPECT_EQ(view["map"]["corners"].size(), report.views[1].map.cells.size());
  EXPECT_EQ(json["pairs"].size(), 3u);
  EXPECT_EQ(json["pairs"][0]["epipolar_px"], report.pairs[0].px);
  EXPECT_EQ(json["images"].size(), report.images.size());
  int outliers = 0;
  for (const auto& image : json["images"]) outliers += image["outliers"].get<int>();
  EXPECT_GT(outliers, 0);
  EXPECT_EQ(json["frames"].size(), report.frames.size());
  EXPECT_EQ(json["chi2_per_dof"], report.chi2_per_dof);
}

TEST(ReportJson, OfARefusalHasNoFigures) {
  PoseRig rig(3, 1);
  rig.AddFlangeBoard();
  rig.Drive(2);
  const nlohmann::ordered_json json = ReportJson(*MakeReport(rig.problem));
  EXPECT_THAT(json["refusal"].get<std::string>(), HasSubstr("camera0"));
  EXPECT_EQ(json["grade"], "bad");
  EXPECT_TRUE(json["chi2_per_dof"].is_null());
  EXPECT_TRUE(json["views"][0]["fit_px"].is_null());
  EXPECT_TRUE(json["views"][0]["held_out"].is_null());
}

}  // namespace
}  // namespace silhouette
