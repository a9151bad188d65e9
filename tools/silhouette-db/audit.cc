// SPDX-License-Identifier: Apache-2.0
// silhouette-db audit: the file where a server records changes.
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

#include "db/status/status_macros.h"
#include "server/audit/audit_chain.h"
#include "tools/silhouette-db/commands.h"

namespace silhouette {
namespace {

struct AuditOptions {
  std::string file;
  std::string format = "text";
};

absl::StatusOr<ExitCode> VerifyAudit(const AuditOptions& options) {
  const absl::StatusOr<AuditFile> audit = ReadAudit(options.file);
  if (!audit.ok() && !absl::IsDataLoss(audit.status())) return audit.status();
  const std::string fault = audit.ok() ? "" : std::string(audit.status().message());
  if (options.format == "json") {
    nlohmann::ordered_json json = {{"fits", audit.ok()}};
    if (audit.ok()) {
      json["lines"] = audit->end.lines;
      json["digest"] = audit->end.digest;
      json["torn_bytes"] = audit->torn.size();
    } else {
      json["fault"] = fault;
    }
    std::printf("%s\n", json.dump(2).c_str());
  } else if (!audit.ok()) {
    std::printf("%s\n", fault.c_str());
  } else {
    std::printf("%llu lines fit together; digest of the last one: %s\n",
                static_cast<unsigned long long>(audit->end.lines), audit->end.digest.c_str());
    if (!audit->torn.empty()) {
      std::printf("%zu bytes of a further line are incomplete: a server is writing it, or died\n",
                  audit->torn.size());
    }
  }
  return audit.ok() ? kDone : kNo;
}

}  // namespace

void AddAudit(CLI::App& app, Work& work) {
  CLI::App& audit = *app.add_subcommand("audit", "The file where a server records changes");
  audit.require_subcommand(1);
  const auto [verify, options] = AddCommand<AuditOptions>(
      audit, work, "verify", "Whether each line of an audit file fits the one before", VerifyAudit);
  verify.add_option("file", options.file, "The audit file")->required();
  AddFormatOption(verify, options.format);
  verify.footer(
      "A line that was changed, removed or added breaks the chain: exit code 1, and the first "
      "line\n"
      "that does not fit. Lines cut off at the end are noticed by the digest: compare it with one\n"
      "that was kept elsewhere, such as in the server's log.\n\n"
      "Example:\n"
      "  silhouette-db audit verify audit.jsonl");
  audit.footer("Example:\n  silhouette-db audit verify audit.jsonl");
}

}  // namespace silhouette
