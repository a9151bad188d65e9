// SPDX-License-Identifier: Apache-2.0
// Reports as HTML pages that need no other file, no network and no script. A report has a template,
// an .html file beside its source, and makes the JSON that the template shows.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace silhouette {

// The text as a browser shows it, in elements and attributes.
std::string Escaped(const std::string& text);

// Fills a Mustache template (mustache(5)): {{name}} is escaped, {{{name}}} is HTML, {{#name}}
// begins a section that is left out for null, false and empty lists. A name that an object does not
// have is looked for in the objects around it. Parts that each template may use: {{>table.html}},
// {{>tiles.html}}. Throws std::logic_error if the template is wrong.
std::string Filled(std::string_view page_template, const nlohmann::ordered_json& data);

// A figure of a report's first row, for {{>tiles.html}}, which shows the list `tiles`. `grade`: as
// TableCell's.
nlohmann::ordered_json Tile(const std::string& name, const std::string& grade,
                            const std::string& value, const std::string& unit,
                            const std::string& more);

// The page around `body`, which is HTML. `origin`: where its data come from, names and values.
std::string Page(const std::string& title,
                 const std::vector<std::pair<std::string, std::string>>& origin,
                 const std::string& body);

// An image within the page. `caption` and `alt` are plain text.
std::string PngFigure(std::string_view png, const std::string& caption, const std::string& alt);

}  // namespace silhouette
