// SPDX-License-Identifier: Apache-2.0
#include "server/audit/audit_chain.h"

#include <openssl/sha.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

using Json = nlohmann::ordered_json;

std::string DigestOf(std::string_view line) {
  std::array<unsigned char, SHA256_DIGEST_LENGTH> digest{};
  SHA256(reinterpret_cast<const unsigned char*>(line.data()), line.size(), digest.data());
  return absl::BytesToHexString({reinterpret_cast<const char*>(digest.data()), digest.size()});
}

std::string Bounded(const std::string& text) {
  return text.size() <= kMostAuditText ? text : text.substr(0, kMostAuditText) + "...";
}

// Why a line cannot follow `end`; empty: it can.
std::string WhyUnfit(const std::string& line, const AuditEnd& end) {
  const Json json = Json::parse(line, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return "is not a JSON object";
  if (!json.contains("line") || !json["line"].is_number_unsigned()) return "has no 'line'";
  if (!json.contains("before") || !json["before"].is_string()) return "has no 'before'";
  if (json["line"] != end.lines + 1) {
    return absl::StrCat("says that it is line ", json["line"].get<uint64_t>());
  }
  if (json["before"] != end.digest) return "does not hold the digest of the line before";
  return "";
}

// Whether `torn` begins as the line after `end`. A crash may leave NULs in place of the rest.
bool IsTornLine(std::string_view torn, const AuditEnd& end) {
  const std::string_view text = torn.substr(0, torn.find_last_not_of('\0') + 1);
  const std::string begin = absl::StrCat("{\"line\":", end.lines + 1, ",");
  return text.substr(0, begin.size()) == begin.substr(0, text.size());
}

}  // namespace

std::string AuditLine(const AuditEntry& entry, AuditEnd& end) {
  const Json json = {
      {"line", end.lines + 1},
      {"time", absl::FormatTime("%Y-%m-%dT%H:%M:%E6SZ", entry.time, absl::UTCTimeZone())},
      {"running_ns", absl::ToInt64Nanoseconds(entry.running)},
      {"who", Bounded(entry.who)},
      {"what", Bounded(entry.what)},
      {"detail", Bounded(entry.detail)},
      {"before", end.digest}};
  const std::string line =
      json.dump(/*indent=*/-1, ' ', /*ensure_ascii=*/true, Json::error_handler_t::replace);
  end = {.lines = end.lines + 1, .digest = DigestOf(line)};
  return line;
}

absl::StatusOr<AuditFile> ReadAudit(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return NotFound("cannot read '", path, "': ", strerror(errno));
  AuditFile audit;
  std::string line;
  while (std::getline(file, line)) {
    if (file.eof()) {  // without a newline
      if (!IsTornLine(line, audit.end)) {
        return absl::DataLossError(absl::StrCat("'", path, "': line ", audit.end.lines + 1,
                                                " has no end and is not of an audit file"));
      }
      audit.torn = line;
      break;
    }
    if (const std::string unfit = WhyUnfit(line, audit.end); !unfit.empty()) {
      return absl::DataLossError(
          absl::StrCat("'", path, "': line ", audit.end.lines + 1, " ", unfit));
    }
    audit.end = {.lines = audit.end.lines + 1, .digest = DigestOf(line)};
    audit.whole += line.size() + 1;
  }
  if (file.bad()) return absl::DataLossError(absl::StrCat("cannot read all of '", path, "'"));
  return audit;
}

}  // namespace silhouette
