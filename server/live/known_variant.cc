// SPDX-License-Identifier: Apache-2.0
#include "server/live/known_variant.h"

#include <algorithm>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/times/times.h"
#include "server/scene/make_scene.h"

namespace silhouette {
namespace {

bool Has(const std::vector<std::string>& variants, const std::string& variant) {
  return std::ranges::find(variants, variant) != variants.end();
}

}  // namespace

KnownVariant::KnownVariant(std::string variant)
    : state_(State::kTold), variant_(std::move(variant)), since_(-absl::InfiniteDuration()) {}

bool KnownVariant::Tell(const std::string& variant, absl::Duration now) {
  if (state_ == State::kTold && variant_ == variant) return false;
  state_ = State::kTold;
  variant_ = variant;
  since_ = now;
  return true;
}

bool KnownVariant::TellChanging() {
  const bool is_new = state_ != State::kChanging;
  state_ = State::kChanging;
  return is_new;
}

void KnownVariant::NoteVariants(const std::vector<std::string>& variants) {
  if (state_ == State::kTold && !Has(variants, variant_)) state_ = State::kLost;
}

absl::StatusOr<std::string> KnownVariant::Of(absl::Duration oldest,
                                             const std::vector<std::string>& variants) const {
  switch (state_) {
    case State::kNotTold:
      if (variants.size() == 1) return variants.front();
      return absl::FailedPreconditionError(
          absl::StrCat("the robot's variant is not known: send it with 'silhouette scene variant "
                       "NAME', or state 'server: {live: {variant: NAME}}' in the cell file; there "
                       "are ",
                       absl::StrJoin(variants, ", ")));
    case State::kChanging:
      return absl::FailedPreconditionError(
          "the robot's variant is being changed: send the new one with 'silhouette scene variant "
          "NAME' when that is done");
    case State::kTold:
      break;
    case State::kLost:
      return absl::FailedPreconditionError(
          absl::StrCat("the robot had the variant '", variant_,
                       "' when the database was replaced by one without it: ",
                       "send its variant with 'silhouette scene variant NAME'; there are ",
                       absl::StrJoin(variants, ", ")));
  }
  if (!Has(variants, variant_)) {
    return absl::FailedPreconditionError(
        absl::StrCat("the robot has the variant '", variant_, "', and the database has only ",
                     absl::StrJoin(variants, ", "), ": capture it"));
  }
  if (oldest - kClockTolerance < since_) {
    return absl::FailedPreconditionError(
        absl::StrCat("the robot has the variant '", variant_, "' in images taken from ",
                     SpokenTime(kClockTolerance), " after it was sent; wait for those"));
  }
  return variant_;
}

}  // namespace silhouette
