#include "tools/silhouette-calibrate/detect_images.h"

#include <glob.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <regex>
#include <set>

#include "absl/status/status.h"
#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

bool IsImage(const std::string& path) {
  static const std::set<std::string> extensions = {".png",  ".jpg", ".jpeg", ".bmp", ".tif",
                                                   ".tiff", ".pgm", ".ppm",  ".webp"};
  return extensions.contains(absl::AsciiStrToLower(fs::path(path).extension().string()));
}

std::vector<std::string> Matches(const std::string& pattern) {
  glob_t found{};
  std::vector<std::string> paths;
  if (glob(pattern.c_str(), 0, nullptr, &found) == 0) {
    for (size_t i = 0; i < found.gl_pathc; ++i) {
      if (fs::is_regular_file(found.gl_pathv[i])) paths.emplace_back(found.gl_pathv[i]);
    }
  }
  globfree(&found);
  return paths;
}

// The pattern as a regular expression with a group for each *.
std::regex GroupsOf(const std::string& pattern) {
  std::string text;
  for (size_t i = 0; i < pattern.size(); ++i) {
    const char c = pattern[i];
    if (c == '*') {
      text += "([^/]*)";
    } else if (c == '?') {
      text += "[^/]";
    } else if (const size_t end = pattern.find(']', i + 2); c == '[' && end != std::string::npos) {
      std::string set = pattern.substr(i, end - i + 1);
      if (set[1] == '!') set[1] = '^';
      text += set;
      i = end;
    } else {
      if (!absl::ascii_isalnum(static_cast<unsigned char>(c))) text += '\\';
      text += c;
    }
  }
  return std::regex(text);
}

std::string FrameOf(const std::string& path, const std::string& pattern) {
  std::smatch match;
  if (pattern.find('*') != std::string::npos && std::regex_match(path, match, GroupsOf(pattern))) {
    const std::string frame =
        absl::StrJoin(std::vector<std::string>(match.begin() + 1, match.end()), "_");
    if (frame.find_first_not_of('_') != std::string::npos) return frame;
  }
  return fs::path(path).stem().string();
}

}  // namespace

absl::StatusOr<std::vector<ListedImage>> ListImages(const std::vector<std::string>& patterns) {
  std::vector<ListedImage> images;
  std::set<std::string> views;
  std::map<std::string, std::string> view_of_path;
  for (const std::string& argument : patterns) {
    const size_t equals = argument.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == argument.size()) {
      return absl::InvalidArgumentError(
          absl::StrCat("--images '", argument, "' is not VIEW=PATTERN, e.g. 'left=left/*.png'"));
    }
    const std::string view = argument.substr(0, equals);
    std::string pattern = argument.substr(equals + 1);
    if (!views.insert(view).second) {
      return absl::InvalidArgumentError(absl::StrCat("--images has the view '", view, "' twice"));
    }
    std::error_code error;
    const bool folder = fs::is_directory(pattern, error);
    if (folder) pattern = (fs::path(pattern) / "*").string();
    std::map<std::string, std::string> path_of_frame;
    for (const std::string& path : Matches(pattern)) {
      if (folder && !IsImage(path)) continue;
      const std::string frame = folder ? fs::path(path).stem().string() : FrameOf(path, pattern);
      if (const auto [other, fresh] = path_of_frame.emplace(frame, path); !fresh) {
        return absl::InvalidArgumentError(
            absl::StrCat("'", other->second, "' and '", path, "' are both frame '", frame,
                         "' of view '", view, "'; put the * where the names differ"));
      }
      const std::string real = fs::weakly_canonical(path, error).string();
      if (const auto [other, fresh] = view_of_path.emplace(real, view); !fresh) {
        return absl::InvalidArgumentError(absl::StrCat("'", path, "' is an image of view '",
                                                       other->second, "' and of view '", view,
                                                       "'; mend one of the patterns"));
      }
      images.push_back({view, frame, path});
    }
    if (path_of_frame.empty()) {
      return absl::InvalidArgumentError(absl::StrCat("no image of view '", view, "' matches '",
                                                     argument.substr(equals + 1), "'"));
    }
  }
  return images;
}

}  // namespace silhouette
