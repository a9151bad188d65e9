// SPDX-License-Identifier: Apache-2.0
#include "tools/program/for_shell.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"

namespace silhouette {

std::string ForShell(std::string_view word) {
  const bool plain = word.find_first_not_of(
                         "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
                         "_-./:@%+,=") == std::string_view::npos;
  if (plain && !word.empty()) return std::string(word);
  return absl::StrCat("'", absl::StrReplaceAll({word.data(), word.size()}, {{"'", "'\\''"}}), "'");
}

}  // namespace silhouette
