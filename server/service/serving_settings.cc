#include "server/service/serving_settings.h"

namespace silhouette {

Policy DefaultPolicy(const ServingSettings& settings, const ServedDatabase& database) {
  Policy policy = settings.policy;
  if (settings.choose_preset) policy.preset = database.BestPreset();
  return policy;
}

}  // namespace silhouette
