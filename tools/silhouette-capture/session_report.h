// Writes the report of a database's capture sessions.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "db/store/store.h"
#include "tools/silhouette-capture/opened_cell.h"
#include "tools/silhouette-capture/session_facts.h"

namespace silhouette {

// Where the report of a database's variant is kept if nobody says otherwise: beside its folder.
std::string DefaultReportFolder(const std::string& database, const std::string& variant);

// Writes report.html, report.json and the pictures into `folder`, which is made if it is not there.
// `log`: the story's file. Errors: those of reading the database and of writing files.
absl::StatusOr<SessionFacts> WriteSessionReport(const CellArguments& arguments,
                                                const std::string& cell_name,
                                                const Database& database, const std::string& log,
                                                const std::string& folder);

}  // namespace silhouette
