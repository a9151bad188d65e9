// SPDX-License-Identifier: Apache-2.0
#include "common/text/utf8.h"

#include <iconv.h>

namespace silhouette {

bool IsUtf8(std::string text) {
  const iconv_t converter = iconv_open("WCHAR_T", "UTF-8");  // needs no module of glibc
  std::string wide(sizeof(wchar_t) * (text.size() + 1), 0);
  char* from = text.data();
  char* to = wide.data();
  size_t left = text.size();
  size_t room = wide.size();
  const bool converted = iconv(converter, &from, &left, &to, &room) != static_cast<size_t>(-1);
  iconv_close(converter);
  return converted;
}

}  // namespace silhouette
