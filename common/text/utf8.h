// SPDX-License-Identifier: Apache-2.0
// The encoding of texts. Names go into messages and databases, whose texts are UTF-8.
#pragma once

#include <string>

namespace silhouette {

bool IsUtf8(std::string text);

}  // namespace silhouette
