// SPDX-License-Identifier: Apache-2.0
#include "tools/silhouette-calibrate/frame_files.h"

#include <glob.h>

#include <algorithm>
#include <filesystem>
#include <regex>

#include "absl/strings/ascii.h"
#include "absl/strings/str_join.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

// In the order of paths, without hidden ones.
std::vector<std::string> FilesIn(const std::string& folder) {
  std::vector<std::string> paths;
  std::error_code error;  // there are none that can be read
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const bool hidden = entry.path().filename().string().starts_with('.');
    if (!hidden && entry.is_regular_file(error)) paths.push_back(entry.path().string());
  }
  std::ranges::sort(paths);
  return paths;
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
    std::string frame =
        absl::StrJoin(std::vector<std::string>(match.begin() + 1, match.end()), "_");
    if (frame.find_first_not_of('_') != std::string::npos) return frame;
  }
  return fs::path(path).stem().string();
}

}  // namespace

std::optional<std::string> FrameByPath(const std::string& path, const std::string& pattern) {
  const std::string name = fs::path(path).filename().string();
  const std::string name_pattern = fs::path(pattern).filename().string();
  if (std::regex_match(path, GroupsOf(pattern))) return FrameOf(path, pattern);
  if (std::regex_match(name, GroupsOf(name_pattern))) return FrameOf(name, name_pattern);
  if (fs::path(path).parent_path() == fs::path(pattern)) return fs::path(path).stem().string();
  return std::nullopt;
}

std::vector<FrameFile> FilesOfFrames(const std::string& pattern) {
  std::error_code error;
  const bool folder = fs::is_directory(pattern, error);
  std::vector<FrameFile> files;
  for (const std::string& path : (folder ? FilesIn(pattern) : Matches(pattern))) {
    files.push_back({folder ? fs::path(path).stem().string() : FrameOf(path, pattern), path});
  }
  return files;
}

}  // namespace silhouette
