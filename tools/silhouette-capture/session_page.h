// SPDX-License-Identifier: Apache-2.0
// The report of a database's capture sessions as a page, and as JSON.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "tools/silhouette-capture/session_facts.h"

namespace silhouette {

// PNG files by the name of their picture: coverage, sentinels; outliers and history if there are
// any.
using ReportPictures = std::map<std::string, std::string>;

// What is to be said first, in a sentence.
std::string VerdictOf(const SessionFacts& facts);

std::string SessionPage(const SessionFacts& facts, const storage::v1::CellDescription& cell,
                        const std::vector<std::pair<std::string, std::string>>& origin,
                        const ReportPictures& pictures);

nlohmann::ordered_json SessionJson(const SessionFacts& facts,
                                   const storage::v1::CellDescription& cell);

}  // namespace silhouette
