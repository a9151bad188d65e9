// SPDX-License-Identifier: Apache-2.0
#include "common/log/log_lines.h"

#include <gtest/gtest.h>
#include <spdlog/logger.h>
#include <spdlog/sinks/ostream_sink.h>

#include <memory>
#include <sstream>

namespace silhouette {
namespace {

TEST(LogLines, TextsThatAreShownAsTheyAreStayAsTheyAre) {
  for (const char* text : {"", "scene 3 is good", "Gehäuse 'Ω' 日本 😀", "back\\slash {} %v"}) {
    EXPECT_EQ(Printable(text), text);
  }
}

TEST(LogLines, WhatEndsALineOrSteersATerminalIsEscaped) {
  EXPECT_EQ(Printable("a\nb\r\tc"), "a\\nb\\r\\tc");
  EXPECT_EQ(Printable(std::string_view("\0\x1b[31m\x7f", 7)), "\\x00\\x1b[31m\\x7f");
  EXPECT_EQ(Printable("\u0085\u009b2J"), "\\xc2\\x85\\xc2\\x9b2J") << "C1 controls";
  EXPECT_EQ(Printable("\u2028\u202e\u2066"), "\\xe2\\x80\\xa8\\xe2\\x80\\xae\\xe2\\x81\\xa6");
}

TEST(LogLines, BytesThatAreNoCharactersAreEscaped) {
  EXPECT_EQ(Printable("\x80z\xff"), "\\x80z\\xff");
  EXPECT_EQ(Printable("\xc0\x8a"), "\\xc0\\x8a") << "a line feed, too long";
  EXPECT_EQ(Printable("\xe2\x82"), "\\xe2\\x82") << "cut";
  EXPECT_EQ(Printable("\xed\xa0\x80"), "\\xed\\xa0\\x80") << "a surrogate";
}

TEST(LogLines, NoMessageMakesASecondLine) {
  std::ostringstream out;
  spdlog::logger logger("test", std::make_shared<spdlog::sinks::ostream_sink_st>(out));
  logger.set_formatter(LineFormatter("%l %v"));
  logger.info("region '{}' is revoked", "x'\ninfo all is well");
  EXPECT_EQ(out.str(), "info region 'x'\\ninfo all is well' is revoked\n");
}

}  // namespace
}  // namespace silhouette
