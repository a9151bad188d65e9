// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-server/reloader.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <exception>
#include <functional>
#include <memory>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

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
constexpr std::chrono::seconds kBetweenLooks{1};

}  // namespace

FileHashes HashesOf(const Cell& cell) {
  FileHashes hashes;
  const auto add = [&](const std::string& path) {
    if (hashes.contains(path)) return;
    const absl::StatusOr<std::string> bytes = ReadWholeFile(path);
    hashes[path] = bytes.ok() ? std::optional(std::hash<std::string>()(*bytes)) : std::nullopt;
  };
  add(cell.file);
  if (cell.robot.model == nullptr) return hashes;
  add(cell.robot.urdf);
  for (const RobotLink& link : cell.robot.model->links()) {
    for (const auto* bodies : {&link.visual, &link.collision}) {
      for (const LinkGeometry& body : *bodies) {
        if (const auto* mesh = std::get_if<MeshShape>(&body.shape)) add(mesh->path);
      }
    }
  }
  return hashes;
}

Reloader::Reloader(Cell cell, FileHashes files, bool unverified, Server& server)
    : cell_(std::move(cell)), files_(std::move(files)), unverified_(unverified), server_(&server) {}

std::future<void> Reloader::Start(std::shared_ptr<Reloader> reloader, Signals& signals) {
  std::promise<void> end;
  std::future<void> done = end.get_future();
  std::thread([reloader = std::move(reloader), &signals, end = std::move(end)]() mutable {
    for (Signals::Wish wish{}; wish != Signals::Wish::kEnd; wish = signals.Wait(kBetweenLooks)) {
      if (wish == Signals::Wish::kReload) {
        reloader->Reload();
      } else {
        reloader->ReloadIfSuspectsChanged();
      }
    }
    end.set_value();
  }).detach();
  return done;
}

void Reloader::Leave() {
  const std::lock_guard lock(mutex_);
  server_ = nullptr;
}

std::shared_ptr<const ServedDatabase> Reloader::Served() {
  const std::lock_guard lock(mutex_);
  return server_ == nullptr ? nullptr : server_->database();
}

void Reloader::Reload() {
  ReportCertificates();
  ReportChangedFiles();
  LoadAgain();
}

void Reloader::ReloadIfSuspectsChanged() {
  const std::shared_ptr<const ServedDatabase> served = Served();
  if (served != nullptr && MustLoadAgain(*served)) LoadAgain();
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
      if (!Replace(*std::move(database))) return;
      spdlog::info("reloaded; verdicts are unknown until the next scene");
      if (!known.ok()) spdlog::error("nothing is free: {}", std::string(known.message()));
      return;
    }
    ReportNotReloaded(std::string(database.status().message()));
  } catch (const std::exception& error) {
    ReportNotReloaded(error.what());
  }
}

bool Reloader::Replace(std::shared_ptr<const ServedDatabase> database) {
  const std::lock_guard lock(mutex_);
  if (server_ == nullptr) return false;
  server_->ReplaceDatabase(std::move(database));
  return true;
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

void Reloader::ReportChangedFiles() const {
  for (const auto& [path, hash] : HashesOf(cell_)) {
    if (hash == files_.at(path)) continue;
    spdlog::warn("'{}' has changed, and its former contents still hold: restart the server", path);
  }
}

void Reloader::ReportNotReloaded(const std::string& why) {
  const std::shared_ptr<const ServedDatabase> served = Served();
  if (served == nullptr) return;
  const bool damaged = served->damage().found();
  spdlog::error("not reloaded, {}: {}",
                damaged ? "and nothing is free" : "still serving the old state", why);
}

}  // namespace silhouette
