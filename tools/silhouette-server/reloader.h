// SPDX-License-Identifier: Apache-2.0
// Loads the database of a running server again.
#pragma once

#include <cstddef>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "server/scene/served_database.h"
#include "server/service/server.h"
#include "tools/cell/cell.h"
#include "tools/silhouette-server/signals.h"

namespace silhouette {

// Hashes of the files that only a start reads: cell file, URDF and meshes. By path; nothing: the
// file cannot be read.
using FileHashes = std::map<std::string, std::optional<size_t>>;
FileHashes HashesOf(const Cell& cell);

// The log reports each reload and why one fails. If it fails, the server keeps its database.
class Reloader {
 public:
  // `server` must outlive this, or Leave() be called before. `files`: when `cell` was read.
  // `unverified`: as in LoadDatabase.
  Reloader(Cell cell, FileHashes files, bool unverified, Server& server);

  // Reloads as the signals ask for, until they end the program, in a thread of its own. The result
  // is ready when the thread is done; destroying it leaves a thread behind that hangs.
  static std::future<void> Start(std::shared_ptr<Reloader> reloader, Signals& signals);

  // From now on the server is left alone. Thread-safe.
  void Leave();

 private:
  // What SIGHUP asks for. Reads the database, the calibration, and the files that the cell file
  // names. The log also reports whether new connections can use the certificates, and which files
  // that only a start reads have changed.
  void Reload();

  // To be called about once a second. Looks whether a capture session changed which robot images
  // are suspect. Nothing is free then, until the database is loaded again: at once, and now and
  // again while that fails.
  void ReloadIfSuspectsChanged();

  // What is served now; null after Leave().
  std::shared_ptr<const ServedDatabase> Served();
  // Whether ReloadIfSuspectsChanged must load the database.
  bool MustLoadAgain(const ServedDatabase& database);
  void LoadAgain();
  // False after Leave().
  bool Replace(std::shared_ptr<const ServedDatabase> database);
  void ReportCertificates() const;
  void ReportChangedFiles() const;
  void ReportNotReloaded(const std::string& why);

  const Cell cell_;
  const FileHashes files_;
  const bool unverified_;
  int looks_ = 0;      // since the database was loaded in vain
  std::string fault_;  // of the last look at suspect robot images; empty: none

  std::mutex mutex_;
  Server* server_;  // null after Leave(); guarded by mutex_
};

}  // namespace silhouette
