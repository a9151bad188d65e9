// SPDX-License-Identifier: Apache-2.0
// Lines of a log that no text in them can forge.
#pragma once

#include <spdlog/formatter.h>

#include <memory>
#include <string>
#include <string_view>

namespace silhouette {

// The text with escapes, as \n and \x1b, for what could end its line, steer a terminal or reorder
// what is shown: control characters, line and paragraph separators, marks of direction, and bytes
// that are no UTF-8.
std::string Printable(std::string_view text);

// Formats as spdlog's pattern says, each message made Printable. For all loggers of a program:
// spdlog::set_formatter.
std::unique_ptr<spdlog::formatter> LineFormatter(const std::string& pattern = "%+");

}  // namespace silhouette
