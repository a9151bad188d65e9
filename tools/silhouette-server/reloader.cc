// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-server/reloader.h"

#include <spdlog/spdlog.h>

#include <exception>
#include <memory>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "common/picture/files.h"
#include "server/gate/credentials.h"
#include "tools/silhouette-server/cell_database.h"

namespace silhouette {
namespace {

constexpr char kSuspectsChanged[] =
    "a capture session changed which robot images are suspect; loading the database again";
constexpr int kLooksBetweenLoads = 10;

}  // namespace

Reloader::Reloader(const Cell& cell, std::string cell_text, bool unverified, Server& server)
    : cell_(cell), cell_text_(std::move(cell_text)), unverified_(unverified), server_(server) {}

void Reloader::Reload() {
  ReportCertificates();
  ReportChangedCell();
  LoadAgain();
}

void Reloader::ReloadIfSuspectsChanged() {
  if (MustLoadAgain(*server_.database())) LoadAgain();
}

bool Reloader::MustLoadAgain(const ServedDatabase& database) {
  if (database.damage().found()) {
    return database.damage().what() == kSuspectsChanged && ++looks_ % kLooksBetweenLoads == 0;
  }
  const absl::StatusOr<bool> changed = database.SuspectsChanged();
  if (std::string now(changed.status().message()); now != fault_) {
    fault_ = std::move(now);
    if (!fault_.empty()) spdlog::error("suspect robot images are not noticed: {}", fault_);
  }
  if (changed.ok() ? !*changed : !absl::IsDataLoss(changed.status())) return false;
  spdlog::warn("nothing is free: {}", kSuspectsChanged);
  database.damage().Note(kSuspectsChanged);
  looks_ = 0;
  return true;
}

void Reloader::LoadAgain() {
  try {
    absl::StatusOr<std::shared_ptr<const ServedDatabase>> database =
        LoadDatabase(cell_, unverified_);
    if (database.ok()) {
      const absl::Status known = MarginsKnown(cell_, **database);
      server_.ReplaceDatabase(*std::move(database));
      spdlog::info("reloaded; verdicts are unknown until the next scene");
      if (!known.ok()) spdlog::error("nothing is free: {}", std::string(known.message()));
      return;
    }
    ReportNotReloaded(std::string(database.status().message()));
  } catch (const std::exception& error) {
    ReportNotReloaded(error.what());
  }
}

// New connections use changed certificates anyway; here the log says whether they can.
void Reloader::ReportCertificates() const {
  if (!cell_.server.gate.tls) return;
  const absl::StatusOr<TlsTexts> texts = ReadTls(*cell_.server.gate.tls);
  if (texts.ok()) {
    spdlog::info("certificate '{}' is valid until {}", cell_.server.gate.tls->certificate,
                 absl::FormatTime(texts->valid_until));
  } else {
    spdlog::error("certificates not renewed, still using the former ones: {}",
                  std::string(texts.status().message()));
  }
}

void Reloader::ReportChangedCell() const {
  const absl::StatusOr<std::string> now = ReadWholeFile(cell_.file);
  if (now.ok() && *now == cell_text_) return;
  spdlog::warn("'{}' has changed, and its former settings still hold: restart the server",
               cell_.file);
}

void Reloader::ReportNotReloaded(const std::string& why) const {
  const bool damaged = server_.database()->damage().found();
  spdlog::error("not reloaded, {}: {}",
                damaged ? "and nothing is free" : "still serving the old state", why);
}

}  // namespace silhouette
