#include "common/page/page.h"

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "common/page/page_style.h"

namespace silhouette {

std::string Escaped(const std::string& text) {
  return absl::StrReplaceAll(
      text, {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}, {"'", "&#39;"}});
}

std::string Page(const std::string& title,
                 const std::vector<std::pair<std::string, std::string>>& origin,
                 const std::string& body) {
  std::string html = absl::StrCat(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width\">\n<title>",
      Escaped(title), "</title>\n<style>", kPageStyle, "</style>\n</head>\n<body>\n<main>\n<h1>",
      Escaped(title), "</h1>\n<div class=\"origin\">");
  for (const auto& [name, value] : origin) {
    absl::StrAppend(&html, "<span>", Escaped(name), " <b>", Escaped(value), "</b></span>\n");
  }
  return absl::StrCat(html, "</div>\n", body, "</main>\n</body>\n</html>\n");
}

std::string PngFigure(std::string_view png, const std::string& caption, const std::string& alt) {
  return absl::StrCat("<figure><figcaption>", Escaped(caption),
                      "</figcaption>\n<img style=\"max-width:100%\" src=\"data:image/png;base64,",
                      absl::Base64Escape({png.data(), png.size()}), "\" alt=\"", Escaped(alt),
                      "\"></figure>\n");
}

}  // namespace silhouette
