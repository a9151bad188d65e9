// SPDX-License-Identifier: Apache-2.0
#include "common/text/host_port.h"

#include <gtest/gtest.h>

namespace silhouette {
namespace {

TEST(HostPort, IsReadAndWrittenAlike) {
  for (const char* text : {"127.0.0.1:8080", "[::1]:0", "[2001:db8::7]:65535", "localhost:1"}) {
    const auto address = ParseHostPort(text);
    ASSERT_TRUE(address.has_value()) << text;
    EXPECT_EQ(address->Text(), text);
  }
  EXPECT_EQ(ParseHostPort("[::1]:8080")->host, "::1");
  EXPECT_EQ(ParseHostPort("[::1]:8080")->port, 8080);
}

TEST(HostPort, WhatCouldMeanSomethingElseIsNone) {
  for (const char* text :
       {"", ":", ":80", "host", "host:", "host:x", "host:80 ", "host:-1", "host:65536", "::1:8080",
        "::1", "[::1]", "[]:80", "[host]:80", "http://host:80"}) {
    EXPECT_FALSE(ParseHostPort(text)) << text;
  }
}

}  // namespace
}  // namespace silhouette
