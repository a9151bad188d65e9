// SPDX-License-Identifier: Apache-2.0
// What a client needs for an encrypted connection.
#pragma once

#include <string>

namespace silhouette {

// PEM files: the authority that signed the server's certificate, and this client's own certificate
// and private key. None or all.
struct ClientTlsFiles {
  std::string ca = {};
  std::string certificate = {};
  std::string key = {};

  bool operator==(const ClientTlsFiles&) const = default;
};

}  // namespace silhouette
