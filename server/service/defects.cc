// SPDX-License-Identifier: Apache-2.0
#include "server/service/defects.h"

#include <algorithm>
#include <optional>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/times/times.h"
#include "server/live/live_record.h"
#include "server/scene/checker.h"

namespace silhouette {

std::vector<SceneDefect> DefectsOf(const Scene& scene, const ServingSettings& settings,
                                   const Moment& now) {
  std::vector<SceneDefect> defects = scene.defects;
  const absl::Duration age = scene.AgeAt(now);
  const absl::Duration max_age = settings.scene.max_age;
  if (age <= max_age) return defects;
  const std::string why =
      settings.live == nullptr ? "publish a new scene" : FaultsOf(settings.live->StatusOfDevices());
  defects.push_back({Reason::kSceneStale,
                     absl::StrCat("the oldest image is ",
                                  SpokenTimeAbove(max_age, absl::Ceil(age, absl::Milliseconds(1))),
                                  " old, older than max_age, ", SpokenTime(max_age), "; ", why)});
  return defects;
}

std::string WhyNoScene(Reason without_scene, const ServingSettings& settings) {
  return absl::StrCat(
      without_scene == Reason::kGenerationMismatch
          ? "the database was replaced and there is no scene since; "
          : "there is no scene yet; ",
      settings.live == nullptr ? "publish one" : FaultsOf(settings.live->StatusOfDevices()));
}

namespace {

// What happened while an answer was made that its scene does not show; empty: nothing.
std::string WhatHappenedMeanwhile(Reason blocked) {
  switch (blocked) {
    case Reason::kGenerationMismatch:
      return "the database was replaced while the answer was made; ask again";
    case Reason::kRegionEnded:
      return "an allowed region ended or was revoked while the answer was made; ask again";
    case Reason::kVariantUnknown:
      return "the robot's variant changed while the answer was made; ask again after the next "
             "scene";
    default:
      return "";
  }
}

}  // namespace

std::vector<SceneDefect> DefectsOf(const Served& served, Reason blocked,
                                   const ServingSettings& settings, const Moment& now) {
  std::vector<SceneDefect> defects;
  if (served.scene != nullptr) {
    defects = DefectsOf(*served.scene, settings, now);
  } else {
    defects.push_back({served.without_scene, WhyNoScene(served.without_scene, settings)});
  }
  if (blocked == Reason::kDatabaseDamaged) {
    defects.push_back({blocked, served.database->damage().what()});
  }
  const std::optional<std::string> doubt = CalibrationDoubt(served, now);
  if (blocked == Reason::kCalibrationDoubtful && doubt) {
    defects.push_back({blocked, absl::StrCat("the calibration is not confirmed: ", *doubt)});
  }
  const bool stated = std::ranges::any_of(
      defects, [&](const SceneDefect& defect) { return defect.reason == blocked; });
  const std::string meanwhile = WhatHappenedMeanwhile(blocked);
  if (!stated && !meanwhile.empty()) defects.push_back({blocked, meanwhile});
  return defects;
}

}  // namespace silhouette
