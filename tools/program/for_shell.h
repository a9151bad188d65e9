// SPDX-License-Identifier: Apache-2.0
// Commands that a program prints for the user to paste.
#pragma once

#include <string>
#include <string_view>

namespace silhouette {

// A word of a command line, quoted for a shell if it must be.
std::string ForShell(std::string_view word);

}  // namespace silhouette
