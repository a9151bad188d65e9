// Reports as HTML pages that need no other file, no network and no script.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace silhouette {

// What a browser shows as `text`, in elements and attributes.
std::string Escaped(const std::string& text);

// The page around `body`, which is HTML. `origin`: what it says of where its data come from, names
// and values.
std::string Page(const std::string& title,
                 const std::vector<std::pair<std::string, std::string>>& origin,
                 const std::string& body);

// An image within the page. `caption` and `alt` are plain text.
std::string PngFigure(std::string_view png, const std::string& caption, const std::string& alt);

}  // namespace silhouette
