// SPDX-License-Identifier: Apache-2.0
#include "server/scene/scene.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace silhouette {

void Failing::Add(const std::string& name, const std::string& why) {
  auto group = std::ranges::find(groups_, why, &Group::why);
  if (group == groups_.end()) group = groups_.insert(groups_.end(), Group{.why = why, .names = {}});
  group->names.push_back(name);
}

std::string Failing::Group::Named(const std::string& kind) const {
  return absl::StrCat(kind, several() ? "s '" : " '", absl::StrJoin(names, "', '"), "'");
}

Reason Scene::Blocked() const {
  for (const SceneDefect& defect : defects) {
    if (defect.reason != Reason::kViewMissing) return defect.reason;
  }
  return Reason::kNone;
}

}  // namespace silhouette
