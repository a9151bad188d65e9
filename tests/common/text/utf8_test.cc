// SPDX-License-Identifier: Apache-2.0
#include "common/text/utf8.h"

#include <gtest/gtest.h>

namespace silhouette {
namespace {

TEST(Utf8, OtherEncodingsAreNot) {
  EXPECT_TRUE(IsUtf8(""));
  EXPECT_TRUE(
      IsUtf8("Gr\xc3\xb6\xc3\x9f"
             "e"));
  EXPECT_FALSE(
      IsUtf8("Gr\xf6\xdf"
             "e"));
  EXPECT_FALSE(IsUtf8("cut\xc3"));
}

}  // namespace
}  // namespace silhouette
