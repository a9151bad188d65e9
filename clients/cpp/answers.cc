#include "silhouette/answers.h"

#include <algorithm>

namespace silhouette::client {

absl::Duration Basis::Age() const {
  if (scene_id == 0) return absl::InfiniteDuration();
  return scene_age + absl::FromChrono(std::chrono::steady_clock::now() - asked);
}

bool ConfigurationChecks::AllFree() const {
  return !verdicts.empty() && std::all_of(verdicts.begin(), verdicts.end(),
                                          [](const Verdict& verdict) { return verdict.free(); });
}

}  // namespace silhouette::client
