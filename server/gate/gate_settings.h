// SPDX-License-Identifier: Apache-2.0
// Who reaches a server, and how.
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>

#include "server/gate/roles.h"

namespace silhouette {

// PEM files: the server's certificate (with those between it and its authority), its private key,
// and the authorities that sign the certificates of clients.
struct TlsFiles {
  std::string certificate;
  std::string key;
  std::string client_ca;
};

struct GateSettings {
  std::optional<TlsFiles> tls;  // nothing: plain text
  // With tls: not empty, names in certificates. On a Unix socket: users; empty, everyone who
  // connects may do everything. Else empty.
  Roles roles;
  // Whether plain text may be spoken beyond this machine.
  bool insecure = false;
  // Of a Unix socket, whose file decides who may connect. Neither: as the process makes files. A
  // group alone: 0660.
  std::optional<mode_t> socket_mode;
  std::string socket_group;
};

}  // namespace silhouette
