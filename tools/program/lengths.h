// SPDX-License-Identifier: Apache-2.0
// Lengths on the command line.
#pragma once

namespace CLI {
class Option;
}  // namespace CLI

namespace silhouette {

enum class LengthUnit { kMetres, kMillimetres };

// Lets an option that holds a length in `unit` take others, too: "30mm", "3 cm", "0.03m". A number
// without a unit is in `unit`. Returns the option.
CLI::Option* TakeLengths(CLI::Option* option, LengthUnit unit = LengthUnit::kMetres);

}  // namespace silhouette
