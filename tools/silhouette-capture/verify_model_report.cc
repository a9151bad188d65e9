// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-capture/verify_model_report.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "calib/robot/drawn_digest.h"
#include "common/picture/picture.h"
#include "common/picture/sheet.h"
#include "common/result/result.h"
#include "db/status/status_macros.h"
#include "tools/program/for_shell.h"

namespace silhouette {
namespace {

constexpr int kPictureScale = 4;

std::string Percents(uint64_t part, uint64_t whole) {
  return absl::StrFormat("%.2f", 100 * ShareOf(part, whole));
}

// The link that grows most, as a line, if that is much.
std::string MuchGrowth(const ModelOfCell& model, const ModelComparison& found) {
  constexpr double kMuch = 0.02;  // metres
  const std::vector<double> growth = found.LinkGrowth();
  const auto most = std::ranges::max_element(growth);
  if (most == growth.end() || *most < kMuch) return "";
  return absl::StrFormat(
      "most growth        %.1f cm, link '%s': right if a cable or tool reaches as far, otherwise "
      "its joint or mesh is wrong; an obstacle within it is in the robot's own image, and may be "
      "missed\n",
      100 * *most, model.links[static_cast<size_t>(most - growth.begin())]);
}

}  // namespace

std::string Again(const VerifyModelOptions& options, size_t sample) {
  std::string command = options.cell.Command("verify-model");
  if (!options.captured.empty()) {
    absl::StrAppend(&command, " --captured ", ForShell(options.captured));
  }
  for (const auto& [link, other] : options.not_checked) {
    absl::StrAppend(&command, " --not-checked ", ForShell(link), " ", ForShell(other));
  }
  return absl::StrCat(command, " --sample ", sample);
}

std::string LargerSample(const VerifyModelOptions& options, const ModelComparison& found,
                         size_t configurations) {
  VerifyModelOptions again = options;
  std::string what = "a larger sample: ";
  if (!options.captured.empty() && configurations < options.sample) {
    what = absl::StrCat("a larger sample than all of '", options.captured,
                        "': capture more there, or drive the robot: ");
    again.captured.clear();
  }
  return absl::StrCat(what, Again(again, found.enough));
}

std::string ComparisonText(const VerifyModelOptions& options, const ModelOfCell& model,
                           const ModelComparison& found, size_t configurations) {
  Table links{{"link", "growth, cm", "not captured, %"}};
  for (size_t link = 0; link < model.links.size(); ++link) {
    const ComparedLink& compared = found.links[link];
    links.rows.push_back({model.links[link], absl::StrFormat("%.1f", 100 * compared.growth),
                          Percents(compared.uncaptured, compared.certain)});
  }
  Table views{{"view", "missing, %", "unreached, %", "noise, %", "not captured, %", "hidden, %",
               "shift right", "down", "mean amount"}};
  for (size_t view = 0; view < model.views.size(); ++view) {
    const ComparedView& compared = found.views[view];
    views.rows.push_back({model.views[view], Percents(compared.missing, compared.captured),
                          Percents(compared.unreached, compared.captured),
                          Percents(compared.noise, compared.captured),
                          Percents(compared.uncaptured, compared.certain),
                          Percents(compared.hidden, compared.certain + compared.hidden),
                          absl::StrFormat("%.2f", compared.mean_shift.x()),
                          absl::StrFormat("%.2f", compared.mean_shift.y()),
                          absl::StrFormat("%.2f", compared.mean_amount)});
  }
  std::string further;
  if (found.further > 0) {
    further = absl::StrFormat(
        "of it              %.1f cm in each link that grows, because %d configurations are few; "
        "less with %s\n",
        100 * found.further, configurations, LargerSample(options, found, configurations));
  }
  return absl::StrCat(
      absl::StrFormat("compared           %d configurations, %d views\n", configurations,
                      model.views.size()),
      TextOf(links), "\n", TextOf(views), "\n",
      absl::StrFormat("held out           %d masks, %d of them lack a pixel (%d pixels)\n",
                      found.held_out_masks, found.held_out_missing, found.held_out_pixels),
      absl::StrFormat("the growth adds    %.1f %% pixels\n", 100 * found.additional), further,
      MuchGrowth(model, found));
}

nlohmann::ordered_json ComparisonJson(const ModelOfCell& model, const ModelComparison& found,
                                      size_t configurations) {
  nlohmann::ordered_json json = {{"passed", found.faults.empty()},
                                 {"faults", found.faults},
                                 {"digest", DigestOf(model.bare)},
                                 {"configurations", configurations},
                                 {"held_out_masks", found.held_out_masks},
                                 {"held_out_missing", found.held_out_missing},
                                 {"held_out_pixels", found.held_out_pixels},
                                 {"further", found.further},
                                 {"enough", found.enough},
                                 {"additional", found.additional},
                                 {"links", nlohmann::ordered_json::array()},
                                 {"views", nlohmann::ordered_json::array()}};
  for (size_t link = 0; link < model.links.size(); ++link) {
    const ComparedLink& compared = found.links[link];
    json["links"].push_back({{"name", model.links[link]},
                             {"growth", compared.growth},
                             {"uncaptured", ShareOf(compared.uncaptured, compared.certain)}});
  }
  for (size_t view = 0; view < model.views.size(); ++view) {
    const ComparedView& compared = found.views[view];
    json["views"].push_back(
        {{"name", model.views[view]},
         {"missing", ShareOf(compared.missing, compared.captured)},
         {"masks_missing", compared.missing_by},
         {"unreached", ShareOf(compared.unreached, compared.captured)},
         {"noise", ShareOf(compared.noise, compared.captured)},
         {"uncaptured", ShareOf(compared.uncaptured, compared.certain)},
         {"hidden", ShareOf(compared.hidden, compared.certain + compared.hidden)},
         {"shift", {compared.mean_shift.x(), compared.mean_shift.y()}},
         {"mean_amount", compared.mean_amount}});
  }
  return json;
}

absl::Status WriteWorst(const ModelOfCell& model, const ModelComparison& found,
                        const std::vector<ModelSample>& samples, const std::string& path) {
  ASSIGN_OR_RETURN(const DrawnRobot grown, Grown(model.bare, found.LinkGrowth()));
  std::vector<CaptionedPicture> pictures;
  for (const WorstMask& worst : found.worst) {
    const ModelSample& sample = samples[worst.sample];
    const Mask& captured = sample.captured[worst.view];
    const Mask bare = model.bare.Touched(sample.q)[worst.view];
    const Mask all = grown.Touched(sample.q)[worst.view];
    const Mask certain = model.bare.Covered(sample.q)[worst.view];
    Picture picture = PictureOf(all, palette::kFaint);
    picture.setTo(BgrOf(palette::kIgnored), MaskImage(bare));
    picture.setTo(BgrOf(palette::kRobot), MaskImage(captured & bare));
    picture.setTo(BgrOf(palette::kTight), MaskImage(certain - captured));
    picture.setTo(BgrOf(palette::kUnknown), MaskImage((captured & all) - bare));
    picture.setTo(BgrOf(palette::kObstacle), MaskImage(captured - all));
    pictures.push_back({Enlarged(picture, kPictureScale),
                        absl::StrFormat("%s: %d missing, %d not captured", model.views[worst.view],
                                        worst.missing, worst.uncaptured)});
  }
  return WritePng(path,
                  ContactSheet(pictures, {.title = "Captured and drawn: the worst masks",
                                          .columns = 0,
                                          .legend = {{palette::kRobot, "captured and drawn"},
                                                     {palette::kIgnored, "drawn only"},
                                                     {palette::kFaint, "added by growth"},
                                                     {palette::kUnknown, "captured, in growth"},
                                                     {palette::kObstacle, "captured, missing"},
                                                     {palette::kTight, "certain, not captured"}}}));
}

}  // namespace silhouette
