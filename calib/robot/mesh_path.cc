// SPDX-License-Identifier: Apache-2.0
#include "calib/robot/mesh_path.h"

#include <tinyxml.h>

#include <cctype>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "db/status/status_macros.h"

namespace silhouette {
namespace {

namespace fs = std::filesystem;

// %20 as a space, and so on.
std::string Unescaped(std::string_view uri) {
  std::string path;
  for (size_t i = 0; i < uri.size(); ++i) {
    const auto is_digit = [&](size_t at) {
      return at < uri.size() && std::isxdigit(static_cast<unsigned char>(uri[at])) != 0;
    };
    if (uri[i] != '%' || !is_digit(i + 1) || !is_digit(i + 2)) {
      path += uri[i];
      continue;
    }
    path += static_cast<char>(std::stoi(std::string(uri.substr(i + 1, 2)), nullptr, 16));
    i += 2;
  }
  return path;
}

// Where packages may be: the roots that are stated, and the folders above the URDF.
std::vector<fs::path> Roots(const fs::path& urdf, std::span<const std::string> package_paths) {
  std::vector<fs::path> roots(package_paths.begin(), package_paths.end());
  const fs::path folder = fs::absolute(urdf).lexically_normal().parent_path();
  for (fs::path at = folder; at.has_relative_path(); at = at.parent_path()) roots.push_back(at);
  return roots;
}

// Whether a folder is that package: it is called so, or its package.xml says it.
bool IsPackage(const fs::path& folder, const std::string& package) {
  if (folder.filename() == package) return true;
  TiXmlDocument manifest;
  if (!manifest.LoadFile((folder / "package.xml").string())) return false;
  const TiXmlElement* const root = manifest.RootElement();
  const TiXmlElement* const name = root == nullptr ? nullptr : root->FirstChildElement("name");
  return name != nullptr && name->GetText() != nullptr && name->GetText() == package;
}

absl::StatusOr<std::string> InPackage(const std::string& name, const std::string& rest,
                                      const fs::path& urdf,
                                      std::span<const std::string> package_paths) {
  const size_t slash = rest.find('/');
  const std::string package = rest.substr(0, slash);
  const std::string inside = slash == std::string::npos ? "" : rest.substr(slash + 1);
  fs::path found;  // a package of this name, without the file
  for (const fs::path& root : Roots(urdf, package_paths)) {
    const fs::path own = root.has_filename() ? root : root.parent_path();
    for (const fs::path& at : {root / package, IsPackage(own, package) ? own : fs::path()}) {
      if (at.empty() || !fs::is_directory(at)) continue;
      if (fs::exists(at / inside)) return (at / inside).string();
      if (found.empty()) found = at;
    }
  }
  if (!found.empty()) {
    return NotFound("the mesh '", name, "' was not found: '", found.string(), "' has no '", inside,
                    "'", InOtherCase((found / inside).string()),
                    "; correct the name, or add the folder that holds another package '", package,
                    "' to package_paths");
  }
  return NotFound("the mesh '", name, "' was not found; add the folder that holds the package '",
                  package, "' to package_paths (now: ",
                  package_paths.empty() ? "none" : absl::StrJoin(package_paths, ", "), ")");
}

}  // namespace

absl::StatusOr<std::string> MeshPath(const std::string& as_written, const std::string& urdf,
                                     std::span<const std::string> package_paths) {
  const std::string name = absl::StrReplaceAll(as_written, {{"\\", "/"}});
  const fs::path folder = fs::path(urdf).parent_path();
  const size_t scheme_end = name.find("://");
  if (scheme_end == std::string::npos) return (folder / name).string();
  const std::string scheme = name.substr(0, scheme_end);
  const std::string rest = Unescaped(std::string_view(name).substr(scheme_end + 3));
  if (scheme == "package" || scheme == "model") return InPackage(name, rest, urdf, package_paths);
  if (scheme == "file") {
    return (folder / (rest.starts_with("localhost/") ? rest.substr(9) : rest)).string();
  }
  return InvalidArgument("the mesh '", name,
                         "' cannot be fetched; copy it here, and name it by its path, by file:// "
                         "or by package://");
}

std::string InOtherCase(const std::string& path) {
  fs::path found;
  for (const fs::path& part : fs::absolute(path).lexically_normal()) {
    std::error_code error;
    fs::path next = found / part;
    if (!fs::exists(next, error)) {
      next.clear();
      for (const fs::directory_entry& entry : fs::directory_iterator(found, error)) {
        if (absl::EqualsIgnoreCase(entry.path().filename().string(), part.string())) {
          next = entry.path();
        }
      }
      if (next.empty()) return "";
    }
    found = next;
  }
  return absl::StrCat("; there is '", found.string(), "', in other upper and lower case");
}

}  // namespace silhouette
