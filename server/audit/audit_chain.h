// SPDX-License-Identifier: Apache-2.0
// The audit file: one JSON object a line, each with the SHA-256 digest of the line before. A line
// that is changed, removed or put in between no longer fits its neighbours. Lines cut off at the
// end are noticed only by who kept a later digest.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace silhouette {

struct AuditEntry {
  absl::Time time;         // wall clock
  absl::Duration running;  // running clock (server/scene/clock.h)
  std::string who;         // the caller, or "server"
  std::string what;        // "region.allow"
  std::string detail;
};

// Texts are cut to this many bytes.
inline constexpr size_t kMostAuditText = 1024;

// The end of a chain, to which the next line is added.
struct AuditEnd {
  uint64_t lines = 0;
  std::string digest = std::string(64, '0');  // hexadecimal, of the last line
};

// The line after `end`, without its newline; `end` becomes that of the longer chain. Only printable
// ASCII, whatever the texts hold.
std::string AuditLine(const AuditEntry& entry, AuditEnd& end);

struct AuditFile {
  AuditEnd end;
  // Bytes after the last newline: a line that was being written when the writer died.
  std::string torn;
  uint64_t whole = 0;  // bytes before these
};

// Reads a file and verifies its chain. NotFound: it cannot be read. DataLoss names the first line
// that does not fit, and why.
absl::StatusOr<AuditFile> ReadAudit(const std::string& path);

}  // namespace silhouette
