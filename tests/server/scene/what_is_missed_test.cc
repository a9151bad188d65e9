// SPDX-License-Identifier: Apache-2.0
#include "server/scene/what_is_missed.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace silhouette {
namespace {

using ::testing::HasSubstr;

TEST(WhatIsMissed, SoundNamesThePartsOfPeopleThatAreThinner) {
  const std::string coarse = WhatIsMissed({.preset = Preset::kSound}, 4, 0.06);
  EXPECT_THAT(coarse, HasSubstr("0.120 m thick"));
  EXPECT_THAT(coarse, HasSubstr("a finger, a hand and a forearm are thinner"));
  EXPECT_THAT(coarse, HasSubstr("more than 1 of 4 views"));
  EXPECT_THAT(WhatIsMissed({.preset = Preset::kSoundPlanes}, 4, 0.01),
              HasSubstr("a finger is thinner"));
  EXPECT_THAT(WhatIsMissed({.preset = Preset::kSound}, 4, 0.005),
              HasSubstr("no part of a person is thinner"));
}

TEST(WhatIsMissed, OtherPresetsMissAnySize) {
  EXPECT_THAT(WhatIsMissed({}, 4, 0), HasSubstr("more than 1 of 4 views"));
  EXPECT_THAT(WhatIsMissed({.preset = Preset::kPaper}, 4, 0), HasSubstr("more than 0 of 4 views"));
  EXPECT_THAT(WhatIsMissed({.preset = Preset::kCalibrated}, 4, 0), HasSubstr("from all views"));
  for (const Preset preset : {Preset::kUncalibrated, Preset::kPaper, Preset::kCalibrated}) {
    EXPECT_THAT(WhatIsMissed({.preset = preset}, 4, 0), HasSubstr("any size"));
  }
}

}  // namespace
}  // namespace silhouette
