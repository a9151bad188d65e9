// SPDX-License-Identifier: Apache-2.0
// Loads the database of a running server again.
#pragma once

#include <string>

#include "server/scene/served_database.h"
#include "server/service/server.h"
#include "tools/cell/cell.h"

namespace silhouette {

// The log reports each reload and why one fails. If it fails, the server keeps its database. For
// one thread.
class Reloader {
 public:
  // `cell` and `server` must outlive this. `cell_text`: the text of the cell file when `cell` was
  // read. `unverified`: as in LoadDatabase.
  Reloader(const Cell& cell, std::string cell_text, bool unverified, Server& server);

  // What SIGHUP asks for. Reads the database, the calibration, and the files that the cell file
  // names. The log also reports whether new connections can use the certificates, and whether the
  // cell file has changed: its former settings still hold.
  void Reload();

  // To be called about once a second. Looks whether a capture session changed which robot images
  // are suspect. Nothing is free then, until the database is loaded again: at once, and now and
  // again while that fails.
  void ReloadIfSuspectsChanged();

 private:
  // Whether ReloadIfSuspectsChanged must load the database.
  bool MustLoadAgain(const ServedDatabase& database);
  void LoadAgain();
  void ReportCertificates() const;
  void ReportChangedCell() const;
  void ReportNotReloaded(const std::string& why) const;

  const Cell& cell_;
  const std::string cell_text_;
  const bool unverified_;
  Server& server_;
  int looks_ = 0;      // since the database was loaded in vain
  std::string fault_;  // of the last look at suspect robot images; empty: none
};

}  // namespace silhouette
