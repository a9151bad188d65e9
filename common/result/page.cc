// SPDX-License-Identifier: Apache-2.0
#include "common/result/page.h"

#include <kainjow/mustache.hpp>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "common/result/templates.h"

namespace silhouette {
namespace {

namespace mustache = kainjow::mustache;
using Json = nlohmann::ordered_json;

mustache::data DataOf(const Json& json) {
  if (json.is_object()) {
    mustache::data object;
    for (const auto& [name, value] : json.items()) object.set(name, DataOf(value));
    return object;
  }
  if (json.is_array()) {
    mustache::data list(mustache::data::type::list);
    for (const Json& value : json) list.push_back(DataOf(value));
    return list;
  }
  if (json.is_null()) return false;
  if (json.is_boolean()) return json.get<bool>();
  return json.is_string() ? json.get<std::string>() : json.dump();
}

}  // namespace

std::string Escaped(const std::string& text) {
  return absl::StrReplaceAll(
      text, {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}, {"'", "&#39;"}});
}

std::string Filled(std::string_view page_template, const Json& data) {
  mustache::mustache filler{std::string(page_template)};
  filler.set_custom_escape(Escaped);
  mustache::data all = DataOf(data);
  all.set("table.html", std::string(templates::table_html));
  all.set("tiles.html", std::string(templates::tiles_html));
  std::string html = filler.render(all);
  if (!filler.is_valid()) throw std::logic_error("page template: " + filler.error_message());
  return html;
}

Json Tile(const std::string& name, const std::string& grade, const std::string& value,
          const std::string& unit, const std::string& more) {
  return {{"name", name},
          {"grade", grade},
          {"value", value},
          {"unit", unit.empty() ? Json() : Json(unit)},
          {"more", more}};
}

std::string Page(const std::string& title,
                 const std::vector<std::pair<std::string, std::string>>& origin,
                 const std::string& body) {
  Json data = {
      {"title", title}, {"style", templates::page_css}, {"origin", Json::array()}, {"body", body}};
  for (const auto& [name, value] : origin) {
    data["origin"].push_back({{"name", name}, {"value", value}});
  }
  return Filled(templates::page_html, data);
}

std::string PngFigure(std::string_view png, const std::string& caption, const std::string& alt) {
  return absl::StrCat("<figure><figcaption>", Escaped(caption),
                      "</figcaption>\n<img style=\"max-width:100%\" src=\"data:image/png;base64,",
                      absl::Base64Escape({png.data(), png.size()}), "\" alt=\"", Escaped(alt),
                      "\"></figure>\n");
}

}  // namespace silhouette
